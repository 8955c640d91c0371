"""The effect terms of the drivetrain, by the site at which they act.

Each is a plain function of floats. An effect whose amplitude is zero returns exactly zero, so that a plant with
every effect off is the thesis's plant to the last bit.
"""

from math import cos, exp, sin

# --- input -------------------------------------------------------------------------------------------------


def saturated(u: float, limit: float) -> float:
    """Return the torque that a drive with a symmetric ``limit`` delivers for the request ``u`` [N.m]."""
    if u > limit:
        return limit
    if u < -limit:
        return -limit
    return u


# --- motor and load ----------------------------------------------------------------------------------------


def sliding_friction(speed: float, coulomb: float, sliding: float, breakaway: float, stribeck_speed: float) -> float:
    """Return the magnitude of dry friction [N.m] at a sliding ``speed`` [rad/s].

    Coulomb friction plus Stribeck's curve, ``sliding + (breakaway - sliding) exp(-(speed/stribeck_speed)^2)``
    (Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994, with exponent 2).
    """
    if breakaway == 0.0 and sliding == 0.0:
        return coulomb
    ratio = speed / stribeck_speed
    return coulomb + sliding + (breakaway - sliding) * exp(-ratio * ratio)


def torque_ripple(theta_m: float, amplitude: float, cycles_per_rev: float, phase: float) -> float:
    """Return the torque [N.m] that a position-dependent ripple adds at the motor angle ``theta_m`` [rad]."""
    if amplitude == 0.0:
        return 0.0
    return amplitude * sin(cycles_per_rev * theta_m + phase)


def gravity_torque(theta_l: float, amplitude: float, phase: float) -> float:
    """Return the torque against the load [N.m] of an unbalanced mass at the load angle ``theta_l`` [rad]."""
    if amplitude == 0.0:
        return 0.0
    return amplitude * sin(theta_l + phase)


def quadratic_drag(omega_l: float, coefficient: float) -> float:
    """Return the torque against the load [N.m] of a drag that grows with the square of its speed [rad/s]."""
    return coefficient * omega_l * abs(omega_l)


def directional_friction(speed: float, difference: float) -> float:
    """Return the torque against the axis [N.m] that makes its viscous friction differ by direction.

    Half of what the coefficients of the two directions differ by is ``difference`` [N.m.s/rad]: a torque
    ``b speed + difference |speed|`` is ``(b + difference) speed`` forward and ``(b - difference) speed`` backward.
    """
    return difference * abs(speed)


def resonance_torque(angle: float, speed: float, inertia: float, frequency: float, damping_ratio: float) -> float:
    """Return the torque [N.m] that drives a sprung inertia which lags the load by ``angle`` and ``speed``."""
    return inertia * frequency * (frequency * angle + 2.0 * damping_ratio * speed)


# --- shaft -------------------------------------------------------------------------------------------------


def twist_error(theta_m: float, amplitude: float, cycles_per_rev: float, phase: float) -> float:
    """Return the twist [rad] that an eccentric gear adds at the motor angle ``theta_m`` [rad]."""
    if amplitude == 0.0:
        return 0.0
    return amplitude * sin(cycles_per_rev * theta_m + phase)


def twist_error_slope(theta_m: float, amplitude: float, cycles_per_rev: float, phase: float) -> float:
    """Return the derivative of :func:`twist_error` by ``theta_m`` [rad/rad]."""
    if amplitude == 0.0:
        return 0.0
    return amplitude * cycles_per_rev * cos(cycles_per_rev * theta_m + phase)


def hardening_torque(twist: float, cubic: float) -> float:
    """Return what a cubic stiffness [N.m/rad3] adds to the torque of a shaft twisted by ``twist`` [rad]."""
    return cubic * twist * twist * twist
