"""What model exchange computes between events: from time, states and inputs alone, as they were set last."""

from collections.abc import Sequence

from orchestrator.checking.probing.model_exchange import ModelExchange
from orchestrator.checking.probing.movement import moved
from orchestrator.checking.probing.points import RestPoint
from orchestrator.checking.probing.probes import Context
from orchestrator.checking.probing.statuses import StatusError
from orchestrator.checking.probing.variables import ProbedVariable, finite
from orchestrator.checking.rules import declare

declare("""
[states]
states.history | E | 3.2.1 | 3.2.1 | between events, derivatives follow time, states and inputs alone | compute them from what was set last; change what is remembered in event mode
""")  # noqa: E501

_STALE = 1e-6  # of the size of a value: less is what an algebraic loop leaves
_DRIFT = 1e-4  # of the largest derivative: less is what the memory of a nonlinear solver leaves
_LATER = 0.4  # of a communication step
_MOST = 100


def judge_following(context: Context, point: RestPoint, others: Sequence[float]) -> bool:
    """Whether outputs and derivatives follow states, set to ``others``, and inputs that are set, and nothing else."""
    driver = point.driver
    assert isinstance(driver, ModelExchange)
    x, rates = driver.continuous_states(), driver.rates()
    where = f"at t = {point.time:g}"
    watch = _smooth(context)
    driver.set_continuous_states(others)
    soon = driver.read(watch)
    driver.rates()
    late = driver.read(watch)
    driver.set_continuous_states(x)
    for v, a, b in zip(watch, soon, late, strict=True):
        if finite(a) and finite(b) and abs(a - b) > _STALE * max(abs(a), abs(b)):
            text = f"`{v.name}` must follow the states at once, but does so only after a call of the derivatives"
            context.report("value.stale", text, v.name, f"({a:.6g}, then {b:.6g} {where})")
            return False
    return _follows_inputs(context, point, x, where) and _is_back(context, driver, rates, where)


def _smooth(context: Context) -> list[ProbedVariable]:
    """Continuous outputs and derivatives, which are read one by one."""
    job = context.bench.job
    found = [*(v for v in job.outputs() if v.causality == "output"), *job.rate_variables]
    return [v for v in found if v.real and v.size == 1 and v.variability == "continuous" and not v.clocks][:_MOST]


def _follows_inputs(context: Context, point: RestPoint, x: Sequence[float], where: str) -> bool:
    """Derivatives follow an input that is set, without that states are set after it."""
    driver = point.driver
    assert isinstance(driver, ModelExchange)
    if not context.bench.excited:
        return True
    for v in [v for v in context.bench.job.inputs() if v.size == 1 and v in context.bench.movement.values][:_MOST]:
        base = driver.get([v])
        other = moved(v, base, point.number)
        if other is None:
            continue
        driver.set([v], other)
        soon = driver.rates()
        driver.set_continuous_states(x)
        late = driver.rates()
        driver.set([v], base)
        driver.set_continuous_states(x)
        if (i := _first_off(soon, late, _STALE)) is not None:
            text = f"derivatives must follow `{v.name}` at once, but number {i + 1} does so only after states are set"
            context.report("value.stale", text, v.name, f"({soon[i]:.6g}, then {late[i]:.6g} {where})")
            return False
    return True


def _is_back(context: Context, driver: ModelExchange, rates: Sequence[float], where: str) -> bool:
    """Derivatives are what they were once states and inputs are."""
    if (i := _first_off(rates, again := driver.rates(), _DRIFT)) is None:
        return True
    _report_history(context, i, rates[i], again[i], f"once states and inputs have been others for a while {where}")
    return False


def judge_completed_step(context: Context, point: RestPoint, others: Sequence[float]) -> None:
    """A completed step, states at ``others`` and no event, leaves the derivatives as they are; it ends the run."""
    driver = point.driver
    assert isinstance(driver, ModelExchange)
    t = point.time + _LATER * context.bench.job.step
    if driver.next_instant(t) < t:
        return
    try:
        driver.call("SetTime", t)
        driver.set_continuous_states(others)
        before, signs = driver.rates(), driver.signs()
        if any(driver.complete_step()) or signs != driver.memory["signs"]:
            return
        if driver.continuous_states() != list(others):
            return  # an FMU that brings states back to where they may be says so elsewhere
        after = driver.rates()
    except StatusError:
        return  # the states of this point need not be possible at a later time
    if (i := _first_off(before, after, _DRIFT)) is not None:
        _report_history(context, i, before[i], after[i], f"after a completed step, at t = {t:g}")


def _report_history(context: Context, i: int, before: float, after: float, when: str) -> None:
    owners = [v.name for v in context.bench.job.rate_variables for _ in range(v.size)]
    name = owners[i] if i < len(owners) else ""
    what = f"`{name}`" if name else f"derivative {i + 1}"
    text = f"derivatives must follow time, states and inputs alone between events, but {what} is another one {when}"
    context.report("states.history", text, name, f"({after:.6g} instead of {before:.6g})")


def _first_off(a: Sequence[float], b: Sequence[float], tolerance: float) -> int | None:
    """The first number that differs by more than a share of the largest; None where there is none."""
    size = max((abs(x) for x in (*a, *b) if finite(x)), default=0.0)
    for i, (x, y) in enumerate(zip(a, b, strict=True)):
        if finite(x) and finite(y) and abs(x - y) > tolerance * size:
            return i
    return None
