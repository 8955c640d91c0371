"""The probe of values: what is set is kept, and what follows from it follows at once."""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from typing import Any

from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.events import EventDriver
from orchestrator.checking.probing.job import ProbeJob
from orchestrator.checking.probing.movement import Values, distinct, moved
from orchestrator.checking.probing.probes import Context, look
from orchestrator.checking.probing.probes_limits import judge_batches, judge_late_setting, judge_limits
from orchestrator.checking.probing.statuses import SkippedError, StatusError
from orchestrator.checking.probing.variables import ProbedVariable, by_variable, equal, values_text
from orchestrator.checking.probing.watched import narrow
from orchestrator.checking.rules import declare

declare("""
[values]
value.kept | E | 2.1.7 | 2.2.7.2 | a value that was set is returned | store the value, every element of it, where it is used and read
value.lags | W | 2.1.7 | 2.2.7.2 | inputs and tunable parameters set at a communication point are returned at once | store the value when it is set, not with the next step
value.stale | E | 2.2.7 | 2.3.3 | values that are read correspond to the values set before | compute values when they are read, or when something is set
value.calculated | E | 2.2.7 | 2.4.7.4 | calculated parameters follow the parameters that they depend on | compute them when initialisation mode is left
""")  # noqa: E501

_FEW_STEPS = 2
_SAME = 1e-6  # what two solutions of one algebraic loop may differ by, relative
_MOST = 500
_MOST_SHOWN = 5
_TICKING = 20  # steps


def values(context: Context) -> None:
    """Set what can be set to other values than those of the file; read it back, and what depends on it."""
    bench, job = context.bench, context.bench.job
    movement = bench.movement.values
    _judge_types(context)
    _judge_ticks(context)
    if not movement:
        raise SkippedError("the FMU has nothing that can be set to other values, or takes none")
    if job.interface == "ScheduledExecution":
        raise SkippedError("the interface has no communication points")
    judge_batches(context)
    with context.away() if context.far is not None else nullcontext():
        if not _judge_before(context, bench.movement.values):
            return
    judge_limits(context, movement)
    judge_late_setting(context, movement)
    try:
        _judge_between(context, movement)
        _judge_at_limits(context)
    except StatusError:
        return  # not every FMU takes values at every point; what must be taken has been set before
    _judge_calculated(context, movement)


def _judge_ticks(context: Context) -> None:
    """Clocked inputs that are set to other values while their clock ticks are there."""
    bench, job = context.bench, context.bench.job
    inputs = [v for v in job.variables if v.clocks and v.causality == "input" and v.base != "Clock"]
    given = {v.reference: x for v in inputs if (x := moved(v, v.start or ())) is not None}
    if not given or job.version == "2.0":
        return
    with bench.instance(initialised=False) as driver:
        assert isinstance(driver, EventDriver)
        driver.enter_initialisation(job.start, job.stop)
        driver.memory["given"], driver.reads_back = given, True
        driver.exit_initialisation()
        bench.run(driver, 0, min(_TICKING, job.steps), read=False)


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


def _judge_before(context: Context, movement: Mapping[ProbedVariable, Values]) -> bool:
    """Whether what is set before and in initialisation mode is there in it, parameters and states also afterwards."""
    bench, job = context.bench, context.bench.job
    # Others that have a start value may be computed anew: it is what they were before.
    states = {v.key for v in job.state_variables or ()}
    stays = [v for v in movement if v.causality in ("input", "parameter") or v.key in states]
    with bench.instance(moved=False) as driver:
        plain = by_variable(stays, driver.read(stays, "after initialisation"))
    with bench.instance(initialised=False) as driver:
        bench.enter_moved(driver)
        found = by_variable(stays, driver.read(stays, "in initialisation mode"))
        lost = _judge(context, {v: movement[v] for v in stays}, found, _before(job))
        driver.exit_initialisation()
        later = by_variable(stays, driver.read(stays, "after initialisation"))
    # A state that an event at the start changes is no start value any more.
    kept = {v: movement[v] for v in stays if v not in lost and equal(v, plain[v], v.start or ())}
    return not (lost or _judge(context, kept, later, f"{_before(job)}, when initialisation is over"))


def _before(job: ProbeJob) -> str:
    """When parameters and inputs were set, in words."""
    entry = "fmi2SetupExperiment" if job.version == "2.0" else "fmi3EnterInitializationMode"
    return f"before {entry}, or in initialisation mode for inputs"


def _judge_between(context: Context, movement: Mapping[ProbedVariable, Values]) -> None:
    """Inputs and tunable parameters that are set at a communication point, early or late, are there."""
    chosen = [v for v in movement if v.causality == "input" or _is_tunable(v)]
    if not chosen:
        return
    seen = _set_between(context, chosen)
    if seen is not None and seen[1]:
        _follow_tunable(context, *seen)


Followers = tuple[Mapping[ProbedVariable, Values], Mapping[ProbedVariable, Sequence[Any]]]
"""Tunable parameters as they were set early in a run, and what is calculated from them then."""


def _set_between(context: Context, chosen: list[ProbedVariable]) -> Followers | None:
    """Set values in a run, early and late; what follows them early, None where what was set is not there."""
    bench, job = context.bench, context.bench.job
    done = 0
    seen: Followers = ({}, {})
    with bench.instance() as driver:
        for steps in dict.fromkeys((max(min(_FEW_STEPS, job.steps - 1), 0), job.steps)):
            bench.run(driver, done, steps, read=False)
            done = steps
            t = job.start + steps * job.step
            now = by_variable(chosen, driver.read(chosen))
            wanted = {v: x for v, value in now.items() if (x := moved(v, value, 1)) is not None}
            if not _takes(context, driver, wanted, t):
                return None
            found = by_variable(list(wanted), driver.read(list(wanted)))
            rule = "value.lags"
            if steps < job.steps and any(not equal(v, found[v], x) for v, x in wanted.items()):
                driver.advance(t, job.step)  # what is there then was late; what is not is lost
                later = by_variable(list(wanted), driver.read(list(wanted)))
                rule = "value.lags" if all(equal(v, later[v], x) for v, x in wanted.items()) else "value.kept"
            if _judge(context, wanted, found, "at a communication point", rule):
                return None
            if steps <= _FEW_STEPS and not seen[1]:
                seen = _followers(context, driver, wanted)
            driver.set_discrete(now, t)
    return seen


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


def _followers(context: Context, driver: Driver, wanted: Mapping[ProbedVariable, Values]) -> Followers:
    """The tunable parameters that were set, and the values of what is calculated from such ones."""
    variables = context.bench.job.variables
    followers = [v for v in variables if v.causality == "calculatedParameter" and v.variability == "tunable"]
    followers = [v for v in followers if not v.clocks][:_MOST]
    parameters = {v: x for v, x in wanted.items() if v.causality == "parameter"}
    if not followers or not parameters:
        return {}, {}
    return parameters, by_variable(followers, driver.read(followers, "after a tunable parameter was set"))


def _judge_at_limits(context: Context) -> None:
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
    for v, expected in wanted.items():
        if not equal(v, now[v], expected, _SAME):
            text = f"`{v.name}` must follow when a tunable parameter is set at a communication point"
            shown = f"is {values_text(now[v])} instead of {values_text(expected)}"
            context.report("value.stale", f"{text}, but {shown}", v.name)


def _judge_calculated(context: Context, movement: Mapping[ProbedVariable, Values]) -> None:
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
