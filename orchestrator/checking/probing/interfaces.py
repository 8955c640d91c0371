"""The two interfaces of one FMU, held against each other."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from orchestrator.checking.probing.job import ProbeJob
from orchestrator.checking.probing.variables import ProbedVariable

_TOLERANCE = 0.1  # of the range of a signal: an importer's solver and that of the FMU differ by less
_FEWEST = 10
_MOST = 2.0 / 3.0  # of the points: after an event the two may differ for a while


@dataclass(frozen=True)
class InterfaceRun:
    """The run of one interface with its inputs at their start values.

    Attributes:
        variables: those that were watched, in the order of a row.
        rows: [step][value].
    """

    job: ProbeJob
    variables: list[ProbedVariable]
    rows: list[list[Any]]


def compare_interfaces(a: InterfaceRun, b: InterfaceRun, report: Callable[..., None]) -> str:
    """Report continuous outputs that are far from each other at most points.

    Returns:
        Why they were not compared; empty when they were.
    """
    pairs = list(zip(a.rows, b.rows, strict=False))
    if a.variables != b.variables or a.job.step != b.job.step or len(pairs) < _FEWEST:
        return "the runs of the two interfaces are not the same"
    position = 0
    for v in a.variables:
        if v.real and v.causality == "output" and v.size == 1 and v.variability == "continuous" and not v.clocks:
            p, q = [row[position] for row, _ in pairs], [row[position] for _, row in pairs]
            size = max(max(p) - min(p), max(q) - min(q), 0.01 * max(map(abs, p)), 1e-6 * (v.nominal or 1.0))
            far = sum(abs(x - y) > _TOLERANCE * size for x, y in zip(p, q, strict=True))
            if far > _MOST * len(p):
                kinds = f"{a.job.interface} and {b.job.interface}"
                text = f"is off by more than {_TOLERANCE:.0%} of its range at {far} of {len(p)} points"
                report("interfaces.differ", f"`{v.name}` must be the same in {kinds}, but {text}", v.name)
        position += v.size
    return ""
