"""The sweep: sizes x noise levels x repetitions through the engine, each case one co-simulated loop and one estimate.

The twin without a gap has no noise and is the same for every case, so each worker process runs it once.
"""

from array import array
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.engine import Case, DesignCases, ResultColumn, Row, Status, Work, parse_design
from orchestrator.engine.cases import Value
from orchestrator.engine.grid import MAX_CASES
from orchestrator.errors import ScenarioError
from orchestrator.paired.calibration import DEFAULT_SETTINGS, Calibration, GapMap, load_or_calibrate
from orchestrator.paired.cosimulation import LoopSession, LoopValues, loop_values
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.metric import ErrorStatistics, difference_sum, error_statistics
from orchestrator.paired.settings import MapSettings
from orchestrator.paired.sizes import read_sizes
from orchestrator.shared.arrays import Array

COLUMNS = (
    ResultColumn("S", "rad"),
    ResultColumn("estimate", "rad"),
    ResultColumn("lower", "rad"),
    ResultColumn("upper", "rad"),
    ResultColumn("error", "rad"),
    ResultColumn("error_percent", "%"),
)
OWN_PARAMETERS = frozenset({"alpha", "noise", "repetition"})


@dataclass(frozen=True)
class SweepPlan:
    """What a sweep varies."""

    experiment: Experiment  # what all cases share; its encoder noise is replaced by each of ``noise``
    sizes: str = "random:20"  # as ``read_sizes`` takes them
    noise: tuple[float, ...] = (0.0,)  # encoder noise levels [rad]
    repetitions: int = 1  # runs of each size and noise level, each with noise of its own
    seed: int = 0  # of random sizes and of all noise
    vary: tuple[str, ...] = ()  # further parameters, ``NAME=SPECIFICATION`` as the engine reads them
    samples: int = 1  # draws of those that are random; not used with random sizes, which are drawn together with them

    def cases(self) -> DesignCases:
        """Return the cases, checked against the range that the experiment claims."""
        if not 1 <= self.repetitions <= MAX_CASES:
            raise ScenarioError(f"`seeds` must be 1 to {MAX_CASES:,}, but is {self.repetitions:g}", "seeds")
        for level in self.noise:
            if not (np.isfinite(level) and level >= 0.0):
                raise ScenarioError(f"`noise` must be finite and not negative, but is {level}", "noise")
        sizes = read_sizes(self.sizes, self.experiment)
        specifications = [
            f"alpha={sizes.specification}",
            "noise=" + ",".join(repr(level) for level in self.noise),
            f"repetition=range:1:{self.repetitions}:{self.repetitions}",
            *self.vary,
        ]
        return DesignCases(parse_design(specifications, sizes.count or self.samples, self.seed), self.seed)

    def calibrations(
        self, progress: Callable[[str], None] | None = None, settings: MapSettings = DEFAULT_SETTINGS
    ) -> dict[float, Calibration]:
        """Return the calibration by noise level [rad]; ``progress`` is told of those that must be made."""
        levels = {level: replace(self.experiment, encoder_noise=level) for level in self.noise}
        return {level: load_or_calibrate(experiment, progress, settings) for level, experiment in levels.items()}


def sweep_work(plan: SweepPlan, fmus: Mapping[str, Path], calibrations: Mapping[float, Calibration]) -> Work:
    """Return what a worker process does for each case; the calibrations are by noise level [rad]."""
    return Work(
        prepare=_prepare,
        run=_run,
        columns=COLUMNS,
        payload=(plan.experiment, loop_values(plan.experiment), dict(calibrations)),
        files=dict(fmus),
        definition={
            "experiment": asdict(plan.experiment),
            "calibrations": {repr(level): c.digest for level, c in calibrations.items()},
        },
        unpacked=True,
    )


@dataclass(frozen=True)
class _Prepared:
    session: LoopSession
    twin: Array
    experiment: Experiment
    maps: Mapping[float, GapMap]


def _prepare(payload: tuple[Experiment, LoopValues, dict[float, Calibration]], files: Mapping[str, Path]) -> _Prepared:
    experiment, values, calibrations = payload
    session = LoopSession(experiment, files, ("theta_l_hat",), values)
    maps = {level: GapMap(calibration) for level, calibration in calibrations.items()}
    return _Prepared(session, session.run(0.0)["theta_l_hat"].copy(), experiment, maps)


def _run(prepared: _Prepared, case: Case) -> dict[str, Value]:
    values = dict(case.parameters)
    alpha, noise = float(values.pop("alpha") or 0.0), float(values.pop("noise") or 0.0)
    values.pop("repetition")
    shape = prepared.experiment.steps + 1
    draws = case.generator().normal(0.0, noise, (2, shape)) if noise else np.zeros((2, shape))
    start = {name: value for name, value in values.items() if value is not None}
    loop = prepared.session.run(alpha, (draws[0], draws[1]), start)
    total = difference_sum(loop["theta_l_hat"], prepared.twin)
    if not np.isfinite(total):
        return dict.fromkeys((c.name for c in COLUMNS), total)
    gap = prepared.maps[noise].estimate(total)
    error = abs(gap.alpha - alpha)
    return {
        "S": total,
        "estimate": gap.alpha,
        "lower": gap.lower,
        "upper": gap.upper,
        "error": error,
        "error_percent": 100.0 * error / alpha,
    }


@dataclass(frozen=True)
class SweepArrays:
    """The finished cases of a sweep as columns, all of one shape."""

    actual: Array
    noise: Array
    estimate: Array
    lower: Array
    upper: Array

    def statistics(self) -> dict[float, ErrorStatistics]:
        """Return the statistics of each noise level, by the level [rad]."""
        found = {}
        for level in np.unique(self.noise):
            chosen = self.noise == level
            found[float(level)] = error_statistics(
                self.actual[chosen], self.estimate[chosen], self.lower[chosen], self.upper[chosen]
            )
        return found


def gather(rows: Iterable[Row]) -> SweepArrays:
    """Return the columns of all rows that are done."""
    collected = array("d")  # eight bytes a number: a million rows as tuples take a quarter of a gigabyte
    for row in rows:
        if row.outcome.status is Status.DONE:
            values: dict[str, Any] = dict(zip((c.name for c in COLUMNS), row.outcome.values, strict=True))
            parameters: Mapping[str, Any] = row.case.parameters
            collected.extend(
                (parameters["alpha"], parameters["noise"], values["estimate"], values["lower"], values["upper"])
            )
    table = np.frombuffer(collected).reshape(-1, 5)
    return SweepArrays(*table.T)
