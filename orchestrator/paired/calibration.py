"""The monotone map from the metric S to the half-gap, with an interval, and where it came from.

Without noise the map is interpolated between exact runs. With encoder noise its mean is shifted by what the noise
adds to S, and its spread is modelled over the size; a second, disjoint set of runs sets the width of the interval
(split conformal prediction: Vovk, Gammerman and Shafer, 2005), so that it covers what it claims.
"""

import hashlib
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

import pyfmu_sources
from orchestrator import __version__
from orchestrator.cache import cache_directory
from orchestrator.errors import CalibrationError
from orchestrator.output import write_text
from orchestrator.paired.compiled_loop import CompiledLoop, compiled_loop
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.metric import difference_sum

Array = NDArray[np.float64]

# Seeds of calibration and of tests come from different branches of one tree, so that none is ever shared.
CALIBRATION_BRANCH = 7
CLEAN_SIZES = 241
NOISY_SIZES = 121
SEEDS_PER_SIZE = 24
VALIDATION_RUNS = 4000
LEVEL = 0.95
MARGIN_BELOW = 0.75
MARGIN_ABOVE = 1.1
# How many standard deviations of noise below the smallest calibrated S still count as a very small gap.
EDGE_DEVIATIONS = 5.0


class Calibration(msgspec.Struct, frozen=True):
    """A calibrated map; every field is plain, so that it is stored as it is.

    Attributes:
        experiment: all values of the experiment, for the record.
        digest: hash of experiment, sources and method.
        version: of the project that made it.
        smallest: smallest half-gap claimed [rad].
        largest: largest half-gap claimed [rad].
        log_sum: increasing values of log S.
        log_alpha: log of the half-gap at each.
        log_spread: standard deviation of log alpha_hat at each.
        width: how many spreads the interval reaches to either side.
        level: what the interval claims to cover.
        runs: how many runs it was made from.
        seed_branch: the branch of the seed tree that they came from.
    """

    experiment: dict[str, object]
    digest: str
    version: str
    smallest: float
    largest: float
    log_sum: list[float]
    log_alpha: list[float]
    log_spread: list[float]
    width: float
    level: float
    runs: int
    seed_branch: int


@dataclass(frozen=True)
class GapEstimate:
    """A half-gap with its interval, all in rad."""

    alpha: float
    lower: float
    upper: float


def estimate_gap(calibration: Calibration, total: float) -> GapEstimate:
    """Return the half-gap that the metric ``total`` [rad] stands for.

    Raises:
        CalibrationError: ``total`` lies outside what was calibrated; nothing is extrapolated.
    """
    low, high = np.exp(calibration.log_sum[0]), np.exp(calibration.log_sum[-1])
    room = _noise_below(calibration)
    if low * np.exp(-room) <= total < low:
        smallest = float(np.exp(calibration.log_alpha[0]))
        return GapEstimate(smallest, 0.0, smallest * float(np.exp(calibration.width * calibration.log_spread[0])))
    if not low <= total <= high:
        raise CalibrationError(
            f"`S` must lie within the calibrated {low:.6g} to {high:.6g} rad, but is {total:.6g}: the gap is outside "
            f"{calibration.smallest:g} to {calibration.largest:g} rad"
        )
    at = np.log(total)
    centre = float(PchipInterpolator(calibration.log_sum, calibration.log_alpha)(at))
    reach = calibration.width * float(np.interp(at, calibration.log_sum, calibration.log_spread))
    return GapEstimate(float(np.exp(centre)), float(np.exp(centre - reach)), float(np.exp(centre + reach)))


def _noise_below(calibration: Calibration) -> float:
    """Return how far noise may push log S below the smallest calibrated value; zero without noise."""
    if not calibration.experiment["encoder_noise"]:
        return 0.0
    slope = (calibration.log_sum[1] - calibration.log_sum[0]) / (calibration.log_alpha[1] - calibration.log_alpha[0])
    return EDGE_DEVIATIONS * calibration.log_spread[0] * slope


def load_or_calibrate(experiment: Experiment, progress: Callable[[str], None] | None = None) -> Calibration:
    """Return the calibration of ``experiment`` from the user's cache, or make and store it.

    Args:
        experiment: what is calibrated.
        progress: told what is going on.

    Raises:
        CalibrationError: S is not strictly monotone over the sizes claimed.
    """
    path = cache_directory("calibrations") / f"{_digest(experiment)}.json"
    if path.exists():
        try:
            return msgspec.json.decode(path.read_bytes(), type=Calibration)
        except msgspec.DecodeError:
            path.unlink()
    if progress is not None:
        progress(f"calibrating the {experiment.name} experiment at encoder noise {experiment.encoder_noise:g} rad")
    calibration = calibrate(experiment)
    write_text(path, msgspec.json.format(msgspec.json.encode(calibration), indent=1).decode())
    return calibration


def _digest(experiment: Experiment) -> str:
    digest = hashlib.sha256(experiment.digest().encode())
    for folder in (Path(pyfmu_sources.__file__).parent, Path(__file__).parent):
        for source in sorted(folder.glob("*.py")):
            digest.update(source.read_bytes())
    return digest.hexdigest()[:24]


def calibrate(experiment: Experiment) -> Calibration:
    """Return the calibrated map of ``experiment``, made from runs of its own sizes and seeds.

    Raises:
        CalibrationError: S is not strictly monotone over the sizes claimed.
    """
    loop = compiled_loop(experiment)
    zero = (np.zeros(experiment.steps + 1), np.zeros(experiment.steps + 1))
    twin = loop.run(0.0, zero)[:, 2]
    sizes = np.geomspace(experiment.smallest * MARGIN_BELOW, experiment.largest * MARGIN_ABOVE, CLEAN_SIZES)
    sums = np.array([difference_sum(loop.run(a, zero)[:, 2], twin) for a in sizes])
    _require_monotone(sums, sizes, experiment)
    log_alpha, log_sum = np.log(sizes), np.log(sums)
    runs = len(sizes)
    if experiment.encoder_noise == 0.0:
        spread = _interpolation_error(log_sum, log_alpha)
    else:
        log_sum, spread = _noisy_map(loop, twin, log_alpha, log_sum)
        _require_monotone(np.exp(log_sum), sizes, experiment)
        runs += NOISY_SIZES * SEEDS_PER_SIZE
    width = _conformal_width(loop, twin, log_alpha, log_sum, spread)
    return Calibration(
        experiment=asdict(experiment),
        digest=_digest(experiment),
        version=__version__,
        smallest=experiment.smallest,
        largest=experiment.largest,
        log_sum=log_sum.tolist(),
        log_alpha=log_alpha.tolist(),
        log_spread=spread.tolist(),
        width=width,
        level=LEVEL,
        runs=runs + VALIDATION_RUNS,
        seed_branch=CALIBRATION_BRANCH,
    )


def _require_monotone(sums: Array, sizes: Array, experiment: Experiment) -> None:
    falls = np.flatnonzero(np.diff(sums) <= 0.0)
    if len(falls):
        at = sizes[falls[0]]
        raise CalibrationError(
            f"S must grow strictly with alpha in the {experiment.name} experiment, but falls near {at:.4g} rad: "
            "choose a smoother reference, a softer controller or a smaller range of sizes"
        )


def _interpolation_error(log_sum: Array, log_alpha: Array) -> Array:
    """Return how far every second node lies from the map through the others, as the larger of neighbours."""
    coarse = PchipInterpolator(log_sum[::2], log_alpha[::2])
    error = np.abs(coarse(log_sum) - log_alpha)
    nearby = np.array([error[max(0, n - 2) : n + 3].max() for n in range(len(error))])
    return np.maximum(nearby, 1e-12)


def _generator(*key: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(0, spawn_key=(CALIBRATION_BRANCH, *key)))


def _noisy_sum(loop: CompiledLoop, twin: Array, alpha: float, generator: np.random.Generator) -> float:
    noise = loop.experiment.encoder_noise
    errors = generator.normal(0.0, noise, (2, len(twin)))
    return difference_sum(loop.run(alpha, (errors[0], errors[1]))[:, 2], twin)


def _noisy_map(loop: CompiledLoop, twin: Array, log_alpha: Array, log_sum: Array) -> tuple[Array, Array]:
    """Return (mean of log S under noise, spread of log alpha_hat), both at the clean map's nodes."""
    nodes = np.linspace(log_alpha[0], log_alpha[-1], NOISY_SIZES)
    clean = PchipInterpolator(log_alpha, log_sum)
    shift = np.empty(NOISY_SIZES)
    variance = np.empty(NOISY_SIZES)
    for n, node in enumerate(nodes):
        draws = [
            np.log(_noisy_sum(loop, twin, float(np.exp(node)), _generator(0, n, s))) for s in range(SEEDS_PER_SIZE)
        ]
        shift[n] = np.mean(draws) - clean(node)
        variance[n] = np.var(draws, ddof=1)
    moved = log_sum + PchipInterpolator(nodes, _smoothed(shift))(log_alpha)
    slope = PchipInterpolator(log_alpha, moved).derivative()(log_alpha)
    deviation = np.exp(0.5 * PchipInterpolator(nodes, np.log(_smoothed(variance)))(log_alpha))
    return moved, deviation / np.maximum(np.abs(slope), 1e-6)


def _smoothed(values: Array) -> Array:
    """Return ``values`` averaged with their neighbours, weights 1 2 3 2 1."""
    padded = np.pad(values, 2, mode="edge")
    return np.convolve(padded, np.array([1.0, 2.0, 3.0, 2.0, 1.0]) / 9.0, mode="valid")


def _conformal_width(loop: CompiledLoop, twin: Array, log_alpha: Array, log_sum: Array, spread: Array) -> float:
    """Return the multiple of the spread that covers ``LEVEL`` of runs that the map has not seen."""
    inverse = PchipInterpolator(log_sum, log_alpha)
    low, high = np.log(loop.experiment.smallest), np.log(loop.experiment.largest)
    scores = np.empty(VALIDATION_RUNS)
    for n in range(VALIDATION_RUNS):
        generator = _generator(1, n)
        actual = generator.uniform(low, high)
        at = np.clip(np.log(_noisy_sum(loop, twin, float(np.exp(actual)), generator)), log_sum[0], log_sum[-1])
        scores[n] = abs(float(inverse(at)) - actual) / float(np.interp(at, log_sum, spread))
    rank = int(np.ceil((VALIDATION_RUNS + 1) * LEVEL)) - 1
    return float(np.sort(scores)[min(rank, VALIDATION_RUNS - 1)])
