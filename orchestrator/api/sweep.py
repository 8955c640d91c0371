"""Sweeps: many sizes, noise levels and seeds of the paired loops."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from orchestrator.api.cases import AnySweepResult, RunOptions, Varied, draws_of, format_varied
from orchestrator.api.shown import Block, table
from orchestrator.building.fastest import PYTHON, ensure_fastest
from orchestrator.engine import DesignCases, Row, Status, Sweep
from orchestrator.errors import ScenarioError
from orchestrator.paired.calibration import Calibration
from orchestrator.paired.cosimulation import FMUS, MACHINE, loop_system, loop_values
from orchestrator.paired.experiment import Experiment, choose_experiment
from orchestrator.paired.metric import ErrorStatistics, trust_of_sweep
from orchestrator.paired.settings import MapSettings
from orchestrator.paired.sweep import OWN_PARAMETERS, SweepArrays, SweepPlan, gather, sweep_work
from orchestrator.scenarios.sweep import check_parameters
from orchestrator.shared.isolation.archives import content_hash
from orchestrator.shared.numbers import exact_text
from orchestrator.shared.play import Play
from orchestrator.shared.results import CalibrationFound, ErrorsFound, SweepFound
from orchestrator.shared.results.fields import copy_fields, fields_table
from orchestrator.shared.settings import as_tables, choose_settings
from orchestrator.shared.trust import Trust


@dataclass(frozen=True, repr=False)
class SweepResult(AnySweepResult):
    """A sweep of the paired loops.

    Attributes:
        plan: sizes, noise levels, seeds and varied parameters.
        fmus: paths of the three FMUs.
        calibrations: by noise level [rad].
        fmu_kind: which builds of the FMUs ran: "native" or "Python".
    """

    plan: SweepPlan
    cases: DesignCases
    sweep: Sweep
    fmus: Mapping[str, Path]
    calibrations: Mapping[float, Calibration]
    parquet: bool = False
    fmu_kind: str = PYTHON

    @property
    def seed(self) -> int:
        """Seed of random sizes and of all noise."""
        return self.plan.seed

    @cached_property
    def arrays(self) -> SweepArrays:
        """Finished cases as columns [rad], each of shape (done,): actual, noise, estimate, lower, upper."""
        return gather(self.rows())

    @cached_property
    def statistics(self) -> dict[float, ErrorStatistics]:
        """Errors of the estimates by noise level [rad]."""
        return self.arrays.statistics()

    @property
    def trust(self) -> Trust:
        """Whether the intervals hold the sizes that were run."""
        level = min(c.level for c in self.calibrations.values())
        return trust_of_sweep(self.statistics.values(), level, self.failed)

    def blocks(self) -> Sequence[Block]:
        shown = [_cells(row, self.cases.names) for row in self._shown_rows()]
        title = f"Sweep of {len(self.cases)} cases"
        if len(self.cases) > len(shown):
            title += f", the first {len(shown)}; all of them are in sweep.csv"
        extra = [name for name in self.cases.names if name not in OWN_PARAMETERS]
        found = ("S [rad]", "estimate [rad]", "interval [rad]", "error [rad]", "error [%]")
        total = len(self.cases)
        errors = f"Errors by noise level ({total - self.failed} of {total} cases done, {self.failed} failed)"
        shown_errors = fields_table(errors, self._errors(), of=ErrorsFound)
        tables = [table(title, ("actual [rad]", "noise [rad]", *extra, *found), shown), shown_errors]
        plays = self._plays()
        if len(set(plays.values())) == 1:
            sizes = [f"Size: {plays['smallest']}"]
        else:
            sizes = [f"{word.capitalize()} size: {play}" for word, play in plays.items()]
        return [*tables, *sizes, f"FMUs: {self.fmu_kind}", f"Trust: {self.trust}"]

    def _errors(self) -> list[ErrorsFound]:
        return [ErrorsFound(noise=level, **asdict(s)) for level, s in self.statistics.items()]

    def _plays(self) -> dict[str, Play]:
        """Return the smallest and the largest size of the finished cases."""
        sizes, ratio = self.arrays.actual, self.plan.experiment.values.i
        if not len(sizes):
            return {}
        return {"smallest": Play(float(sizes.min()), ratio), "largest": Play(float(sizes.max()), ratio)}

    def results(self, place: Path | None = None) -> SweepFound:
        return SweepFound(
            cases=len(self.cases),
            failed=self.failed,
            columns=self.columns(),
            play={word: play.to_result() for word, play in self._plays().items()},
            statistics=self._errors(),
            trust=self.trust.to_result(),
            experiment=asdict(self.plan.experiment),
            calibrations={f"{level:g}": _provenance(c) for level, c in self.calibrations.items()},
            fmus={name: content_hash(path) for name, path in self.fmus.items()},
            fmu_kind=self.fmu_kind,
        )

    def write(
        self, folder: Path, place: Path, arguments: Mapping[str, Any] | None = None, pictures: bool = True
    ) -> None:
        """Write as any result; of all results a sweep's have the picture always."""
        super().write(folder, place, arguments, pictures=True)


def sweep(
    sizes: str | Sequence[float] = "random:20",
    noise: float | Sequence[float] = (0.0, 1e-4),
    *,
    seeds: int = 1,
    seed: int = 0,
    vary: Varied = (),
    samples: int | None = None,
    experiment: str | Experiment = "default",
    backlash_model: str | None = None,
    settings: MapSettings | Path | str | None = None,
    options: RunOptions | None = None,
    tell: Callable[[str], None] | None = None,
    **more: Any,
) -> SweepResult:
    """Co-simulate many half-gaps, noise levels and seeds, and estimate each half-gap.

    Args:
        sizes: half-gaps [rad], or a text: "range:LOW:HIGH:N", "logrange:LOW:HIGH:N", "random:N".
        noise: standard deviations of the encoder noise [rad].
        seeds: runs of each size and noise level, each with noise of its own.
        seed: of random sizes and of all noise.
        vary: further parameters, as ``{"plant.J_l": [5.3, 5.6]}``, ``{"plant.J_l": "range:5.3:5.9:5"}`` or
            ``["plant.J_l=range:5.3:5.9:5"]``.
        samples: draws of what ``vary`` makes random or sobol (default: 16).
        experiment: "default", "thesis" or an ``Experiment``.
        backlash_model: of the loop with a gap (default: the experiment's).
        settings: of the calibration, or the path of a TOML file with those that differ from the default.
        options: where and how cases run.
        tell: called with a line on what takes time before the first case.
        **more: fields of ``RunOptions``, such as ``workers=2``, instead of ``options``.

    Returns:
        The table of cases and the statistics of the errors.

    Raises:
        ScenarioError: an argument is wrong.
        CalibrationError: a size outside what the experiment claims.
        SimulationError: the place where cases run is gone. A case that fails is a row, not an error.

    Examples:
        >>> result = oc.sweep(sizes=[0.01, 0.02], noise=0.0)
        >>> len(result), result.failed
        (2, 0)
    """
    options = options or RunOptions(**more)
    levels = _levels(noise)
    words = format_varied(vary)
    calibrated = choose_settings(settings, MapSettings)
    text = sizes if isinstance(sizes, str) else ",".join(repr(float(size)) for size in sizes)
    count = draws_of(samples, words, text)
    chosen = choose_experiment(experiment, backlash_model)
    plan = SweepPlan(chosen, text, levels, seeds, seed, words, count)
    cases = plan.cases()
    if tell is not None:
        tell("preparing FMUs and calibration")
    builds = ensure_fastest(FMUS, partial(loop_values, chosen))  # designed while the compiler runs
    fmus = builds.paths
    check_parameters(loop_system(plan.experiment, fmus, (MACHINE,)), cases, OWN_PARAMETERS)
    calibrations = plan.calibrations(tell, calibrated)
    done = options.run(cases, sweep_work(plan, fmus, calibrations))
    given: dict[str, object] = {"experiment": chosen.name, "backlash_model": chosen.backlash_model, "sizes": text}
    given |= {"noise": ",".join(exact_text(level) for level in levels), "seeds": seeds, "vary": list(words)}
    return SweepResult(plan, cases, done, fmus, calibrations, options.parquet, builds.kind, arguments=given)


def _levels(noise: float | Sequence[float]) -> tuple[float, ...]:
    levels = tuple(float(level) for level in (noise if isinstance(noise, Sequence) else (noise,)))
    if len(set(levels)) != len(levels):
        listed = ",".join(exact_text(level) for level in levels)
        raise ScenarioError(f"`noise` must name each level once, but is {listed!r}", "noise")
    return levels


def _provenance(calibration: Calibration) -> CalibrationFound:
    return copy_fields(CalibrationFound, calibration, settings=as_tables(calibration.settings))


def _cells(row: Row, names: tuple[str, ...]) -> list[str]:
    p = row.case.parameters
    extra = [str(p[name]) for name in names if name not in OWN_PARAMETERS]
    start = [f"{p['alpha']:.6g}", f"{p['noise']:g}", *extra]
    if row.outcome.status is not Status.DONE:
        return [*start, row.outcome.status.value, row.outcome.message, "", "", ""]
    total, estimate, lower, upper, error, percent = (float(v or 0.0) for v in row.outcome.values)
    interval = f"{lower:.8g} .. {upper:.8g}"
    return [*start, f"{total:.6g}", f"{estimate:.8g}", interval, f"{error:.2e}", f"{percent:.4f}"]
