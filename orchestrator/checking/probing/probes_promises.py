"""The probe of promises: what a flag or a list of the description promises is called once.

What is promised is a table: of each line the flag, the versions, where it is called, the function, and what it means.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.events import EventDriver
from orchestrator.checking.probing.job import ProbeJob
from orchestrator.checking.probing.probes import Context
from orchestrator.checking.probing.statuses import StatusError
from orchestrator.checking.rules import declare

declare("""
[promises]
promise.refused | E | 2.1.5 | 2.4.2 | functions declared by a flag or a list can be called | implement the function, or clear the flag
log.refused | W | 2.1.5 | 2.3.1 | SetDebugLogging takes the categories that are declared | accept them, and return OK
""")  # noqa: E501

_MOST = 20
Call = tuple[str, list[Any]]


@dataclass(frozen=True)
class PromisedCall:
    """What is promised."""

    word: str  # the flag or the list of the description
    moment: str  # "new", "initialisation", "event" or "run"
    # the calls that must be accepted then, for a job; none where nothing is promised
    calls: Callable[[ProbeJob], list[Call]]


def _categories(job: ProbeJob) -> list[Call]:
    names = [c.encode() for c in job.categories]
    calls: list[Call] = [("SetDebugLogging", [1, [name]]) for name in names[:_MOST]]
    return [*calls, ("SetDebugLogging", [1, names]), ("SetDebugLogging", [0, names])]


def _input_derivatives(job: ProbeJob) -> list[Call]:
    inputs = [v.reference for v in job.inputs() if v.base == "Real"][:_MOST]
    if job.version != "2.0" or "canInterpolateInputs" not in job.flags:
        return []
    return [("SetRealInputDerivatives", [[r], [1], [0.0]]) for r in inputs]


def _output_derivatives(job: ProbeJob) -> list[Call]:
    outputs = [v for v in job.outputs() if v.causality == "output" and v.base in ("Real", "Float64")]
    chosen = [v.reference for v in outputs if v.size == 1 and v.variability == "continuous" and not v.clocks][:_MOST]
    if job.interface != "CoSimulation" or not chosen:
        return []
    return [
        ("GetOutputDerivatives", [chosen, [order] * len(chosen), len(chosen)])
        for order in range(2, min(job.output_order, 5) + 1)  # the first is a probe of its own
    ]


def _evaluate(job: ProbeJob) -> list[Call]:
    return [("EvaluateDiscreteStates", [])] if "providesEvaluateDiscreteStates" in job.flags else []


def _fractions(job: ProbeJob) -> list[Call]:
    chosen = [c for c in job.clocks if c.fraction and c.causality == "input"]
    return [("GetIntervalFraction", [[c.reference], 1, 1, 1]) for c in chosen]


PROMISES = (
    PromisedCall("LogCategories", "new", _categories),
    PromisedCall("canInterpolateInputs", "run", _input_derivatives),
    PromisedCall("maxOutputDerivativeOrder", "run", _output_derivatives),
    PromisedCall("providesEvaluateDiscreteStates", "initialisation", _evaluate),
    PromisedCall("providesEvaluateDiscreteStates", "event", _evaluate),
    PromisedCall("supportsFraction", "initialisation", _fractions),
)


def promises(context: Context) -> None:
    """Call what the flags and lists of the description promise."""
    bench, job = context.bench, context.bench.job
    for promise in PROMISES:
        calls = promise.calls(job)
        if not calls or (promise.moment == "event" and not job.has_events):
            continue
        with bench.instance(initialised=False) as driver:
            leave = _go(context, driver, promise.moment)
            for function, arguments in calls:
                try:
                    found = driver.call(function, *arguments)
                except StatusError as error:
                    rule = "log.refused" if promise.word == "LogCategories" else "promise.refused"
                    context.report(rule, f"{error}, for {promise.word} promises it")
                    break
                _judge_fraction(context, function, arguments, found)
            else:
                if leave:
                    driver.call(leave)


def _go(context: Context, driver: Driver, moment: str) -> str:
    """Bring a new instance to a moment. Return the function that leaves event mode, or nothing."""
    job = context.bench.job
    if moment == "new":
        return ""
    if moment == "initialisation":
        driver.enter_initialisation(job.start, job.stop)
        return ""
    driver.initialise()
    context.bench.run(driver, 0, 1)
    if moment == "event":
        driver.call("EnterEventMode")
        assert isinstance(driver, EventDriver)
        driver.settle(job.start + job.step, "in event mode")
        return driver.leave
    return ""


def _judge_fraction(context: Context, function: str, arguments: Sequence[Any], answer: list[Any]) -> None:
    """An interval as a fraction is that of the description."""
    if function != "GetIntervalFraction":
        return
    job = context.bench.job
    (counter,), (resolution,), _ = answer
    clock = next(c for c in job.clocks if c.reference == arguments[0][0])
    if clock.interval and (not resolution or abs(counter / resolution - clock.interval) > 1e-6 * clock.interval):
        text = f"the interval of `{clock.name}` must be {clock.interval:g}, but is {counter}/{resolution} as a fraction"
        context.report("clock.interval-value", text)
