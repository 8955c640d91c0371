"""Calls that an FMU must refuse. They come last, for an FMU may break on them."""

from collections.abc import Iterator
from typing import Any

from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.job import ProbeJob
from orchestrator.checking.probing.movement import moved
from orchestrator.checking.probing.probes import Context
from orchestrator.checking.probing.statuses import OK, WARNING, StatusError
from orchestrator.checking.rules import declare

declare("""
[misuse]
misuse.guid | W | 2.1.5 | 2.3.1 | a wrong guid or token is refused | compare it at instantiation
misuse.step-before-init | W | 4.2.4 | 4.2 | a step before initialisation is refused | return an error
misuse.negative-step | W | 4.2.4 | 4.2.1 | a negative step is refused | return an error
misuse.step-after-end | W | 4.2.4 | 4.2 | a step after the end is refused | return an error
misuse.value-reference | W | 2.1.7 | 2.2.7.2 | unknown value references are refused | return an error
misuse.set-fixed | I | 2.2.7 | 2.4.7.4 | fixed parameters and constants are not set between steps | return an error
misuse.value-count | W | - | 2.2.7.2 | a wrong number of values is refused | compare nValues with the sizes of the variables
misuse.set-output | W | - | 2.2.7.2 | outputs cannot be set at communication points | return an error
misuse.event-mode | W | - | 4.2 | event mode is refused if it is not used | return an error
""")  # noqa: E501

_NOT_REFUSED = (OK, WARNING)
_SOON = 3.0  # s


def misuse(context: Context) -> None:
    """Wrong token, a step too early, a negative step, an unknown value reference, values too many, and more."""
    bench, job = context.bench, context.bench.job
    prefix = bench.library.names.prefix
    for token, what in _wrong_tokens(job.token):
        bench.prepare()
        number = bench.driver.make(bench.library, "instance", token, job)
        if number is not None:
            bench.library.free(number)
            context.report("misuse.guid", f"{prefix}Instantiate must refuse {what}, but accepts it")
            break
    _set_fixed(context)
    if job.interface == "CoSimulation":
        _steps(context)
    for rule, function, arguments, wanted in _wrong_calls(job):
        with bench.instance() as driver:
            if driver.raw(function, *arguments)[0] in _NOT_REFUSED:
                context.report(rule, f"{prefix}{function} must {wanted}")
    if job.version == "3.0" and job.interface == "CoSimulation" and not job.clocks:  # with clocks it must be used
        with bench.instance(events=False) as driver:
            if driver.raw("EnterEventMode")[0] in _NOT_REFUSED:
                message = "fmi3EnterEventMode must be refused where event mode is not used, but is not"
                context.report("misuse.event-mode", message)


WrongCall = tuple[str, str, tuple[Any, ...], str]
"""Rule, function with its arguments, and what must be done with the call."""


def _wrong_calls(job: ProbeJob) -> Iterator[WrongCall]:
    """Calls at the first communication point that must be refused."""
    real = next((v.base for v in job.variables if v.real), "Real" if job.version == "2.0" else "Float64")
    unknown = max((v.reference for v in job.variables), default=0) + 12345
    text = f"refuse the unknown value reference {unknown}, but does not"
    yield "misuse.value-reference", f"Get{real}", ([unknown], 1), text
    if job.version == "2.0":
        return
    numbers = [v for v in job.variables if v.real and not v.clocks]
    for v in [v for v in numbers if v.size == 1][:1]:
        text = f"refuse two values for the scalar `{v.name}`, but does not"
        yield "misuse.value-count", f"Get{v.base}", ([v.reference], 2), text
    for v in [v for v in numbers if v.causality == "output"][:1]:
        text = f"refuse to set the output `{v.name}`, but does not"
        yield "misuse.set-output", f"Set{v.base}", ([v.reference], [1.0] * v.size), text


def _wrong_tokens(token: str) -> list[tuple[str, str]]:
    """Tokens that are not that of the description, and what they are."""
    changed = "".join(chr(ord(c) ^ 1) if c.isalnum() and i > len(token) // 2 else c for i, c in enumerate(token))
    found = [
        ("{a guid of another model}", "a wrong token"),
        (token + "x", "its token with a letter more"),
        (token[:-1], "its token without the last letter"),
        (changed, "a token whose last letters are others"),
        (token.swapcase(), "its token in other capitals"),
        ("", "an empty token"),
    ]
    return [(text, what) for text, what in found if text != token]


def _set_fixed(context: Context) -> None:
    """Fixed parameters and constants must not be set between steps."""
    bench, job = context.bench, context.bench.job
    if job.interface == "ScheduledExecution":
        return
    fixed = [v for v in job.variables if v.causality == "parameter" and v.variability == "fixed" and v.start]
    constant = [v for v in job.variables if v.variability == "constant" and v.start]
    chosen = list({v.base: v for v in reversed(fixed)}.values()) + constant[:1]
    for v in chosen:
        value = moved(v, v.start or ())
        if value is None:
            continue
        with bench.instance() as driver:
            bench.run(driver, 0, 1)
            try:
                driver.set([v], value)
            except StatusError:
                continue
            what = "constant" if v.variability == "constant" else "fixed parameter"
            name = f"{bench.library.names.prefix}Set{v.base}"
            message = f"{name} must refuse to set the {what} `{v.name}` between steps, but does not"
            context.report("misuse.set-fixed", message, v.name)
            return


def _steps(context: Context) -> None:
    bench, job = context.bench, context.bench.job
    prefix = bench.library.names.prefix
    name = f"{prefix}DoStep"
    with bench.instance(initialised=False) as driver:
        knows_when = _try_step(driver, job.step) not in _NOT_REFUSED
    if not knows_when:
        context.report("misuse.step-before-init", f"{name} must be refused before initialisation, but is not")
    with bench.instance() as driver:
        if _try_step(driver, -job.step) in _NOT_REFUSED:
            context.report("misuse.negative-step", f"{name} must refuse a negative step, but does not")
    if not knows_when:
        return  # a slave that does steps at any time does so after the end too
    with bench.instance() as driver:
        bench.run(driver, 0, 1)
        driver.terminate()
        if _try_step(driver, job.step, job.start + job.step) in _NOT_REFUSED:
            context.report("misuse.step-after-end", f"{name} must be refused after {prefix}Terminate, but is not")


def _try_step(driver: Driver, size: float, t: float | None = None) -> int:
    """The status of a step that is to be refused, from the start or from ``t`` [s], which takes no time."""
    more = (0,) if driver.job.version == "2.0" else (True, 0.0)
    with driver.library.limit_calls(_SOON):
        return driver.raw("DoStep", driver.job.start if t is None else t, size, *more)[0]
