"""What is unknown about a record under a model: parameters, gap, initial state, noise; and where each is looked for."""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from orchestrator.estimation.filter.model import DEPTH, DRIVETRAIN, LOAD_TORQUE, BodyNames, NoiseLevels
from orchestrator.estimation.zeros import held_twist, play_of
from orchestrator.records.model_file import Encoder, Model
from orchestrator.records.record import Record, quantisation_step
from orchestrator.shared.arrays import Array
from orchestrator.shared.inference.noise import rms, rms_behind_lag, robust_noise

STATE_NAMES = ("theta_m_start", "omega_m_start", "theta_l_start", "omega_l_start", "T_m_start")
ALPHA = "alpha"
SCALE = "u_scale"
TORQUE_OFFSET = "torque_offset"
LATE = "torque_late"
DRY = tuple(f"effects.coulomb_friction.{side}.torque" for side in ("motor", "load"))
# Prior standard deviations: of the torque's gain where the record states none, of its offset and of dry friction over
# the rms of the drive's torque, and of how late it acts [s].
SCALE_SPREAD, OFFSET_SHARE, FRICTION_SHARE, LATE_SPREAD = 0.03, 0.03, 0.1, 3e-3
SLIDING = 5e-3  # of a body's rms speed, at which its dry friction has set in by seven tenths
SAMPLED = "u_sampled"  # way from a torque that is held between its own rows to a smooth one: 0 to 1
SMOOTH = "u_smooth"  # the same of a torque that has a row for each of the record's
OFFSET = "effects.sensor_offset.load.offset"
# Depth at which a contact's damping sets in, prior standard deviation: an angle [rad], or, where that is more, a share
# of the shaft's twist under the drive's torque.
LEAST_DEPTH, DEPTH_SHARE = 1e-3, 0.05
OFFSET_SPREAD = 0.1  # prior standard deviation [rad] of the angle between the encoders' zeros and mid-gap
NOISE_SPREAD = 2.0  # prior standard deviation of a log noise level: a factor of seven
# White torque noise [N.m.s^0.5]. With one encoder a deterministic model can shadow any record: a least noise of motor
# and load keeps it honest.
LEAST_TORQUE_NOISE, LARGEST_TORQUE_NOISE = 1e-9, 30.0
LEAST_WITH_ONE_ENCODER = (1e-4, 1e-3)
# Least and largest rms of the drive's torque [N.m], at motor and load, for which levels of torque noise hold as they
# are. They were found with the thesis's gear.
DRIVES = ((3.0, 20.0), (12.0, 80.0))


@dataclass(frozen=True)
class Unknown:
    """One unknown: its name, prior mean and standard deviation, and the scale in which steps are taken."""

    name: str
    mean: float
    deviation: float
    scale: float
    lower: float = -math.inf
    upper: float = math.inf


@dataclass(frozen=True)
class GapProblem:
    """What is unknown about a record of a drivetrain."""

    row: ClassVar[BodyNames] = DRIVETRAIN
    gap: ClassVar[str] = ALPHA  # name of the gap's size
    difference: ClassVar[float] = 0.01  # step of a difference quotient, in standard deviations
    record: Record
    unknowns: tuple[Unknown, ...]  # every unknown, in the order of the vector; free or not is decided per fit
    outputs: Array  # (n, 1 or 2) measured angles [rad]
    sliding: tuple[float, float]  # speeds at which dry friction of motor and load has set in [rad/s]
    base: Mapping[str, float]  # parameters of the model by name
    # by what levels of torque noise at each body are to be multiplied for a drive as weak, or as strong, as this one
    units: tuple[float, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the unknowns, in order."""
        return tuple(unknown.name for unknown in self.unknowns)

    @property
    def start(self) -> Array:
        """Return the prior means."""
        return np.array([unknown.mean for unknown in self.unknowns])

    def index(self, name: str) -> int:
        """Return the place of an unknown in the vector, from 0."""
        return self.names.index(name)

    def bounds(self, places: Iterable[int]) -> tuple[Array, Array]:
        """Return the least and the largest values of unknowns by their places: (k,) each."""
        chosen = [self.unknowns[n] for n in places]
        return np.array([unknown.lower for unknown in chosen]), np.array([unknown.upper for unknown in chosen])

    def with_unknown(self, place: int, **changes: Any) -> Self:
        """Return the problem with another mean, or other bounds, of the unknown at a place."""
        unknowns = list(self.unknowns)
        unknowns[place] = replace(unknowns[place], **changes)
        return replace(self, unknowns=tuple(unknowns))

    def parameters(self, values: Mapping[str, float]) -> Mapping[str, float]:
        """Return all parameters of the plant by name, of the values of the unknowns."""
        return {**self.base, **values}

    def first(self, p: Mapping[str, float], noise: NoiseLevels) -> tuple[Array, Array]:
        """Return state and standard deviations at the first row, (n,) each; the load's angle as its encoder has it.

        The state of a drivetrain is unknown, and so exact for the filter.
        """
        return np.array([p[name] for name in STATE_NAMES]), np.zeros(len(STATE_NAMES))


def make_problem(record: Record, model: Model) -> GapProblem:
    """Return the estimation problem of a record under a model.

    With the motor encoder alone only alpha times the gear ratio can be seen, so the ratio then counts as exact.
    """
    both = record.theta_l is not None
    base = {name: parameter.value for name, parameter in model.parameters.items()}
    outputs = record.theta_m[:, None] if record.theta_l is None else np.column_stack([record.theta_m, record.theta_l])
    unknowns = parameter_unknowns(model, {ALPHA, OFFSET, *DRY} if both else {ALPHA, OFFSET, *DRY, "i"})
    ratio, lag = base["i"], base["tau"]
    unknowns.append(Unknown(ALPHA, 0.0, math.inf, 1e-3, 0.0, 3.0))
    if both:
        filled = record.fill_missing()
        low, high = play_of(filled, model)
        # Where a torque such as a weight's holds one flank throughout, the middle of the play is not in the record.
        held = held_twist(filled, model) > 0.5 * (high - low)
        unknowns.append(Unknown(OFFSET, 0.0 if held else -0.5 * (low + high), OFFSET_SPREAD, 1e-3))
    pull = abs(ratio) * rms_behind_lag(record.u, record.step, lag)
    depth = max(LEAST_DEPTH, DEPTH_SHARE * pull / base["k"])
    unknowns.append(Unknown(DEPTH, 0.0, depth, depth))
    unknowns += torque_unknowns(record, model, lag, ratio)
    if LOAD_TORQUE not in (unknown.name for unknown in unknowns):
        unknowns.append(Unknown(LOAD_TORQUE, base[LOAD_TORQUE], pull, 1e-3 * pull))
    unknowns.append(Unknown(SMOOTH if record.u_sampled is None else SAMPLED, 0.0, math.inf, 0.1, 0.0, 1.0))
    units = _torque_units(record, lag, ratio)
    unknowns += _initial_state(record, ratio, units[0])
    for column in ("theta_m", "theta_l")[: outputs.shape[1]]:
        unknowns.append(encoder_unknown(record, model, column))
    exact = (LEAST_TORQUE_NOISE, LEAST_TORQUE_NOISE)
    lows = scale_noise(exact if both else LEAST_WITH_ONE_ENCODER, units)
    highs = scale_noise((LARGEST_TORQUE_NOISE, LARGEST_TORQUE_NOISE), units)
    for side, low, high in zip(("motor", "load"), lows, highs, strict=True):
        unknowns.append(Unknown(f"log_torque_{side}", -7.0, math.inf, 0.5, math.log(low), math.log(high)))
    return GapProblem(record, tuple(unknowns), outputs, sliding_speeds(record, ratio), base, units)


def parameter_unknowns(model: Model, without: Collection[str]) -> list[Unknown]:
    """Return the uncertain parameters of a model, apart from some by name."""
    unknowns = []
    for parameter in model.uncertain:
        if parameter.name not in without:
            sd = parameter.standard_deviation
            lower = max(parameter.minimum, parameter.value - 4.0 * sd) if parameter.value > 0 else parameter.minimum
            unknowns.append(Unknown(parameter.name, parameter.value, sd, sd, lower, parameter.maximum))
    return unknowns


def torque_unknowns(record: Record, model: Model, lag: float, ratio: float) -> list[Unknown]:
    """Return gain, offset and lateness of the drive's torque, and dry friction of motor and load about what is stated.

    ``lag``: of the drive [s]; ``ratio``: speed of the motor over that of the load.
    """
    rms = rms_behind_lag(record.u, record.step, lag)
    stated = record.u_scale_uncertainty / math.sqrt(3.0)
    spread = stated if stated > 0.0 else SCALE_SPREAD
    unknowns = [
        Unknown(SCALE, 1.0, spread, spread, 0.1, 10.0),
        Unknown(TORQUE_OFFSET, 0.0, OFFSET_SHARE * rms, 1e-3 * rms),
        Unknown(LATE, 0.0, LATE_SPREAD, 1e-4, -10.0 * LATE_SPREAD, 10.0 * LATE_SPREAD),
    ]
    for name, unit in zip(DRY, (rms, rms * abs(ratio)), strict=True):
        own = model.parameters.get(name)
        mean, deviation = (own.value, own.standard_deviation) if own is not None else (0.0, 0.0)
        spread = deviation if deviation > 0.0 else FRICTION_SHARE * unit
        unknowns.append(Unknown(name, mean, spread, 1e-3 * unit, 0.0, unit + 2.0 * mean))
    return unknowns


def sliding_speeds(record: Record, ratio: float) -> tuple[float, float]:
    """Return the speeds of motor and load [rad/s] at which their dry friction has set in."""
    angles = record.fill_missing().theta_m
    apart = max(1, min(round(0.02 / record.step), angles.size // 10))
    speed = SLIDING * rms((angles[apart:] - angles[:-apart]) / (apart * record.step))
    return max(speed, 1e-9), max(speed / abs(ratio), 1e-9)


def encoder_unknown(record: Record, model: Model, column: str) -> Unknown:
    """Return the logarithm of an encoder's noise, about that of :func:`measurement_noise`."""
    encoder, level = model.encoder(column), measurement_noise(record, model, column)
    known = encoder.noise is not None and encoder.resolution is not None and record.averaged == 1
    spread = 0.02 if known else NOISE_SPREAD
    least = max(math.log(level) - 6.0, math.log(max(rounding_noise(record, model, column), 1e-12)))
    return Unknown(f"log_noise_{column}", math.log(level), spread, 0.1, least, math.log(level) + 6.0)


def scale_noise(level: Sequence[float], units: Sequence[float]) -> tuple[float, float]:
    """Return a level of torque noise at motor and load [N.m.s^0.5] as the strength of a drive asks for."""
    return units[0] * level[0], units[1] * level[1]


def _torque_units(record: Record, lag: float, ratio: float) -> tuple[float, float]:
    """Return the rms of the drive's torque, ``lag`` [s] behind the request, over the nearest of usual drives.

    It is taken at the motor and, multiplied by the gear, at the load.
    """
    rms = rms_behind_lag(record.u, record.step, lag)
    motor, load = (
        value / min(max(value, low), high) for value, (low, high) in zip((rms, abs(ratio) * rms), DRIVES, strict=True)
    )
    return motor, load


def _initial_state(record: Record, ratio: float, torque_unit: float) -> list[Unknown]:
    """Return unknowns for the initial state, centred on a straight line through the first rows."""
    speed_m, angle_m = first_line(record.time, record.theta_m)
    if record.theta_l is not None:
        speed_l, angle_l = first_line(record.time, record.theta_l)
        spread_l = 0.02
    else:
        speed_l, angle_l, spread_l = speed_m / ratio, angle_m / ratio, 0.1
    means = (float(angle_m), float(speed_m), float(angle_l), float(speed_l), 0.0)
    spreads = (0.02, 3.0, spread_l, 1.0, 30.0 * torque_unit)
    scales = (1e-4, 1e-2, 1e-4, 1e-2, 0.1 * torque_unit)
    return [Unknown(*entry) for entry in zip(STATE_NAMES, means, spreads, scales, strict=True)]


def first_line(times: Array, values: Array) -> tuple[float, float]:
    """Return slope and value at the first row of a straight line through the first rows that are there."""
    rows = np.flatnonzero(np.isfinite(values))[:8]
    slope, start = np.polyfit(times[rows] - times[0], values[rows], 1)
    return float(slope), float(start)


def measurement_noise(record: Record, model: Model, column: str) -> float:
    """Return the standard deviation of an encoder [rad]: stated noise and rounding, else estimated from the record.

    The estimate takes the third difference of the column, in which motion hardly shows (its gain on white noise
    is sqrt(20)); rounding adds a twelfth of the squared count. What is stated of an encoder holds for its own samples,
    not for averages of them.
    """
    values, encoder = _encoder(record, model, column)
    rounding = rounding_noise(record, model, column)
    level = max(robust_noise(values), rounding) if encoder.noise is None else math.hypot(encoder.noise, rounding)
    return max(level, 1e-9)


def rounding_noise(record: Record, model: Model, column: str) -> float:
    """Return the standard deviation that rounding to counts gives an encoder's angle [rad].

    No fitted noise is smaller: while a machine rests, its rounding errors are all the same, but they do not go away.
    """
    values, encoder = _encoder(record, model, column)
    count = quantisation_step(values[np.isfinite(values)]) if encoder.resolution is None else encoder.resolution
    return count / math.sqrt(12.0)


def _encoder(record: Record, model: Model, column: str) -> tuple[Array, Encoder]:
    """Return the angles of an encoder, and what is stated of it; nothing where the angles are averages of samples."""
    values = record.theta_m if column == "theta_m" else record.theta_l
    assert values is not None
    return values, model.encoder(column) if record.averaged == 1 else Encoder()
