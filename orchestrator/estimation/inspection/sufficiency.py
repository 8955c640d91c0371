"""Whether a record suffices to see a gap, of what size, and which experiment would do better."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.estimation.design import Excitation, MachineLimits, bound_of_excitation, simple_candidates
from orchestrator.estimation.problem import measurement_noise
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record

SIZES = (5e-4, 1e-3, 2e-3, 5e-3, 0.01, 0.02, 0.05)  # rad, half-gaps that are tried
MOST_ROWS = 3000  # for one bound
SEEN = 0.25  # a size is seen where the bound is below this share of it
LONGEST_DESIGN = 10.0  # s


@dataclass(frozen=True)
class Sufficiency:
    """What a record shows of gaps.

    Attributes:
        bounds: for each of ``SIZES`` that was tried, the bound on the standard error [rad].
        smallest: smallest half-gap that is seen [rad], or infinity.
        rows: how many rows of the record the bounds are of.
        better: excitations of the same length and limits, the best first; with their bounds for ``design_size``.
        own: the bound of the record itself for ``design_size`` [rad].
        design_size: half-gap [rad].
    """

    bounds: Sequence[tuple[float, float]]
    smallest: float
    rows: int
    better: Sequence[Excitation]
    own: float
    design_size: float


def sufficiency(record: Record, model: Model) -> Sufficiency:
    """Return what a record shows of gaps if the machine is as the model says.

    Args:
        record: the record.
        model: of the machine.

    Returns:
        Bounds by size, the smallest size that is seen [rad], and the torque that would do better.
    """
    rows = min(record.size, MOST_ROWS)
    part = record.part(0, rows).filled()
    both = part.theta_l is not None
    noise = (
        measurement_noise(part, model, "theta_m"),
        measurement_noise(part, model, "theta_l") if both else 1.0,
    )
    # The information of a record grows with its length.
    longer = math.sqrt(rows / record.size)
    bounds = []
    for size in SIZES:
        bound = bound_of_excitation(model, part.time, part.u, size, noise, not both)
        bounds.append((size, longer * bound))
    seen = [size for size, bound in bounds if bound < SEEN * size]
    smallest = _between(bounds) if seen else math.inf
    size = min((s for s in SIZES if s >= smallest), default=SIZES[-1])
    limits = MachineLimits(float(np.abs(part.u).max()), _fastest(part))
    duration = min(part.duration, LONGEST_DESIGN)
    better = simple_candidates(model, size, limits, duration, 1.0 / part.step, not both)
    scaled = [
        Excitation(c.name, c.u, c.bound * math.sqrt(duration / record.duration), c.torque, c.speed)
        for c in better
        if math.isfinite(c.bound)
    ]
    return Sufficiency(bounds, smallest, rows, scaled, dict(bounds)[size], size)


def _between(bounds: Sequence[tuple[float, float]]) -> float:
    """Return the size at which the bound meets its share, between two that were tried (logarithmically)."""
    previous: tuple[float, float] | None = None
    for size, bound in bounds:
        if bound < SEEN * size:
            if previous is None or not math.isfinite(previous[1]):
                return size
            low, high = (math.log(b / (SEEN * s)) for s, b in (previous, (size, bound)))
            return float(math.exp(np.interp(0.0, [high, low], [math.log(size), math.log(previous[0])])))
        previous = (size, bound)
    return math.inf


def _fastest(record: Record) -> float:
    width = max(3, round(0.02 / record.step))
    speed = np.convolve(np.gradient(record.theta_m, record.step), np.ones(width) / width, "valid")
    return max(float(np.abs(speed).max()), 1e-3)
