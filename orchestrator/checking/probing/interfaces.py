"""The two interfaces of one FMU, held against each other."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from orchestrator.checking.probing.job import ProbeJob
from orchestrator.checking.probing.movement import Movement
from orchestrator.checking.probing.variables import ProbedVariable
from orchestrator.checking.rules import declare

declare("""
[interfaces]
interfaces.differ | W | * | * | co-simulation and model exchange of one FMU give the same outputs | generate both from one model, with the same parameters
""")  # noqa: E501

_TOLERANCE = 0.1  # of the range of a signal: an importer's solver and that of the FMU differ by less
_FEWEST = 10
_MOST = 1.0 / 3.0  # of the points: after an event the two may differ for a while


@dataclass(frozen=True)
class InterfaceRun:
    """The runs of one interface."""

    job: ProbeJob  # as it was after the probes
    quiet: list[list[Any]]  # what the outputs are in a run with inputs at their start values, [step][value]
    driven: list[list[Any]]  # likewise in the driven run; empty where it cannot be repeated
    movement: Movement  # what that run changes


def compare_interfaces(a: InterfaceRun, b: InterfaceRun, report: Callable[..., None]) -> str:
    """Report outputs that are far from each other at most points of a run, or return why they were not compared."""
    if a.job.outputs() != b.job.outputs() or a.job.step != b.job.step or min(len(a.quiet), len(b.quiet)) < _FEWEST:
        return "the runs of the two interfaces are not the same"
    equal = a.movement == b.movement and a.job.steps == b.job.steps and a.job.inputs() == b.job.inputs()
    for p, q in ((a.quiet, b.quiet), (a.driven, b.driven) if equal else ([], [])):
        if _report_far(a, b, list(zip(p, q, strict=False)), report):
            break
    return ""


def _report_far(
    a: InterfaceRun, b: InterfaceRun, pairs: list[tuple[list[Any], list[Any]]], report: Callable[..., None]
) -> bool:
    """Hold two runs against each other; whether an output is far off."""
    if len(pairs) < _FEWEST:
        return False
    position = 0
    wrong = False
    for v in a.job.outputs():
        if v.causality == "output" and v.size == 1 and not v.clocks:
            p, q = [row[position] for row, _ in pairs], [row[position] for _, row in pairs]
            far = _count_far(v, p, q)
            if far > _MOST * len(p):
                kinds = f"{a.job.interface} and {b.job.interface}"
                by = f"off by more than {_TOLERANCE:.0%} of its range" if v.real else "another one"
                text = f"is {by} at {far} of {len(p)} points"
                report("interfaces.differ", f"`{v.name}` must be the same in {kinds}, but {text}", v.name)
                wrong = True
        position += v.size
    return wrong


def _count_far(v: ProbedVariable, p: list[Any], q: list[Any]) -> int:
    """At how many points a signal differs by more than solvers do, or at all where it is no floating point number."""
    if not v.real:
        return sum(x != y for x, y in zip(p, q, strict=True))
    size = max(max(p) - min(p), max(q) - min(q), 0.01 * max(map(abs, p)), 1e-6 * (v.nominal or 1.0))
    return sum(abs(x - y) > _TOLERANCE * size for x, y in zip(p, q, strict=True))
