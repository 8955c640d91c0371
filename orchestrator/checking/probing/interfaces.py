"""The two interfaces of one FMU, held against each other."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from orchestrator.checking.probing.job import ProbeJob

_TOLERANCE = 0.1  # of the range of a signal: an importer's solver and that of the FMU differ by less
_FEWEST = 10


@dataclass(frozen=True)
class InterfaceRun:
    """The run of one interface with moving inputs, [step][output]; None where there is none to compare with."""

    job: ProbeJob
    rows: list[list[Any]] | None


def compare_interfaces(a: InterfaceRun, b: InterfaceRun, report: Callable[..., None]) -> str:
    """Report continuous outputs that are far from each other at most points.

    Returns:
        Why they were not compared; empty when they were.
    """
    same = a.job.steps == b.job.steps and a.job.inputs() == b.job.inputs() and a.job.outputs() == b.job.outputs()
    if a.rows is None or b.rows is None or not same or len(a.rows) < _FEWEST or len(a.rows) != len(b.rows):
        return "the runs of the two interfaces are not the same"
    position = 0
    for v in a.job.outputs():
        if v.real and v.size == 1 and v.variability == "continuous" and not v.clocks:
            p, q = [row[position] for row in a.rows], [row[position] for row in b.rows]
            size = max(max(p) - min(p), max(q) - min(q), 0.01 * max(map(abs, p)), 1e-6 * (v.nominal or 1.0))
            far = sum(abs(x - y) > _TOLERANCE * size for x, y in zip(p, q, strict=True))
            if far > len(p) / 2:
                kinds = f"{a.job.interface} and {b.job.interface}"
                text = f"is off by more than {_TOLERANCE:.0%} of its range at {far} of {len(p)} points"
                report("interfaces.differ", f"`{v.name}` must be the same in {kinds}, but {text}", v.name)
        position += v.size
    return ""
