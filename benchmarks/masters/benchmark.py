"""Speed and accuracy as ratios measured in one run."""

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.masters.alone import CASE_STEPS, RECORD_STEPS, RecordCost, SweepCost, growth
from benchmarks.masters.job import BenchJob
from benchmarks.masters.measure import ToolRow, compare
from benchmarks.masters.of_scenario import job_of
from benchmarks.masters.scaling import Cost, scaling
from benchmarks.masters.tools import TOOLS
from orchestrator.api.shown import Block, table
from orchestrator.building.build import ensure_built
from orchestrator.building.native_build import ensure_native
from orchestrator.errors import ScenarioError
from orchestrator.paired.cosimulation import FMUS
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.scenario import scenario_of_pair
from orchestrator.shared.cache import cache_directory

WATCHED = ("plant.theta_l", "twin_plant.theta_l")
NUMBERS = ("wall [ms]", "cpu [ms]", "us per step", "wall ratio", "cpu ratio", "deviation [rad]")
MOST_ROUNDS = 1000


@dataclass(frozen=True)
class BenchmarkResult:
    """Tools on the same FMUs and the same scenario.

    Attributes:
        rows: one for each tool; the first that ran is the base of the ratios.
        job: FMUs, connections, steps and recorded signals that every tool ran.
        rounds: turns that every tool got.
        native: the FMUs were native builds.
        costs: cost of this master against FMUs and steps; empty unless asked for.
        sweeps: cost of sweeps against cases, likewise.
        records: memory against recorded signals, likewise.
    """

    rows: tuple[ToolRow, ...]
    job: BenchJob
    rounds: int
    native: bool
    costs: tuple[Cost, ...] = ()
    sweeps: tuple[SweepCost, ...] = ()
    records: tuple[RecordCost, ...] = ()

    @property
    def base(self) -> ToolRow | None:
        """The tool to which the ratios refer, or None when none ran."""
        return next((row for row in self.rows if row.wall is not None), None)

    def tables(self) -> list[Block]:
        """Return the tables."""
        job = self.job
        kind = "native FMUs" if self.native else "FMUs"
        kind += " of FMI 3.0" if job.fmi == 3 else ""
        title = f"{len(job.fmus)} {kind}, {job.steps} steps of {job.step:g} s, medians of {3 * self.rounds} runs"
        head = ("tool", "version", "scheme", *NUMBERS, "note")
        blocks: list[Block] = [table(title, head, [_cells(row, self.base, job.steps) for row in self.rows])]
        if not self.costs:
            return blocks
        cells = [[str(c.fmus), f"{c.steps:,}", f"{c.microseconds:.2f}"] for c in self.costs]
        blocks.append(table("cost of this master", ("FMUs", "steps", "us per FMU and step"), cells))
        title = f"sweeps of six FMUs, {CASE_STEPS} steps a case, one worker"
        cells = [[f"{s.cases:,}", f"{s.total:.1f}", f"{1e3 * s.per_case:.2f}", f"{s.peak:.0f}"] for s in self.sweeps]
        blocks.append(table(title, ("cases", "in all [s]", "one more case [ms]", "peak memory [MiB]"), cells))
        cells = [[str(r.signals), f"{r.growth:.1f}", f"{r.expected:.1f}"] for r in self.records]
        title = f"memory of {RECORD_STEPS:,} steps"
        blocks.append(table(title, ("recorded signals", "added [MiB]", "8 bytes each [MiB]"), cells))
        return blocks


def benchmark(
    tools: Sequence[str] | None = None,
    *,
    rounds: int = 3,
    pythons: Mapping[str, str] | None = None,
    scaling_too: bool = False,
    native: bool = False,
    fmi: int = 2,
    progress: Callable[[str], None] = lambda text: None,
) -> BenchmarkResult:
    """Run the paired loops under this master and under others, turn by turn.

    Args:
        tools: which (default: all; those that are not installed say so).
        rounds: turns that every tool gets.
        pythons: interpreter by tool, for tools that cannot share an environment.
        scaling_too: measure also cost against FMUs, steps and cases, and memory.
        native: the FMUs are native builds for this platform instead of Python FMUs.
        fmi: version of FMI of the FMUs, 2 or 3 (native); tools that do not take those of FMI 3.0 say so.
        progress: called with a line on what is measured.

    Returns:
        Medians of wall and CPU time [s], ratios, and deviations [rad] from the reference.
    """
    chosen = list(TOOLS) if tools is None else list(tools)
    unknown = [name for name in chosen if name not in TOOLS]
    if unknown:
        raise ScenarioError(f"`tools` must be among {', '.join(TOOLS)}, but has {unknown[0]!r}", "tools")
    if not 1 <= rounds <= MOST_ROUNDS:
        raise ScenarioError(f"`rounds` must lie in [1, {MOST_ROUNDS}], but is {rounds}", "rounds")
    for tool, path in (pythons or {}).items():
        if tool not in TOOLS or not path:
            text = f"`python` must be TOOL=PATH with a tool among {', '.join(TOOLS)}, but is {f'{tool}={path}'!r}"
            raise ScenarioError(text, "python")
        if shutil.which(path) is None:
            text = f"`python` must name an interpreter for {tool}, but there is no program {path!r}"
            raise ScenarioError(text, "python")
    native = native or fmi == 3
    fmus = _fmus(native, fmi)
    job = job_of(scenario_of_pair(Experiment(), fmus, 0.02, 0.5), WATCHED)
    rows = tuple(compare(job, chosen, rounds, dict(pythons or {}), progress))
    if not scaling_too:
        return BenchmarkResult(rows, job, rounds, native)
    costs = tuple(scaling(fmus["Drivetrain"], progress=progress))
    sweeps, records = growth(progress)
    return BenchmarkResult(rows, job, rounds, native, costs, tuple(sweeps), tuple(records))


def _fmus(native: bool, fmi: int) -> dict[str, Path]:
    if native:
        return ensure_native(FMUS, cache_directory(f"native{fmi}" if fmi != 2 else "native"), here=True, fmi=fmi)
    return ensure_built(FMUS)


def _cells(row: ToolRow, base: ToolRow | None, steps: int) -> list[str]:
    names = [row.title, row.version or "", row.scheme]
    if row.wall is None or base is None or base.wall is None:
        return [*names, *[""] * len(NUMBERS), row.note]
    cpu, ratio = "", ""
    if row.cpu is not None and base.cpu is not None:
        cpu, ratio = f"{1e3 * row.cpu:.1f}", f"{base.cpu / row.cpu:.2g}"
    step = 1e6 * (row.wall if row.cpu is None else row.cpu) / steps
    deviation = "" if row.deviation is None else f"{row.deviation:.1g}"
    return [
        *names,
        f"{1e3 * row.wall:.1f}",
        cpu,
        f"{step:.3g}",
        f"{base.wall / row.wall:.2g}",
        ratio,
        deviation,
        row.note,
    ]
