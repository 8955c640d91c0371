"""What is unknown about a record of a train of two stages, and where each unknown is looked for."""

import math
from dataclasses import dataclass

import numpy as np

from orchestrator.estimation.innovations import Array
from orchestrator.estimation.problem import NOISE_SPREAD, OFFSET_SPREAD, Unknown, measurement_noise, rounding_noise
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.inference.noise import rms_behind_lag

GAPS = ("alpha_1", "alpha_2")
TOTAL = "alpha_total"  # both half-gaps, seen from the load: alpha_1 / i_2 + alpha_2
SHARE = "share"  # of the second stage in it
OFFSET = "zero_of_load"
LATE = "torque_late"
DRY = ("friction_motor", "friction_load")
TWIST = "twist_1_start"
TORQUE = "T_m_start"
SCALE = "u_scale"
BODIES = ("motor", "middle", "load")
ENCODERS = ("theta_m", "theta_l")
# White torque noise at the motor [N.m.s^0.5], its least and largest.
LEAST_TORQUE_NOISE, LARGEST_TORQUE_NOISE = 1e-5, 30.0
# At the intermediate shaft, over the drive's torque [s^0.5]: nothing but the friction of its bearings is unknown there.
# With more, a fit far from any optimum takes its whole motion for noise.
LARGEST_AT_SHAFT = 1.5e-3
LATE_DEVIATION = 3e-3  # s, of the torque, before anything is known
TWIST_DEVIATION = 0.03  # rad, of stage 1 at the first row
SPEED_DEVIATIONS = (3.0, 1.0)  # rad/s of motor and load at the first row


@dataclass(frozen=True)
class StagesProblem:
    """A record and what is unknown about it.

    Attributes:
        base: parameters of the model by name.
        unknowns: every unknown, in the order of the vector; free or not is decided per fit.
        outputs: (n, 2) measured angles [rad].
        first: (4,) angles and speeds of motor and load at the first row.
        units: torque [N.m] of the drive at motor, intermediate inertia and load: its rms times the gears.
    """

    record: Record
    base: dict[str, float]
    unknowns: tuple[Unknown, ...]
    outputs: Array
    first: tuple[float, float, float, float]
    units: tuple[float, float, float]

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


def make_problem(record: Record, model: Model) -> StagesProblem:
    """Return the problem of a record, which has torque and both angles, under a model of the train."""
    assert record.theta_l is not None
    base = {name: parameter.value for name, parameter in model.parameters.items()}
    unknowns = []
    for parameter in model.uncertain:
        if parameter.name in GAPS:
            continue
        sd = parameter.standard_deviation
        lower = max(parameter.minimum, parameter.value - 4.0 * sd) if parameter.value > 0 else parameter.minimum
        unknowns.append(Unknown(parameter.name, parameter.value, sd, sd, lower, parameter.maximum))
    rms = rms_behind_lag(record.u, record.step, base["tau"])
    units = (rms, rms * abs(base["i_1"]), rms * abs(base["i_1"] * base["i_2"]))
    unknowns += [
        Unknown(TOTAL, 0.0, math.inf, 1e-3, 0.0, 3.0),
        Unknown(SHARE, 0.5, math.inf, 0.1, 0.0, 1.0),
        Unknown(OFFSET, _zero_of_load(record, base["i_1"] * base["i_2"]), OFFSET_SPREAD, 1e-3),
        Unknown(LATE, 0.0, LATE_DEVIATION, 1e-4, -10.0 * LATE_DEVIATION, 10.0 * LATE_DEVIATION),
        *(Unknown(name, 0.0, 0.3 * unit, 0.01 * unit, 0.0, unit) for name, unit in zip(DRY, units[::2], strict=True)),
        Unknown(TWIST, 0.0, TWIST_DEVIATION, 1e-3),
        Unknown(TORQUE, 0.0, 3.0 * rms, 0.01 * rms),
    ]
    if record.u_scale_uncertainty > 0.0:
        spread = record.u_scale_uncertainty / math.sqrt(3.0)
        unknowns.append(Unknown(SCALE, 1.0, spread, spread, 0.1, 10.0))
    noise = {column: measurement_noise(record, model, column) for column in ENCODERS}
    for column, level in noise.items():
        encoder = model.encoder(column)
        known = encoder.noise is not None and encoder.resolution is not None and record.averaged == 1
        least = max(math.log(level) - 6.0, math.log(max(rounding_noise(record, model, column), 1e-12)))
        spread = 0.02 if known else NOISE_SPREAD
        unknowns.append(Unknown(f"log_noise_{column}", math.log(level), spread, 0.1, least, math.log(level) + 6.0))
    for body, unit in zip(BODIES, units, strict=True):
        low, high = (math.log(unit / rms * level) for level in (LEAST_TORQUE_NOISE, LARGEST_TORQUE_NOISE))
        high = math.log(unit * LARGEST_AT_SHAFT) if body == "middle" else high
        unknowns.append(Unknown(f"log_torque_{body}", -7.0, math.inf, 0.5, low, high))
    speeds = [_first_line(record.time, angles) for angles in (record.theta_m, record.theta_l)]
    first = (speeds[0][1], speeds[0][0], speeds[1][1], speeds[1][0])
    outputs = np.column_stack([record.theta_m, record.theta_l])
    return StagesProblem(record, base, tuple(unknowns), outputs, first, units)


def _zero_of_load(record: Record, ratio: float) -> float:
    """Return the load's angle [rad] where its twist is in the middle of its range."""
    assert record.theta_l is not None
    low, high = np.nanquantile(record.theta_l - record.theta_m / ratio, (0.02, 0.98))
    return 0.5 * float(low + high)


def _first_line(times: Array, values: Array) -> tuple[float, float]:
    """Return slope and value at the first row of a straight line through the first rows that are there."""
    rows = np.flatnonzero(np.isfinite(values))[:8]
    slope, start = np.polyfit(times[rows] - times[0], values[rows], 1)
    return float(slope), float(start)
