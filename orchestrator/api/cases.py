"""What all sweeps share: where cases run, what is varied, and a table that streams from a journal."""

import weakref
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import ClassVar, Self

from orchestrator.api.plotted import PlottedResult
from orchestrator.engine import (
    CaseLimits,
    DesignCases,
    Progress,
    Row,
    Sweep,
    Tls,
    Work,
    choose_pool,
    draws,
    require_parquet,
    run_cases,
    write_csv,
    write_parquet,
)
from orchestrator.errors import ScenarioError
from orchestrator.shared.results import ColumnFound
from orchestrator.shared.scratch import Scratch

DEFAULT_SAMPLES = 16
MOST_ROWS_SHOWN = 40
MIB = 1024**2
Varied = Mapping[str, "str | Sequence[float | str]"] | Sequence[str]


@dataclass(frozen=True)
class RunOptions:
    """Where and how the cases of a sweep run.

    Attributes:
        workers: worker processes (default: one per core).
        scheduler: address of a Dask cluster to run on instead.
        time_limit: wall time that a case may take [s].
        memory_limit: memory that a case may take [MiB], 0 for any.
        journal: file of finished cases, from which a run that was stopped goes on (default: a temporary one).
        resume: go on with that file.
        progress: called as cases end, at least about four times a second.
        parquet: whether ``save`` writes the table as Parquet too.
        tls: files for a ``scheduler`` at ``tls://``.
        trust: FMUs that are not ours run with all rights of the user.
    """

    workers: int | None = None
    scheduler: str | None = None
    time_limit: float = CaseLimits().time
    memory_limit: int = CaseLimits().memory // MIB
    journal: Path | None = None
    resume: bool = False
    progress: Callable[[Progress], None] = lambda _: None
    parquet: bool = False
    tls: Tls | None = None
    trust: bool = False

    @property
    def limits(self) -> CaseLimits:
        """Bounds on each case, in the engine's units."""
        return CaseLimits(self.time_limit, self.memory_limit * MIB)

    def run(self, cases: DesignCases, work: Work) -> Sweep:
        """Run all cases.

        Args:
            cases: values of every case, computed when asked for.
            work: how to run one.

        Returns:
            The finished cases; a temporary journal goes with it.

        Raises:
            ScenarioError: an option is out of range, or needs an extra that is not installed.
            SimulationError: the place where cases run is gone.
        """
        open_pool, limits = choose_pool(self.workers, self.scheduler, self.tls), self.limits
        if self.parquet:
            require_parquet()
        journal, scratch = self.journal, None
        if journal is None:
            scratch = Scratch("sweep")
            journal = scratch.path / "sweep.journal"
        try:
            sweep = run_cases(
                cases, work, journal, open_pool=open_pool, limits=limits, resume=self.resume, on_progress=self.progress
            )
        except BaseException:
            if scratch is not None:
                scratch.close()
            raise
        if scratch is not None:
            weakref.finalize(sweep, scratch.close)
        return sweep


class AnySweepResult(PlottedResult):
    """What the sweeps share: a table of finished cases that streams from a journal. Close it, or use ``with``."""

    command: ClassVar[str] = "sweep"
    cases: DesignCases  # varied values by case, computed when asked for
    sweep: Sweep  # outcomes of the finished cases, in case order
    parquet: bool  # whether ``save`` writes Parquet too

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the journal; rows can no longer be read."""
        self.sweep.__exit__(None, None, None)

    def __len__(self) -> int:
        return len(self.cases)

    def write_data(self, folder: Path) -> None:
        """Write ``sweep.csv``, and where asked for ``sweep.parquet``."""
        self.write_csv(folder / "sweep.csv")
        if self.parquet:
            self.write_parquet(folder / "sweep.parquet")

    @property
    def failed(self) -> int:
        """Number of cases that failed; their rows say why."""
        return self.sweep.failed

    def rows(self) -> Iterator[Row]:
        """Read the finished cases from the journal."""
        return self.sweep.rows()

    def _shown_rows(self) -> Iterator[Row]:
        """Read as many of them as are shown."""
        return islice(self.rows(), MOST_ROWS_SHOWN)

    def write_csv(self, path: Path | str) -> None:
        """Write the table as CSV, with as many digits as are needed to read the numbers back exactly."""
        write_csv(Path(path), self.cases.names, self.sweep.columns, self.rows())

    def write_parquet(self, path: Path | str) -> None:
        """Write the table as Parquet."""
        write_parquet(Path(path), self.cases.names, self.sweep.columns, self.rows())

    def columns(self) -> list[ColumnFound]:
        """Name the results of a case. Return name and unit of each column of results."""
        return [ColumnFound(c.name, c.unit) for c in self.sweep.columns]


def format_varied(vary: Varied) -> tuple[str, ...]:
    """Return what is varied in the engine's text form."""
    if not isinstance(vary, Mapping):
        return tuple(vary)
    return tuple(f"{n}={v if isinstance(v, str) else ','.join(map(str, v))}" for n, v in vary.items())


def draws_of(samples: int | None, vary: Sequence[str], sizes: str = "") -> int:
    """Return how often random and Sobol parameters are drawn, at least once."""
    if samples is None:
        return DEFAULT_SAMPLES
    if sizes.startswith("random"):
        text = "`samples` must be left out with random `sizes`, whose number is that of all draws"
        raise ScenarioError(text, "samples", "sizes")
    if not draws(vary):
        raise ScenarioError("`samples` must be left out where `vary` makes nothing random or sobol", "samples", "vary")
    if samples < 1:
        raise ScenarioError(f"`samples` must be at least 1, but is {samples}", "samples")
    return samples
