"""Whether a record suffices to see a gap, of what size, and which experiment would do better."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.errors import RecordError
from orchestrator.estimation.design import (
    Excitation,
    MachineLimits,
    error_bound_of_excitation,
    plant_of,
    simple_candidates,
)
from orchestrator.estimation.filter.innovations import count_traversals, simulate
from orchestrator.estimation.problem import measurement_noise
from orchestrator.estimation.settings import DEFAULT_SETTINGS
from orchestrator.estimation.signals import sides_of
from orchestrator.plants.known.two_stage_train import TRAIN
from orchestrator.records.model_file import Model
from orchestrator.records.plausibility import check_plausible, smooth, smooth_rows
from orchestrator.records.record import Record

SIZES = (5e-4, 1e-3, 2e-3, 5e-3, 0.01, 0.02, 0.05)  # rad, half-gaps that are tried
MOST_ROWS = 3000  # for one bound
SEEN = 0.25  # a size is seen where the bound is below this share of it
LONGEST_DESIGN = 10.0  # s
HELD = 0.01  # share of the time in which the shaft's torque may have the other sign, if one flank is loaded throughout


@dataclass(frozen=True)
class Sufficiency:
    """What a record shows of gaps."""

    # for each of ``SIZES`` that was tried, the bound on the standard error [rad]; infinite where the record would not
    # traverse the gap often enough. Empty where no size can be seen
    bounds: Sequence[tuple[float, float]]
    smallest: float  # smallest half-gap that is seen [rad], or infinity
    rows: int  # how many rows of the record the bounds are of
    # excitations of the same length and limits, the best first; with their bounds for ``design_size``
    better: Sequence[Excitation]
    own: float  # the bound of the record itself for ``design_size`` [rad]
    design_size: float  # half-gap [rad]
    why: str = ""  # sentence on why no size can be seen, whatever the bounds; empty where one may be

    def ranges(self) -> list[tuple[float, float]]:
        """Return the smallest and the largest size of each run of sizes that are seen [rad]."""
        runs: list[list[float]] = []
        seen = False
        for size, bound in self.bounds:
            if bound < SEEN * size:
                if seen:
                    runs[-1][1] = size
                else:
                    runs.append([self.smallest if not runs else size, size])
            seen = bound < SEEN * size
        return [(low, high) for low, high in runs]


def sufficiency(record: Record, model: Model) -> Sufficiency:
    """Return what a record shows of gaps if the machine is as the model says."""
    why = _why_none(record, model)
    if why:
        return Sufficiency((), math.inf, record.size, (), math.inf, math.nan, why)
    rows = min(record.size, MOST_ROWS)
    part = record.part(0, rows).fill_missing()
    both = part.theta_l is not None
    noise = (measurement_noise(part, model, "theta_m"), measurement_noise(part, model, "theta_l") if both else 1.0)
    # The information of a record grows with its length.
    longer = math.sqrt(rows / record.size)
    bounds = []
    for size in SIZES:
        traversed = _traversals(model, part, size) / longer**2 >= DEFAULT_SETTINGS.trust.least_traversals
        bound = error_bound_of_excitation(model, part.time, part.u, size, noise, not both) if traversed else math.inf
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


def _why_none(record: Record, model: Model) -> str:
    """Return the sentence that says why no gap of any size can be seen, or nothing."""
    if model.fmu == TRAIN:
        return (
            f"What a record of a {TRAIN} shows of gaps is not foretold: `estimate` with this model says in which stage "
            "the gap is, or what the record leaves open."
        )
    reason = _reason_for_none(record, model)
    return f"The record shows no gap of any size: {reason}." if reason else ""


def _reason_for_none(record: Record, model: Model) -> str:
    if model.fmu != "Drivetrain":
        return f"the model is {model.fmu}, an axis without teeth, which has no gap"
    if not record.has_torque:
        return "without a torque no bound can be computed; `estimate` searches the two angles for a gap"
    try:
        check_plausible(record, model)
    except RecordError as error:
        said = str(error).replace(" (`model`)", " in the model file")
        return f"it does not fit the model, and `estimate` refuses it: {said}"
    share = _other_sign(record, model)
    if share < HELD:
        return (
            "one flank is loaded throughout, by gravity or another torque that is larger than what drives and brakes "
            "the load; let the shaft's torque change its sign"
        )
    return ""


def _other_sign(record: Record, model: Model) -> float:
    """Return the share of the time in which the shaft's torque has its rarer sign, by the motor's balance.

    Within three standard deviations of the balance's own scatter a torque has no sign.
    """
    record = record.fill_missing()
    p = {name: entry.value for name, entry in model.parameters.items()}
    impulse, speed, angle, _ = smooth(record, p["tau"])
    width = smooth_rows(record)
    rows = np.arange(0, speed.size, width)
    if rows.size < 8:
        return 1.0
    span = np.diff(rows) * record.step
    torque = (np.diff(impulse[rows]) - p["J_m"] * np.diff(speed[rows]) - p["b_m"] * np.diff(angle[rows])) / span
    # A mean speed is the difference of two readings, and the torque that of two such speeds.
    noise = math.sqrt(6.0) * measurement_noise(record, model, "theta_m") / (width * record.step)
    scatter = 3.0 * p["J_m"] * noise / (width * record.step)
    up, down = int(np.count_nonzero(torque > scatter)), int(np.count_nonzero(torque < -scatter))
    return float(min(up, down)) / max(up + down, 1)


def _traversals(model: Model, record: Record, size: float) -> int:
    """Return how often the model's plant, driven by the record's torque from rest, goes through a half-gap [rad]."""
    states = simulate(plant_of(model, size), record.u, record.step, np.zeros(5))
    twist = states[:, 0] / model.parameters["i"].value - states[:, 2]
    return count_traversals(sides_of(twist, size))


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
