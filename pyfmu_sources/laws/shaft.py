"""The shaft and its teeth: hardening, hysteresis, damping that sets in, eccentric gears, an inertia sprung to the load.

In all functions: ``speed`` [rad/s]; ``stiffness`` [N.m/rad].
"""

from math import exp

from . import friction
from .parameter_rows import BIG, TINY, Parameter, mark_linear
from .waves import wave_rows

HARDENING = (Parameter("effects.hardening_stiffness.cubic", "N.m/rad3", 0.0, 0.0, BIG, "Cubic stiffness of the shaft"),)
ECCENTRICITY = wave_rows(
    "gear_eccentricity", "rad", "Twist error of an eccentric gear", 1.0, "Cycles per motor revolution",
    "Phase at motor angle zero",
)  # fmt: skip
RESONANCE = (
    Parameter("effects.extra_resonance.inertia", "kg.m2", 0.0, 0.0, BIG, "Inertia sprung to the load (0: none)"),
    *mark_linear(
        Parameter("effects.extra_resonance.frequency", "rad/s", 60.0, TINY, BIG, "Its natural frequency, load held"),
        Parameter("effects.extra_resonance.damping_ratio", "1", 0.02, 0.0, 100.0, "Its damping ratio, load held"),
    ),
)
TEETH = (
    *wave_rows("varying_stiffness", "1", "Relative part of the stiffness that turns with the motor", 1.0),
    Parameter("effects.shaft_hysteresis.torque", "N.m", 0.0, 0.0, BIG, "Hysteresis of the shaft (Bouc-Wen): torque"),
    *mark_linear(
        Parameter("effects.shaft_hysteresis.twist", "rad", 1e-3, TINY, BIG, "Twist over which it turns round"),
    ),
    Parameter("effects.impact_damping.depth", "rad", 0.0, 0.0, BIG, "Depth over which damping of teeth sets in"),
    *mark_linear(
        Parameter(
            "effects.gear_eccentricity.lever_arm", "1", 1.0, 0.0, 1.0, "Share of its change that the lever takes"
        ),
        Parameter(
            "effects.hardening_stiffness.sharpness", "1", 0.0, 0.0, 100.0, "Fifth power, over cubic squared by k"
        ),
    ),
)


def set_in(depth: float, onset: float) -> float:
    """Return which part (0 to 1) of the damping of teeth acts at a ``depth`` [rad], if set in over ``onset`` [rad]."""
    return 1.0 - exp(-abs(depth) / onset)


def hysteresis_rate(memory: float, rate: float, width: float) -> float:
    """Return the rate [1/s] of Bouc and Wen's hysteresis (-1 to 1), twisted at ``rate`` [rad/s] (exponent 1).

    It turns round over the twist ``width`` [rad] (Wen, J. Engineering Mechanics 102(2), 1976).
    """
    return (rate - 0.5 * abs(rate) * memory - 0.5 * rate * abs(memory)) / width


def built_up(memory: float, rate: float, width: float, time: float) -> float:
    """Return the memory of :func:`hysteresis_rate` after ``time`` [s] at a constant ``rate``: straight back to zero."""
    side = 1.0 if rate > 0.0 else -1.0
    back = -memory * side
    way = abs(rate) * time / width
    if back <= 0.0:
        return friction.built_up(memory, rate, width, time)
    return memory + side * way if way <= back else friction.built_up(0.0, side, 1.0, way - back)


def resonance_torque(angle: float, speed: float, inertia: float, frequency: float, damping_ratio: float) -> float:
    """Return the torque [N.m] that drives a sprung inertia which lags the load by ``angle`` and ``speed``.

    ``inertia``: that is sprung [kg.m2]; ``frequency``: its own, undamped [rad/s].
    """
    return inertia * frequency * (frequency * angle + 2.0 * damping_ratio * speed)


def hardening_torque(twist: float, cubic: float, stiffness: float, sharpness: float) -> float:
    """Return what a hardening stiffness adds to the torque of a shaft twisted by ``twist`` [rad].

    ``cubic * twist**3 + sharpness * cubic**2 / stiffness * twist**5``: the odd series of a stiffness that grows, to its
    third term. A cubic spring has a sharpness of 0, one that grows as the tangent does, up to a rigid end, 1.2. Without
    a stiffness of small twists there is no fifth power.
    """
    third = cubic * twist * twist * twist
    if sharpness == 0.0 or stiffness <= 0.0:
        return third
    return third * (1.0 + sharpness * cubic * twist * twist / stiffness)
