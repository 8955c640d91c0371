"""The probe of values: what is set is kept, and what follows from it follows at once."""

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.movement import Values, distinct, moved
from orchestrator.checking.probing.probes import Context, SkippedError, look
from orchestrator.checking.probing.probes_limits import judge_batches, judge_late_setting, judge_limits
from orchestrator.checking.probing.statuses import StatusError
from orchestrator.checking.probing.values import by_variable, equal, values_text
from orchestrator.checking.probing.variables import ProbedVariable
from orchestrator.checking.probing.watched import narrow

_FEW_STEPS = 2
_SAME = 1e-6  # what two solutions of one algebraic loop may differ by, relative
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
    judge_batches(context)
    if not _kept_before(context, movement):
        return
    judge_limits(context, movement)
    judge_late_setting(context, movement)
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
        plain = by_variable(stays, driver.read(stays, "after initialisation"))
    with bench.instance(initialised=False) as driver:
        bench.place(driver, inputs=False)
        driver.enter_initialisation(job.start, job.stop)
        bench.place(driver, inputs=True)
        found = by_variable(stays, driver.read(stays, "in initialisation mode"))
        lost = _judge(context, {v: movement[v] for v in stays}, found, "before initialisation")
        driver.exit_initialisation()
        later = by_variable(stays, driver.read(stays, "after initialisation"))
    # A state that an event at the start changes is no start value any more.
    kept = {v: movement[v] for v in stays if v not in lost and equal(v, plain[v], v.start or ())}
    return not (lost or _judge(context, kept, later, "before initialisation, when that is over"))


def _kept_between(context: Context, movement: Mapping[ProbedVariable, Values]) -> None:
    """Inputs and tunable parameters that are set at a communication point, early or late, are there."""
    bench, job = context.bench, context.bench.job
    chosen = [v for v in movement if v.causality == "input" or _is_tunable(v)]
    if not chosen:
        return
    done = 0
    with bench.instance() as driver:
        for steps in dict.fromkeys((max(min(_FEW_STEPS, job.steps - 1), 0), job.steps)):
            bench.run(driver, done, steps, read=False)
            done = steps
            t = job.start + steps * job.step
            now = by_variable(chosen, driver.read(chosen))
            wanted = {v: x for v, value in now.items() if (x := moved(v, value, 1)) is not None}
            if not (_takes(context, driver, wanted, t) and _follows_between(context, driver, wanted, steps)):
                return
            driver.set_discrete(now, t)


def _is_tunable(v: ProbedVariable) -> bool:
    return v.causality == "parameter" and v.variability == "tunable"


def _takes(context: Context, driver: Driver, wanted: Mapping[ProbedVariable, Values], t: float) -> bool:
    """Set values at a communication point; a tunable parameter that is refused then is reported."""
    smooth = [v for v in wanted if v.causality == "input" and v.variability == "continuous"]
    for v in smooth:
        driver.set([v], wanted[v])
    driver.set_discrete({v: x for v, x in wanted.items() if v not in smooth and not _is_tunable(v)}, t)
    for v in filter(_is_tunable, wanted):
        try:
            driver.set_discrete({v: wanted[v]}, t)
        except StatusError as error:
            context.report("value.lags", f"{error}, for `{v.name}` is tunable", v.name)
            context.tunable = False
            return False
    return True


def _follows_between(context: Context, driver: Driver, wanted: Mapping[ProbedVariable, Values], steps: int) -> bool:
    """Whether what was set is there, and early in the run what is calculated from it."""
    job = context.bench.job
    found = by_variable(list(wanted), driver.read(list(wanted)))
    if _judge(context, wanted, found, "at a communication point", "value.lags"):
        return False
    followers = [v for v in job.variables if v.causality == "calculatedParameter" and v.variability == "tunable"]
    followers = [v for v in followers if not v.clocks][:_MOST]
    parameters = {v: x for v, x in wanted.items() if v.causality == "parameter"}
    if followers and parameters and steps <= _FEW_STEPS:
        later = by_variable(followers, driver.read(followers, "after a tunable parameter was set"))
        _follow_tunable(context, parameters, later)
    return True


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
            found = by_variable(chosen, driver.read(chosen))
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
        wanted = by_variable(followers, other.read(followers))
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
            rows.append(by_variable(followers, driver.read(followers, "in initialisation mode")))
    _report_stale(context, rows[1], rows[0], "when an input is set after it was read in initialisation mode")


def _report_stale(
    context: Context,
    wanted: Mapping[ProbedVariable, Sequence[Any]],
    now: Mapping[ProbedVariable, Sequence[Any]],
    when: str,
) -> None:
    for v, expected in wanted.items():
        if not equal(v, now[v], expected, _SAME):
            values_shown = f"is {values_text(now[v])} instead of {values_text(expected)}"
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
            rows.append(by_variable(chosen, driver.read(chosen)))
    still = [v.name for v in chosen if equal(v, rows[1][v], rows[0][v], 0.0)]
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
    lost = [v for v, value in wanted.items() if not equal(v, now[v], value)]
    if lost:
        shown_values = [
            f"`{v.name}` is {values_text(now[v])} instead of {values_text(wanted[v])}" for v in lost[:_MOST_SHOWN]
        ]
        more = f", and {len(lost) - _MOST_SHOWN} more are not what was set" if len(lost) > _MOST_SHOWN else ""
        text = f"values must stay as they were set {when}, but {'; '.join(shown_values)}{more}"
        context.report(rule, text, lost[0].name)
    return lost
