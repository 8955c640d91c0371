"""The monotone map from the metric S to the half-gap, with an interval, and where it came from.

Without noise the map is interpolated between exact runs. With encoder noise its mean is shifted by what the noise
adds to S, and its spread is modelled over the size; a second, disjoint set of runs sets the width of the interval
(split conformal prediction: Vovk, Gammerman and Shafer, 2005), so that it covers what it claims.
"""

import contextlib
import hashlib
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from orchestrator.building.sources import recipe_of
from orchestrator.errors import CalibrationError
from orchestrator.paired.compiled_loop import CompiledLoop, make_loop
from orchestrator.paired.cosimulation import FMUS
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.metric import difference_sum
from orchestrator.paired.monotone import monotone_cubic
from orchestrator.paired.settings import MapSettings
from orchestrator.shared.arrays import Array
from orchestrator.shared.cache import cache_directory, is_intact, note_hash, tell_damage
from orchestrator.shared.cores import usable_cores
from orchestrator.shared.equation_files import closure
from orchestrator.shared.output import write_whole
from orchestrator.shared.version import __version__

Each = Callable[[Callable[[Any], float], Iterable[Any]], Iterable[float]]
"""``map`` of a pool of threads."""

# Seeds of calibration and of tests come from different branches of one tree, so that none is ever shared.
CALIBRATION_BRANCH = 7
DEFAULT_SETTINGS: MapSettings = MapSettings()
# Calibrations of the default experiment come with the sources that they were made from: `python -m tools.calibrations`.
SHIPPED = Path(__file__).parent / "data"


class Calibration(msgspec.Struct, frozen=True):
    """A calibrated map; every field is plain, so that it is stored as it is."""

    experiment: dict[str, object]  # all values of the experiment, for the record
    digest: str  # hash of experiment, sources and method
    version: str  # of the project that made it
    smallest: float  # smallest half-gap claimed [rad]
    largest: float  # largest half-gap claimed [rad]
    log_sum: list[float]  # increasing values of log S
    log_alpha: list[float]  # log of the half-gap at each
    log_spread: list[float]  # standard deviation of log alpha_hat at each
    width: float  # how many spreads the interval reaches to either side
    level: float  # what the interval claims to cover
    runs: int  # how many runs it was made from
    seed_branch: int  # the branch of the seed tree that they came from
    settings: MapSettings


@dataclass(frozen=True)
class GapEstimate:
    """A half-gap with its interval, all in rad."""

    alpha: float
    lower: float
    upper: float


class GapMap:
    """A calibration, ready to be asked many times."""

    def __init__(self, calibration: Calibration) -> None:
        self._calibration = calibration
        self._centre = monotone_cubic(calibration.log_sum, calibration.log_alpha)
        self._log_sum, self._spread = np.array(calibration.log_sum), np.array(calibration.log_spread)
        self._room = _noise_below(calibration)

    def estimate(self, total: float) -> GapEstimate:
        """Return the half-gap that the metric ``total`` [rad] stands for."""
        calibration = self._calibration
        low, high = np.exp(calibration.log_sum[0]), np.exp(calibration.log_sum[-1])
        if low * np.exp(-self._room) <= total < low:
            smallest = float(np.exp(calibration.log_alpha[0]))
            return GapEstimate(smallest, 0.0, smallest * float(np.exp(calibration.width * calibration.log_spread[0])))
        if not low <= total <= high:
            raise CalibrationError(
                f"`S` must lie within the calibrated {low:.6g} to {high:.6g} rad, but is {total:.6g}: the gap is "
                f"outside {calibration.smallest:g} to {calibration.largest:g} rad"
            )
        at = np.log(total)
        centre = float(self._centre(at))
        reach = calibration.width * float(np.interp(at, self._log_sum, self._spread))
        return GapEstimate(float(np.exp(centre)), float(np.exp(centre - reach)), float(np.exp(centre + reach)))


def estimate_gap(calibration: Calibration, total: float) -> GapEstimate:
    """Return the half-gap that the metric ``total`` [rad] stands for, see ``GapMap.estimate``."""
    return GapMap(calibration).estimate(total)


def _noise_below(calibration: Calibration) -> float:
    """Return how far noise may push log S below the smallest calibrated value; zero without noise."""
    if not calibration.experiment["encoder_noise"]:
        return 0.0
    slope = (calibration.log_sum[1] - calibration.log_sum[0]) / (calibration.log_alpha[1] - calibration.log_alpha[0])
    return calibration.settings.edge_deviations * calibration.log_spread[0] * slope


def load_or_calibrate(
    experiment: Experiment, progress: Callable[[str], None] | None = None, settings: MapSettings = DEFAULT_SETTINGS
) -> Calibration:
    """Return the calibration of ``experiment``: the one that comes with these sources, or the user's, or a new one."""
    name = f"{_digest(experiment, settings)}.json"
    if (SHIPPED / name).exists():
        return msgspec.json.decode((SHIPPED / name).read_bytes(), type=Calibration)
    path = cache_directory("calibrations") / name
    if is_intact(path):
        return msgspec.json.decode(path.read_bytes(), type=Calibration)
    if path.exists():
        tell_damage(path)
    if progress is not None:
        progress(f"calibrating the {experiment.name} experiment at encoder noise {experiment.encoder_noise:g} rad")
    calibration = calibrate(experiment, settings)
    with contextlib.suppress(OSError):  # a full cache costs time, no result
        write_whole(path, calibration_text(calibration))
        note_hash(path)
    return calibration


def calibration_text(calibration: Calibration) -> str:
    """Return a calibration as JSON, from which it is read again exactly."""
    return msgspec.json.format(msgspec.json.encode(calibration), indent=1).decode()


def _digest(experiment: Experiment, settings: MapSettings) -> str:
    """Return what names a calibration: a hash of experiment, settings and every source that its numbers come from."""
    digest = hashlib.sha256(experiment.digest().encode())
    digest.update(msgspec.json.encode(settings))
    for source in _sources():
        digest.update(source.read_bytes())
    return digest.hexdigest()[:24]


@cache
def _sources() -> tuple[Path, ...]:
    """Return the files of the three slaves, of their design and of the method."""
    slaves = {path for name in FMUS for path in closure(recipe_of(name).module)}
    here = Path(__file__).parent
    method = (
        "calibration", "compiled_loop", "cosimulation", "experiment", "loop_kernel", "metric", "monotone", "settings",
    )  # fmt: skip
    return (*sorted(slaves), here.parent / "plants" / "design.py", *(here / f"{name}.py" for name in method))


def calibrate(experiment: Experiment, settings: MapSettings = DEFAULT_SETTINGS) -> Calibration:
    """Return the calibrated map of ``experiment``, made from runs of its own sizes and seeds."""
    return calibrate_loop(make_loop(experiment), settings, usable_cores())


def calibrate_loop(loop: CompiledLoop, settings: MapSettings, threads: int = 1) -> Calibration:
    """Return the calibrated map of an experiment's loop; see :func:`calibrate`."""
    with ThreadPoolExecutor(threads) as pool:
        return _calibrate(loop, settings, pool.map)


def _calibrate(loop: CompiledLoop, settings: MapSettings, each: Each) -> Calibration:
    experiment = loop.experiment
    zero = (np.zeros(experiment.steps + 1), np.zeros(experiment.steps + 1))
    twin = loop.run(0.0, zero)[:, 2]
    sizes = np.geomspace(
        experiment.smallest * settings.margin_below, experiment.largest * settings.margin_above, settings.clean_sizes
    )
    sums = np.array(list(each(lambda alpha: difference_sum(loop.run(alpha, zero)[:, 2], twin), sizes)))
    _require_monotone(sums, sizes, experiment)
    log_alpha, log_sum = np.log(sizes), np.log(sums)
    runs = len(sizes)
    if experiment.encoder_noise == 0.0:
        spread = _interpolation_error(log_sum, log_alpha, settings.least_spread)
    else:
        log_sum, spread = _noisy_map(loop, twin, log_alpha, log_sum, settings, each)
        _require_monotone(np.exp(log_sum), sizes, experiment)
        runs += settings.noisy_sizes * settings.seeds_per_size
    width = _conformal_width(loop, twin, log_alpha, log_sum, spread, settings, each)
    return Calibration(
        experiment=asdict(experiment),
        digest=_digest(experiment, settings),
        version=__version__,
        smallest=experiment.smallest,
        largest=experiment.largest,
        log_sum=log_sum.tolist(),
        log_alpha=log_alpha.tolist(),
        log_spread=spread.tolist(),
        width=width,
        level=settings.level,
        runs=runs + settings.validation_runs,
        seed_branch=CALIBRATION_BRANCH,
        settings=settings,
    )


def _require_monotone(sums: Array, sizes: Array, experiment: Experiment) -> None:
    falls = np.flatnonzero(np.diff(sums) <= 0.0)
    if len(falls):
        at = sizes[falls[0]]
        raise CalibrationError(
            f"S must grow strictly with alpha in the {experiment.name} experiment, but falls near {at:.4g} rad: "
            "choose a smoother reference, a softer controller or a smaller range of sizes"
        )


def _interpolation_error(log_sum: Array, log_alpha: Array, least: float) -> Array:
    """Return how far every second node lies from the map through the others, as the larger of neighbours."""
    coarse = monotone_cubic(log_sum[::2], log_alpha[::2])
    error = np.abs(coarse(log_sum) - log_alpha)
    nearby = np.array([error[max(0, n - 2) : n + 3].max() for n in range(len(error))])
    return np.maximum(nearby, least)


def _generator(*key: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(0, spawn_key=(CALIBRATION_BRANCH, *key)))


def _noisy_sum(loop: CompiledLoop, twin: Array, alpha: float, generator: np.random.Generator) -> float:
    noise = loop.experiment.encoder_noise
    errors = generator.normal(0.0, noise, (2, len(twin))) if noise else np.zeros((2, len(twin)))
    return difference_sum(loop.run(alpha, (errors[0], errors[1]))[:, 2], twin)


def _noisy_map(
    loop: CompiledLoop, twin: Array, log_alpha: Array, log_sum: Array, settings: MapSettings, each: Each
) -> tuple[Array, Array]:
    """Return (mean of log S under noise, spread of log alpha_hat), both at the clean map's nodes."""
    nodes = np.linspace(log_alpha[0], log_alpha[-1], settings.noisy_sizes)
    clean = monotone_cubic(log_alpha, log_sum)
    count = settings.seeds_per_size

    def draw(job: int) -> float:
        n, seed = divmod(job, count)
        return float(np.log(_noisy_sum(loop, twin, float(np.exp(nodes[n])), _generator(0, n, seed))))

    draws = np.array(list(each(draw, range(settings.noisy_sizes * count)))).reshape(-1, count)
    shift = draws.mean(axis=1) - clean(nodes)
    variance = draws.var(axis=1, ddof=1)
    moved = log_sum + monotone_cubic(nodes, _smooth(shift))(log_alpha)
    slope = monotone_cubic(log_alpha, moved).slope(log_alpha)
    deviation = np.exp(0.5 * monotone_cubic(nodes, np.log(_smooth(variance)))(log_alpha))
    return moved, deviation / np.maximum(np.abs(slope), settings.least_slope)


def _smooth(values: Array) -> Array:
    """Return ``values`` averaged with their neighbours, weights 1 2 3 2 1."""
    padded = np.pad(values, 2, mode="edge")
    return np.convolve(padded, np.array([1.0, 2.0, 3.0, 2.0, 1.0]) / 9.0, mode="valid")


def _conformal_width(
    loop: CompiledLoop,
    twin: Array,
    log_alpha: Array,
    log_sum: Array,
    spread: Array,
    settings: MapSettings,
    each: Each = map,
) -> float:
    """Return the multiple of the spread that covers ``settings.level`` of runs that the map has not seen."""
    inverse = monotone_cubic(log_sum, log_alpha)
    low, high = np.log(loop.experiment.smallest), np.log(loop.experiment.largest)

    def score(n: int) -> float:
        generator = _generator(1, n)
        actual = generator.uniform(low, high)
        at = np.clip(np.log(_noisy_sum(loop, twin, float(np.exp(actual)), generator)), log_sum[0], log_sum[-1])
        return abs(float(inverse(at)) - actual) / float(np.interp(at, log_sum, spread))

    scores = np.array(list(each(score, range(settings.validation_runs))))
    rank = int(np.ceil((settings.validation_runs + 1) * settings.level)) - 1
    return float(np.sort(scores)[min(rank, settings.validation_runs - 1)])
