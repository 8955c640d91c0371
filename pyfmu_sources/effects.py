"""The effect terms of the drivetrain, by the site at which they act.

Each is a plain function of floats. An effect whose amplitude is zero returns exactly zero, so that a plant with
every effect off is the thesis's plant to the last bit.

In all functions: ``angle`` [rad]; ``speed`` [rad/s]; ``phase``: at angle zero [rad]; ``stiffness`` [N.m/rad];
``cubic`` [N.m/rad3].
"""

from math import cos, exp, sin

LARGEST = 1.7976931348623157e308


def sine(angle: float) -> float:
    """Return the sine, and 0 for an angle that is not finite: a trial step that overflows is refused, not raised."""
    return sin(angle) if abs(angle) <= LARGEST else 0.0


def cosine(angle: float) -> float:
    """Return the cosine, and 0 for an angle that is not finite."""
    return cos(angle) if abs(angle) <= LARGEST else 0.0


# --- motor and load ----------------------------------------------------------------------------------------


def sliding_friction(speed: float, coulomb: float, sliding: float, breakaway: float, stribeck_speed: float) -> float:
    """Return the magnitude of dry friction [N.m] at a sliding ``speed`` [rad/s].

    Coulomb friction plus Stribeck's curve, ``sliding + (breakaway - sliding) exp(-(speed/stribeck_speed)^2)``
    (Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994, with exponent 2).

    Args:
        coulomb: Coulomb friction [N.m].
        sliding: Stribeck's part at high speed [N.m].
        breakaway: Stribeck's part at rest [N.m].
        stribeck_speed: [rad/s].
    """
    if breakaway == 0.0 and sliding == 0.0:
        return coulomb
    ratio = speed / stribeck_speed
    return coulomb + sliding + (breakaway - sliding) * exp(-ratio * ratio)


def periodic(angle: float, amplitude: float, cycles_per_rev: float, phase: float) -> float:
    """Return ``amplitude sin(cycles_per_rev angle + phase)``, in the unit of the amplitude."""
    if amplitude == 0.0:
        return 0.0
    return amplitude * sine(cycles_per_rev * angle + phase)


def periodic_slope(angle: float, amplitude: float, cycles_per_rev: float, phase: float) -> float:
    """Return the derivative of :func:`periodic` by the angle, in the unit of the amplitude a radian."""
    if amplitude == 0.0:
        return 0.0
    return amplitude * cycles_per_rev * cosine(cycles_per_rev * angle + phase)


def periodic_curvature(angle: float, amplitude: float, cycles_per_rev: float, phase: float) -> float:
    """Return the second derivative of :func:`periodic` by the angle, in the unit of the amplitude a radian squared."""
    if amplitude == 0.0:
        return 0.0
    return -amplitude * cycles_per_rev * cycles_per_rev * sine(cycles_per_rev * angle + phase)


def dependent_friction(
    level: float, transmitted: float, coefficient: float, angle: float, amplitude: float, cycles: float, phase: float
) -> float:
    """Return the magnitude of dry friction [N.m] that depends on load torque and on position, never below zero.

    Args:
        level: its magnitude [N.m] without both.
        transmitted: torque [N.m] that the bearing or the teeth carry.
        angle: of the part [rad].
        amplitude: of what repeats with the angle [N.m].
        phase: its phase at angle zero [rad].
    """
    return max(0.0, level + coefficient * abs(transmitted) + periodic(angle, amplitude, cycles, phase))


def spring_torque(angle: float, stiffness: float, cubic: float, rest: float) -> float:
    """Return the torque [N.m] against a part of a spring or a cable that is at rest at the angle ``rest`` [rad]."""
    if stiffness == 0.0 and cubic == 0.0:
        return 0.0
    way = angle - rest
    return stiffness * way + cubic * way * way * way


def end_stop_torque(
    angle: float, speed: float, lower: float, upper: float, stiffness: float, dissipation: float
) -> float:
    """Return the torque [N.m] against a part of two end stops (Hunt and Crossley, J. Applied Mechanics 42(2), 1975).

    Inside the stop by ``d`` and moving further in with ``v`` the stop pushes back by
    ``stiffness d (1 + dissipation v)``; it never pulls.

    Args:
        lower: angle of the lower stop [rad].
        upper: angle of the upper stop [rad].
        dissipation: [s/rad].
    """
    if angle > upper:
        return max(0.0, stiffness * (angle - upper) * (1.0 + dissipation * speed))
    if angle < lower:
        return min(0.0, stiffness * (angle - lower) * (1.0 - dissipation * speed))
    return 0.0


def set_in(depth: float, onset: float) -> float:
    """Return which part (0 to 1) of the damping of teeth acts at a ``depth`` [rad], if set in over ``onset`` [rad]."""
    return 1.0 - exp(-abs(depth) / onset)


def hysteresis_rate(memory: float, rate: float, width: float) -> float:
    """Return the rate [1/s] of Bouc and Wen's hysteresis (-1 to 1), twisted at ``rate`` [rad/s] (exponent 1).

    It turns round over the twist ``width`` [rad] (Wen, J. Engineering Mechanics 102(2), 1976).

    Args:
        memory: of the hysteresis, -1 to 1.
        rate: of the twist [rad/s].
        width: [rad].
    """
    return (rate - 0.5 * abs(rate) * memory - 0.5 * rate * abs(memory)) / width


# --- friction that builds up -------------------------------------------------------------------------------


def bristle_rate(bristle: float, speed: float, reach: float) -> float:
    """Return the rate [rad/s] of a friction bristle (Canudas de Wit et al., IEEE Trans. Automatic Control 40, 1995).

    Args:
        bristle: its bending [rad].
        speed: of the part [rad/s].
        reach: bending [rad] at which it slides, in proportion to the friction at this speed.
    """
    return speed - abs(speed) * bristle / reach if reach > 0.0 else 0.0


# --- drive -------------------------------------------------------------------------------------------------


def quadratic_drag(omega_l: float, coefficient: float) -> float:
    """Return the torque against the load [N.m] of a drag: ``coefficient`` [N.m.s2/rad2] by speed [rad/s] squared."""
    return coefficient * omega_l * abs(omega_l)


def directional_friction(speed: float, difference: float) -> float:
    """Return the torque against the axis [N.m] that makes its viscous friction differ by direction.

    Half of what the coefficients of the two directions differ by is ``difference`` [N.m.s/rad]: a torque
    ``b speed + difference |speed|`` is ``(b + difference) speed`` forward and ``(b - difference) speed`` backward.
    """
    return difference * abs(speed)


def resonance_torque(angle: float, speed: float, inertia: float, frequency: float, damping_ratio: float) -> float:
    """Return the torque [N.m] that drives a sprung inertia which lags the load by ``angle`` and ``speed``.

    Args:
        inertia: that is sprung [kg.m2].
        frequency: its own, undamped [rad/s].
    """
    return inertia * frequency * (frequency * angle + 2.0 * damping_ratio * speed)


# --- shaft -------------------------------------------------------------------------------------------------


def hardening_torque(twist: float, cubic: float, stiffness: float, sharpness: float) -> float:
    """Return what a hardening stiffness adds to the torque of a shaft twisted by ``twist`` [rad].

    ``cubic * twist**3 + sharpness * cubic**2 / stiffness * twist**5``: the odd series of a stiffness that grows, to its
    third term. A cubic spring has a sharpness of 0, one that grows as the tangent does, up to a rigid end, 1.2.

    Args:
        twist: [rad].
        stiffness: of small twists [N.m/rad]; without one there is no fifth power.
        sharpness: [1].
    """
    third = cubic * twist * twist * twist
    if sharpness == 0.0 or stiffness <= 0.0:
        return third
    return third * (1.0 + sharpness * cubic * twist * twist / stiffness)
