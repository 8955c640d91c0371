"""What is set in initialisation mode: it is there, to its limits, and has the effect that it has when set before."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from orchestrator.checking.probing.driver import Driver
from orchestrator.checking.probing.movement import Values
from orchestrator.checking.probing.probes import Context
from orchestrator.checking.probing.returns import readable
from orchestrator.checking.probing.statuses import StatusError
from orchestrator.checking.probing.variables import ProbedVariable, by_variable, equal, values_text
from orchestrator.checking.rules import declare
from orchestrator.errors import ChildError

declare("""
[values]
value.batch | E | 2.1.7 | 2.2.7.2 | values that are read in one call are those that are read one by one | go through all value references, and keep each string in its own memory
""")  # noqa: E501

_MOST = 100  # variables
_MOST_ITEMS = 8
_MOST_NAMED = 5
_SAME = 1e-6  # what two solutions of one algebraic loop may differ by, relative
_FEW_STEPS = 2
_TEXT = " \N{LATIN SMALL LETTER E WITH ACUTE}\N{EURO SIGN}\nline".encode()
"""A second line, and letters beyond ASCII; short, for many FMUs have room for so many letters alone."""


def judge_limits(context: Context, movement: Mapping[ProbedVariable, Values]) -> None:
    """Each limit, item and text that the description allows can be set and read in initialisation mode.

    Nothing is computed with them: the instance is freed then.
    """
    bench, job = context.bench, context.bench.job
    lost: list[str] = []
    path = ""
    with bench.instance(initialised=False) as driver:
        driver.enter_initialisation(job.start, job.stop)
        for v in [v for v in movement if v.size == 1][:_MOST]:
            for value in _extremes(v):
                try:
                    found = _set_and_read(context, driver, v, value)
                except StatusError:
                    break  # limits of one value may follow from another
                if found is None:
                    return
                if not equal(v, found, (value,)):
                    lost.append(f"`{v.name}` is {values_text(found)} instead of {values_text((value,))}")
                    path = path or v.name
                    break
    if lost:
        more = f", and {len(lost) - _MOST_NAMED} more" if len(lost) > _MOST_NAMED else ""
        text = f"what min, max and the type allow must stay as it was set, but {'; '.join(lost[:_MOST_NAMED])}{more}"
        context.report("value.kept", text, path)


def _set_and_read(context: Context, driver: Driver, v: ProbedVariable, value: Any) -> list[Any] | None:
    """A value that was set, and then the start value again; None where the process ended."""
    try:
        driver.set([v], (value,))
        found = driver.read([v], "in initialisation mode")
        driver.set([v], v.start or ())
    except ChildError as error:
        text = f"no value within the limits must end the process, but {error} with another value of `{v.name}`"
        context.report("run.moved-crash", text, v.name)
        context.bench.library.renew()
        return None
    return found


def _extremes(v: ProbedVariable) -> Iterator[Any]:
    """Values at the ends of what the description allows."""
    if v.items:
        yield from v.items[:_MOST_ITEMS]
    elif v.base == "String":
        yield (v.start or (b"",))[0] + _TEXT
    elif v.numeric and v.limits[0] < v.limits[1] and all(map(math.isfinite, v.limits)):
        yield from v.limits


def judge_late_setting(context: Context, movement: Mapping[ProbedVariable, Values]) -> None:
    """What is set after a look at the values of initialisation mode has the effect that it has when set before."""
    bench, job = context.bench, context.bench.job
    chosen = [v for v in movement if v.causality in ("parameter", "input")]
    if not chosen or context.trace is None:
        return
    watch = [v for v in readable(job) if v.base != "Binary"]
    early, rows, outputs = [], [], []
    try:
        for late in (False, True):
            with bench.instance(initialised=False) as driver:
                if not late:
                    bench.place(driver, inputs=False)
                driver.enter_initialisation(job.start, job.stop)
                if late:
                    driver.read(watch, "in initialisation mode")
                    bench.place(driver, inputs=False)
                bench.place(driver, inputs=True)
                early.append(driver.read(watch, "in initialisation mode"))
                driver.exit_initialisation()
                driver.driven = True
                rows.append(driver.read(watch, "after initialisation"))
                outputs.append(bench.run(driver, 0, min(_FEW_STEPS, job.steps)))
    except StatusError:
        return  # what cannot be set then has been set before
    off = [v for v, a, b in _pairs(watch, *rows) if not equal(v, b, a, _SAME)]
    recorded = job.outputs()
    for first, second in zip(*outputs, strict=True):
        off += [v for v, a, b in _pairs(recorded, first, second) if not equal(v, b, a, _SAME) and v not in off]
    when = ""
    if not off:
        # Local ones concern no host then, and tools compute them once until that is over.
        off = [v for v, a, b in _pairs(watch, *early) if v.causality != "local" and not equal(v, b, a, _SAME)]
        when = " while that lasts"
    if off:
        names = ", ".join(f"`{v.name}`" for v in off[:_MOST_NAMED]) + (" and others" if off[_MOST_NAMED:] else "")
        verb = "differs" if len(off) == 1 else "differ"
        rule = "value.kept" if any(v in chosen for v in off) else "value.stale"
        text = "what is set after a look at values in initialisation mode must act as what is set before"
        context.report(rule, f"{text}, but {names} {verb}{when}", off[0].name)
        context.remarked.add(rule)


def _pairs(
    variables: Sequence[ProbedVariable], a: Sequence[Any], b: Sequence[Any]
) -> list[tuple[ProbedVariable, tuple[Any, ...], tuple[Any, ...]]]:
    first, second = by_variable(variables, a), by_variable(variables, b)
    return [(v, first[v], second[v]) for v in variables]


def judge_batches(context: Context) -> None:
    """Values that are read in one call are those that are read one by one, in any order."""
    bench, job = context.bench, context.bench.job
    if context.trace is None:
        return
    variables = [v for v in readable(job) if v.base != "Binary"]
    with bench.instance() as driver:
        bench.run(driver, 0, min(_FEW_STEPS, job.steps), read=False)
        for base in dict.fromkeys(v.base for v in variables):
            group = [v for v in variables if v.base == base][:_MOST]
            single = {v: tuple(driver.get([v])) for v in group}
            for order in (group, group[::-1]):
                found = by_variable(order, driver.get(order))
                off = [v for v in group if not equal(v, found[v], single[v])]
                if len(group) > 1 and off:
                    v = off[0]
                    text = f"`{v.name}` must be the same read alone and with others, but is {values_text(found[v])}"
                    when = f"instead of {values_text(single[v])} in a call for {len(group)} variables"
                    context.report("value.batch", text, v.name, when)
                    return
