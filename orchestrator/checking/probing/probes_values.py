"""The probe of values: what is set is kept, and what follows from it follows at once."""

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.checking.probing.movement import Values, distinct, moved
from orchestrator.checking.probing.probes import Context, SkippedError, look
from orchestrator.checking.probing.statuses import StatusError
from orchestrator.checking.probing.variables import ProbedVariable, shown
from orchestrator.checking.probing.watched import narrow

_FEW_STEPS = 2
_EQUAL = 1e-9
_SAME = 1e-6  # what two solutions of one algebraic loop may differ by, relative
_SINGLE = 1e-6
_MOST = 500
_MOST_SHOWN = 5


def values(context: Context) -> None:
    """Set what can be set to other values than those of the file; read it back, and what depends on it."""
    bench, job = context.bench, context.bench.job
    movement = bench.movement.values
    _judge_types(context)
    if not movement:
        raise SkippedError("the FMU has nothing that can be set to other values, or takes none")
    if job.interface == "ScheduledExecution":
        raise SkippedError("the interface has no communication points")
    if not _kept_before(context, movement):
        return
    try:
        _kept_between(context, movement)
        _kept_at_limits(context)
        _follow_inputs(context, movement)
    except StatusError:
        return  # not every FMU takes values at every point; what must be taken has been set before
    _calculated(context, movement)


def _judge_types(context: Context) -> None:
    """Look at the values of types that can be wrong, in initialisation mode and during a driven run."""
    job = context.bench.job
    if not narrow(job):
        return
    run = context.observation
    seen = {v.key for v in run.variables}
    chosen = [v for v in narrow(job) if v.key in seen]
    complaints: set[str] = set()
    if run.initial:
        look(context, chosen, run.select(chosen, run.initial), "in initialisation mode", complaints)
    for n, row in enumerate(run.rows):
        look(context, chosen, run.select(chosen, row), f"at t = {job.start + (n + 1) * job.step:g}", complaints)


def _kept_before(context: Context, movement: Mapping[ProbedVariable, Values]) -> bool:
    """What is set before and in initialisation mode is there in it, and parameters and states also afterwards.

    Returns:
        Whether it is so.
    """
    bench, job = context.bench, context.bench.job
    # Others that have a start value may be computed anew: it is what they were before.
    states = {v.key for v in job.state_variables or ()}
    stays = [v for v in movement if v.causality in ("input", "parameter") or v.key in states]
    with bench.instance(moved=False) as driver:
        plain = _by_variable(stays, driver.read(stays, "after initialisation"))
    with bench.instance(initialised=False) as driver:
        bench.place(driver, inputs=False)
        driver.enter_initialisation(job.start, job.stop)
        bench.place(driver, inputs=True)
        found = _by_variable(stays, driver.read(stays, "in initialisation mode"))
        lost = _judge(context, {v: movement[v] for v in stays}, found, "before initialisation")
        driver.exit_initialisation()
        later = _by_variable(stays, driver.read(stays, "after initialisation"))
    # A state that an event at the start changes is no start value any more.
    kept = {v: movement[v] for v in stays if v not in lost and _equal(v, plain[v], v.start or ())}
    return not (lost or _judge(context, kept, later, "before initialisation, when that is over"))


def _kept_between(context: Context, movement: Mapping[ProbedVariable, Values]) -> None:
    """Inputs and tunable parameters that are set at a communication point are there."""
    bench, job = context.bench, context.bench.job
    inputs = [v for v in movement if v.causality == "input"]
    chosen = inputs + [v for v in movement if v.causality == "parameter" and v.variability == "tunable"]
    if not chosen:
        return
    steps = min(_FEW_STEPS, job.steps - 1)
    t = job.start + steps * job.step
    with bench.instance() as driver:
        bench.run(driver, 0, steps, read=False)
        now = _by_variable(chosen, driver.read(chosen))
        wanted = {v: x for v, value in now.items() if (x := moved(v, value, 1)) is not None}
        driver.set_discrete(wanted, t)
        found = _by_variable(list(wanted), driver.read(list(wanted)))
        lost = _judge(context, wanted, found, "at a communication point", "value.lags")
        followers = [v for v in job.variables if v.causality == "calculatedParameter" and v.variability == "tunable"]
        followers = [v for v in followers if not v.clocks][:_MOST]
        later = _by_variable(followers, driver.read(followers, "after a tunable parameter was set"))
    parameters = {v: x for v, x in wanted.items() if v.causality == "parameter"}
    if followers and parameters and not lost:
        _follow_tunable(context, parameters, later)


def _kept_at_limits(context: Context) -> None:
    """Continuous inputs that are set to their min and max are there; no step is done with them."""
    bench, job = context.bench, context.bench.job
    inputs = [v for v in distinct(job.inputs()) if v.variability == "continuous"] if bench.excited else []
    chosen = [v for v in inputs if v.minimum is not None and v.maximum is not None and v.minimum < v.maximum]
    if not chosen:
        return
    with bench.instance() as driver:
        for limit in ("minimum", "maximum"):
            wanted = {v: (float(getattr(v, limit)),) * v.size for v in chosen}
            for v, x in wanted.items():
                driver.set([v], x)
            found = _by_variable(chosen, driver.read(chosen))
            if _judge(context, wanted, found, f"at their {limit}, between steps", "value.lags"):
                return


def _follow_tunable(
    context: Context,
    parameters: Mapping[ProbedVariable, Values],
    now: Mapping[ProbedVariable, Sequence[Any]],
) -> None:
    """Tunable calculated parameters follow tunable parameters at once."""
    bench, job = context.bench, context.bench.job
    followers = list(now)
    with bench.instance(initialised=False) as other:
        bench.place(other, inputs=False)
        for v, x in parameters.items():
            other.set([v], x)
        other.enter_initialisation(job.start, job.stop)
        bench.place(other, inputs=True)
        other.exit_initialisation()
        wanted = _by_variable(followers, other.read(followers))
    _report_stale(context, wanted, now, "when a tunable parameter is set at a communication point")


def _follow_inputs(context: Context, movement: Mapping[ProbedVariable, Values]) -> None:
    """What is read in initialisation mode follows what was set last, not what was set first."""
    bench, job = context.bench, context.bench.job
    causalities = ("output", "calculatedParameter")
    followers = [v for v in distinct(job.variables) if v.causality in causalities and not v.clocks]
    followers = [v for v in followers if v.base not in ("Clock", "Binary") and not v.extents][:_MOST]
    inputs = [v for v in movement if v.causality == "input"]
    if not followers or not inputs:
        return
    rows = []
    for first in (True, False):
        with bench.instance(initialised=False) as driver:
            bench.place(driver, inputs=False)
            driver.enter_initialisation(job.start, job.stop)
            if first:
                driver.read(followers, "in initialisation mode")
            bench.place(driver, inputs=True)
            rows.append(_by_variable(followers, driver.read(followers, "in initialisation mode")))
    _report_stale(context, rows[1], rows[0], "when an input is set after it was read in initialisation mode")


def _report_stale(
    context: Context,
    wanted: Mapping[ProbedVariable, Sequence[Any]],
    now: Mapping[ProbedVariable, Sequence[Any]],
    when: str,
) -> None:
    for v, expected in wanted.items():
        if not _equal(v, now[v], expected, _SAME):
            values_shown = f"is {_shown(now[v])} instead of {_shown(expected)}"
            context.report("value.stale", f"`{v.name}` must follow {when}, but {values_shown}", v.name)


def _calculated(context: Context, movement: Mapping[ProbedVariable, Values]) -> None:
    """A calculated parameter that depends on parameters, all of which get other values, is another one then."""
    bench, job = context.bench, context.bench.job
    parameters = {v.key for v in job.variables if v.causality == "parameter"}
    moving = {v.key for v in movement}
    chosen = []
    for u in job.unknowns:
        v = u.variable
        if u.section == "initial" and v.causality == "calculatedParameter" and v.real:
            named = {k.key for k in u.knowns} if u.knowns is not None else parameters
            if named and named <= moving and (u.knowns is not None or len(parameters) > 0):
                chosen.append(v)
    if not chosen:
        return
    rows = []
    for is_moved in (False, True):
        with bench.instance(moved=is_moved) as driver:
            rows.append(_by_variable(chosen, driver.read(chosen)))
    still = [v.name for v in chosen if _equal(v, rows[1][v], rows[0][v], 0.0)]
    if still:
        names = ", ".join(f"`{name}`" for name in still[:10])
        message = f"calculated parameters must follow the parameters that they depend on, but {names} stay the same"
        context.report("value.calculated", message, still[0])


def _judge(
    context: Context,
    wanted: Mapping[ProbedVariable, Sequence[Any]],
    now: Mapping[ProbedVariable, Sequence[Any]],
    when: str,
    rule: str = "value.kept",
) -> list[ProbedVariable]:
    """Report what is not there any more, as one finding. Return the variables."""
    lost = [v for v, value in wanted.items() if not _equal(v, now[v], value)]
    if lost:
        shown_values = [f"`{v.name}` is {_shown(now[v])} instead of {_shown(wanted[v])}" for v in lost[:_MOST_SHOWN]]
        more = f", and {len(lost) - _MOST_SHOWN} more are not what was set" if len(lost) > _MOST_SHOWN else ""
        text = f"values must stay as they were set {when}, but {'; '.join(shown_values)}{more}"
        context.report(rule, text, lost[0].name)
    return lost


def _equal(v: ProbedVariable, a: Sequence[Any], b: Sequence[Any], tolerance: float = _EQUAL) -> bool:
    if v.base == "Float32":
        tolerance = max(tolerance, _SINGLE)
    for x, y in zip(a, b, strict=True):
        if isinstance(x, float) and isinstance(y, float):
            if x == x and y == y and abs(x - y) > tolerance * max(abs(x), abs(y)):  # noqa: PLR0124 (NaN is none)
                return False
        elif x != y and x is not None:  # a text that is null is a finding already
            return False
    return True


def _by_variable(variables: Sequence[ProbedVariable], row: Sequence[Any]) -> dict[ProbedVariable, tuple[Any, ...]]:
    found = {}
    at = 0
    for v in variables:
        found[v] = tuple(row[at : at + v.size])
        at += v.size
    return found


def _shown(values_read: Sequence[Any]) -> str:
    text = ", ".join(map(shown, values_read[:4]))
    return text if len(values_read) <= 4 else f"{text}, …"
