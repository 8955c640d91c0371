"""What is unknown about a record of a train of two stages, and where each unknown is looked for."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from orchestrator.estimation.filter.model import TRAIN, BodyNames, NoiseLevels
from orchestrator.estimation.problem import (
    DRY,
    OFFSET,
    OFFSET_SPREAD,
    GapProblem,
    Unknown,
    encoder_unknown,
    first_line,
    parameter_unknowns,
    sliding_speeds,
    torque_unknowns,
)
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.arrays import Array
from orchestrator.shared.inference.noise import rms_behind_lag

GAPS = ("alpha_1", "alpha_2")
TOTAL = "alpha_total"  # both half-gaps, seen from the load: alpha_1 / i_2 + alpha_2
SHARE = "share"  # of the second stage in it
TWIST = "twist_1_start"
TORQUE = "T_m_start"
BODIES = ("motor", "middle", "load")
ENCODERS = ("theta_m", "theta_l")
# White torque noise at the motor [N.m.s^0.5], its least and largest.
LEAST_TORQUE_NOISE, LARGEST_TORQUE_NOISE = 1e-5, 30.0
# At the intermediate shaft, over the drive's torque [s^0.5]: nothing but the friction of its bearings is unknown there.
# With more, a fit far from any optimum takes its whole motion for noise.
LARGEST_AT_SHAFT = 1.5e-3
TWIST_DEVIATION = 0.03  # rad, of stage 1 at the first row
SPEED_DEVIATIONS = (3.0, 1.0)  # rad/s of motor and load at the first row


@dataclass(frozen=True)
class StagesProblem(GapProblem):
    """What is unknown about a record of a train of two stages; ``units``: the drive's rms torque at each body [N.m]."""

    row: ClassVar[BodyNames] = TRAIN
    gap: ClassVar[str] = TOTAL
    difference: ClassVar[float] = 0.3  # long, since contacts come and go
    lines: tuple[float, float, float, float]  # angle and speed of motor and load at the first row

    def parameters(self, values: Mapping[str, float]) -> Mapping[str, float]:
        """Return all parameters of the train by name, of the values of the unknowns."""
        p = {**self.base, **values}
        total, share = p[TOTAL], p[SHARE]
        return p | dict(zip(GAPS, (total * (1.0 - share) * p["i_2"], total * share), strict=True))

    def first(self, p: Mapping[str, float], noise: NoiseLevels) -> tuple[Array, Array]:
        """Return state and standard deviations at the first row: (7,) each."""
        angle_m, speed_m, angle_l, speed_l = self.lines
        ratio, (noise_m, noise_l), (fast, slow) = p["i_1"], noise.measured, SPEED_DEVIATIONS
        x0 = [angle_m, speed_m, angle_m / ratio - p[TWIST], speed_m / ratio, angle_l, speed_l, p[TORQUE]]
        spread = [noise_m, fast, 0.1 * noise_m / abs(ratio), fast / abs(ratio), noise_l, slow, 0.0]
        return np.array(x0), np.array(spread)


def make_problem(record: Record, model: Model) -> StagesProblem:
    """Return the problem of a record, which has torque and both angles, under a model of the train."""
    assert record.theta_l is not None
    base = {name: parameter.value for name, parameter in model.parameters.items()}
    unknowns = parameter_unknowns(model, {*GAPS, *DRY})
    rms = rms_behind_lag(record.u, record.step, base["tau"])
    units = (rms, rms * abs(base["i_1"]), rms * abs(base["i_1"] * base["i_2"]))
    unknowns += [
        Unknown(TOTAL, 0.0, math.inf, 1e-3, 0.0, 3.0),
        Unknown(SHARE, 0.5, math.inf, 0.1, 0.0, 1.0),
        Unknown(OFFSET, _zero_of_load(record, base["i_1"] * base["i_2"]), OFFSET_SPREAD, 1e-3),
        Unknown(TWIST, 0.0, TWIST_DEVIATION, 1e-3),
        Unknown(TORQUE, 0.0, 3.0 * rms, 0.01 * rms),
    ]
    unknowns += torque_unknowns(record, model, base["tau"], base["i_1"] * base["i_2"])
    unknowns += (encoder_unknown(record, model, name) for name in ENCODERS)
    for body, unit in zip(BODIES, units, strict=True):
        low, high = (math.log(unit / rms * level) for level in (LEAST_TORQUE_NOISE, LARGEST_TORQUE_NOISE))
        high = math.log(unit * LARGEST_AT_SHAFT) if body == "middle" else high
        unknowns.append(Unknown(f"log_torque_{body}", -7.0, math.inf, 0.5, low, high))
    speeds = [first_line(record.time, angles) for angles in (record.theta_m, record.theta_l)]
    lines = (speeds[0][1], speeds[0][0], speeds[1][1], speeds[1][0])
    outputs = np.column_stack([record.theta_m, record.theta_l])
    sliding = sliding_speeds(record, base["i_1"] * base["i_2"])
    return StagesProblem(record, tuple(unknowns), outputs, sliding, base, units, lines)


def _zero_of_load(record: Record, ratio: float) -> float:
    """Return the load's angle [rad] where its twist is in the middle of its range."""
    assert record.theta_l is not None
    low, high = np.nanquantile(record.theta_l - record.theta_m / ratio, (0.02, 0.98))
    return 0.5 * float(low + high)
