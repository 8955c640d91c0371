"""Probes of states and their derivatives: their order, their variables and their nominal values."""

import math
from collections.abc import Sequence
from dataclasses import replace

from orchestrator.checking.probing.model_exchange import ModelExchange
from orchestrator.checking.probing.points import RestPoint, points
from orchestrator.checking.probing.probes import Context
from orchestrator.checking.probing.probes_exchange import judge_completed_step, judge_following
from orchestrator.checking.probing.statuses import SkippedError
from orchestrator.checking.probing.variables import ProbedVariable
from orchestrator.checking.rules import declare

declare("""
[states]
states.order | E | 3.2.1 | 3.2.1 | states are in the order of ModelStructure, by the attribute derivative | correct the order, or the attribute derivative
states.rates | E | 3.2.2 | 3.2.1 | derivatives of states equal their variables, in the order of ModelStructure | compute both from one place
states.nominal-differs | W | 3.2.2 | 3.2.1 | nominal values of states are those of the description | generate both from one source
""")  # noqa: E501

_EQUAL = 1e-9
_NEAR = 1e-3
_MOST = 200


def states(context: Context) -> None:
    """States and derivatives are those of the variables that ModelStructure names, in its order."""
    job = context.bench.job
    if not job.state_variables:
        raise SkippedError("the description names no continuous states")
    if job.interface != "ModelExchange":
        return  # the other interfaces hand out no vector of states
    bench, variables = context.bench, job.state_variables
    with bench.instance() as driver:
        assert isinstance(driver, ModelExchange)
        if driver.memory["states"] != sum(v.size for v in variables):
            raise SkippedError("the number of states is not that of the description")
        _nominals(context, driver, variables)
        last = None
        for last in points(bench, driver):
            if not _vector(context, last, driver, variables):
                bench.job = replace(job, state_variables=None)  # their variables are not known then
                return
            if not judge_following(context, last, _others(driver, variables)):
                return
        if last is not None:
            judge_completed_step(context, last, _others(driver, variables))


def _others(driver: ModelExchange, variables: Sequence[ProbedVariable]) -> list[float]:
    """States beside the present ones, within their bounds."""
    x = driver.continuous_states()
    pairs = zip(x, driver.memory["nominals"], strict=True)
    wanted = [a + 1e-3 * n * (1.0 + 0.37 * i) for i, (a, n) in enumerate(pairs)]
    limits = [v.limits for v in variables for _ in range(v.size)]
    return [w if low <= w <= high else a for a, w, (low, high) in zip(x, wanted, limits, strict=True)]


def _vector(context: Context, point: RestPoint, driver: ModelExchange, variables: tuple[ProbedVariable, ...]) -> bool:
    """States that were set are there, in the vector and by their variables; and so are the derivatives."""
    x = driver.continuous_states()
    wanted = _others(driver, variables)
    owners = [v for v in variables for _ in range(v.size)]
    driver.set_continuous_states(wanted)
    found = driver.continuous_states()
    rates = driver.rates()
    named = driver.read(variables[:_MOST])
    named_rates = driver.read(context.bench.job.rate_variables[:_MOST])
    driver.set_continuous_states(x)
    prefix = context.bench.library.names.prefix
    where = f"at t = {point.time:g}"
    for a, b, v in zip(wanted, found, owners, strict=True):
        if abs(a - b) > _EQUAL * max(abs(a), abs(b), 1e-12):
            text = f"{prefix}GetContinuousStates must return what was set, but returns {b:.6g} for `{v.name}`"
            context.report("states.order", text, v.name, f"instead of {a:.6g} {where}")
            return False
    size = max((abs(a) for a in wanted), default=0.0)
    for a, b, v in zip(wanted, named, owners, strict=False):
        if abs(a - b) > _EQUAL * max(abs(a), abs(b), 1e-3 * size):
            text = f"states must stand in the order of the description, but `{v.name}` does not have its place's value"
            context.report("states.order", text, v.name, f"({b:.6g} instead of {a:.6g} {where})")
            return False
    rate_owners = [v for v in context.bench.job.rate_variables for _ in range(v.size)]
    size = max((abs(a) for a in rates if math.isfinite(a)), default=0.0)
    for a, b, v in zip(rates, named_rates, rate_owners, strict=False):
        if math.isfinite(a) and not abs(a - b) <= 1e-6 * max(abs(a), abs(b), 1e-3 * size):
            text = f"derivatives must be their variables, in the order of the description, but `{v.name}` is not"
            context.report("states.rates", text, v.name, f"({b:.6g} instead of {a:.6g} {where})")
            return False
    return True


def _nominals(context: Context, driver: ModelExchange, variables: tuple[ProbedVariable, ...]) -> None:
    """Nominal values that the description has are those that the FMU says."""
    owners = [v for v in variables for _ in range(v.size)]
    for v, value in zip(owners, driver.nominal_values(), strict=True):
        if v.nominal is not None and v.nominal > 0.0 and abs(value - v.nominal) > _NEAR * v.nominal:
            text = f"the nominal value of `{v.name}` must be {v.nominal:g} as the description says, but is {value:g}"
            context.report("states.nominal-differs", text, v.name)
