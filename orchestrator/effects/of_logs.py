"""Nuisances of measurement: what a log does to signals. Fitted like effects, reported beside them, part of no FMU."""

import numpy as np
from numpy.typing import NDArray

from orchestrator.effects.effect import BOTH_PLANTS, DRIVETRAIN, Effect, SignalScales
from pyfmu_sources.laws.parameter_rows import Parameter

LEAD = Parameter("measurement.lead", "s", 0.0, 0.0, 1.0, "Time by which torques act before their stamp")
SHIFT = Parameter("measurement.shift", "s", 0.0, -1.0, 1.0, "Time by which the load's angle is stamped later")

SAMPLED = Parameter(
    "measurement.sampled", "1", 0.0, 0.0, 1.0, "Way from a torque that is held between its own rows to a smooth one"
)


def eccentricity(body: str) -> tuple[Parameter, Parameter]:
    """Return amplitude and phase of what the encoder of a ``body`` adds to its angle once a turn."""
    name = f"measurement.{body}_eccentricity"
    return (
        Parameter(f"{name}.amplitude", "rad", 0.0, 0.0, 1.0, "Amplitude of an encoder's error once a turn"),
        Parameter(f"{name}.phase", "rad", 0.0, -np.pi, np.pi, "Its phase: amplitude * sin(angle + phase) is added"),
    )


LEAST_TURN = 0.3  # of an encoder, from which its error once a turn is told from a zero and a gear ratio that are off
MOST_ECCENTRIC = 0.1  # rad: an encoder that is farther off its centre is broken
CYCLES = 8.0  # of the log by which a drive, or a stamp, may be late: what takes longer is no dead time but dynamics
FRAME = 0.02  # s: cycle of the slowest servo buses, however fast the log


def longest_lag(scales: SignalScales) -> float:
    """Return the longest time constant [s] of a drive that is not taken for its neighbour."""
    return 1.2 / scales.cutoff


def longest_time(scales: SignalScales) -> float:
    """Return the longest dead time [s]: cycles of the log, and no longer than the motion tells it from dynamics."""
    return min(max(CYCLES * scales.cycle, FRAME), longest_lag(scales))


def times(scales: SignalScales, top: float) -> tuple[float, ...]:
    """Return times [s] to try of what is late or slow, up to ``top``."""
    return tuple(float(t) for t in np.geomspace(max(0.3 * scales.step, top / 60.0), top, 9))


def is_within(time: float, scales: SignalScales, top: float) -> bool:
    """Tell whether a time [s] is no whim of the rows, and does not stand at its bound ``top``, where it is none."""
    return bool(max(0.15 * scales.step, scales.torque_raster) < abs(time) < 0.95 * top)


EARLY_TORQUE = Effect(
    "early_torque", "log", "timing", {"lead": LEAD.name}, "lead", lambda s: {"lead": 0.3 * s.step},
    lambda s: {"lead": times(s, longest_time(s))}, bounds=lambda s: {"lead": (0.0, longest_time(s))},
    possible=lambda v, s: is_within(v["lead"], s, longest_time(s)), measurement=True, plants=BOTH_PLANTS,
)  # fmt: skip
LATE_LOAD = Effect(
    "late_load", "log", "timing", {"shift": SHIFT.name}, "shift", lambda s: {"shift": 0.3 * s.step},
    lambda s: {"shift": tuple(sign * t for t in times(s, longest_time(s))[::2] for sign in (1.0, -1.0))},
    bounds=lambda s: {"shift": (-longest_time(s), longest_time(s))},
    possible=lambda v, s: abs(v["shift"]) < 0.95 * longest_time(s), both_encoders=True, measurement=True,
)  # fmt: skip


def _eccentric_encoder(body: str, plants: tuple[str, ...]) -> Effect:
    amplitude, phase = eccentricity(body)
    return Effect(
        f"{body}_encoder_eccentricity", "log", "encoder", {"amplitude": amplitude.name, "phase": phase.name},
        "amplitude", lambda s: {"amplitude": s.resolutions[body]}, amplitudes=("amplitude",), phase="phase",
        possible=lambda v, s: v["amplitude"] < MOST_ECCENTRIC, angular=True, both_encoders=body == "load",
        shown=lambda s: float(np.ptp(s.angles[body])) > 2.0 * np.pi * LEAST_TURN, measurement=True, plants=plants,
    )  # fmt: skip


ECCENTRIC_ENCODERS = (_eccentric_encoder("motor", BOTH_PLANTS), _eccentric_encoder("load", (DRIVETRAIN,)))


def centre_angle(angle: NDArray[np.float64], amplitude: float, phase: float) -> NDArray[np.float64]:
    """Return the angle (n,) [rad] of a body whose encoder adds ``amplitude * sin(angle + phase)`` to it."""
    found = angle
    for _ in range(4 if amplitude else 0):  # each time nearer by a factor of the amplitude
        found = angle - amplitude * np.sin(found + phase)
    return found


SAMPLED_TORQUE = Effect(
    "sampled_torque", "log", "sampling", {"share": SAMPLED.name}, "share", lambda s: {"share": 0.5},
    amplitudes=("share",), signed=False, bounds=lambda s: {"share": (0.0, 1.0)}, measurement=True,
    shown=lambda s: s.torque_raster > 0.0, plants=BOTH_PLANTS,
)  # fmt: skip
