"""What is run: a system of FMUs as plain data that every tool's adapter can read."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class BenchJob:
    """A scenario without anything of ours in it.

    Attributes:
        fmus: path of the FMU by instance, in execution order.
        starts: ``[instance, variable, type, value]``; the elements of an array in a row.
        connections: ``[instance, output, instance, input]``.
        references: value reference by instance and variable.
        watched: ``[instance, output]`` whose ends show that a tool did the work.
        step: communication step [s].
        fmi: version of FMI of all FMUs, 2 or 3; the types of ``starts`` are those of it.
    """

    fmus: dict[str, str]
    starts: list[list[Any]]
    connections: list[list[str]]
    references: dict[str, dict[str, int]]
    watched: list[list[str]]
    step: float
    steps: int
    fmi: int = 2

    def write(self, path: Path) -> None:
        """Write the job as JSON."""
        path.write_text(json.dumps(asdict(self)), encoding="utf-8")


def read_job(path: Path) -> BenchJob:
    """Read what ``BenchJob.write`` wrote."""
    return BenchJob(**json.loads(path.read_text(encoding="utf-8")))
