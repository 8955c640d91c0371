"""Laws of effects that act around an FMU: a force against the motion at its ports, a gap or a spring between two.

Each is a plain function of floats. The loop that fits them compiles this very source; the effect FMU of a corrected
system runs it. ``x`` and ``v`` are position and speed of the port, in the middle of a step.
"""

from math import cos, exp, sin

COULOMB, STRIBECK, QUADRATIC, VISCOUS, SPRING, HARDENING, GRAVITY, RIPPLE, LOAD, DIRECTIONAL, INERTIA = range(1, 12)
HYSTERESIS, BACKLASH, COMPLIANCE = 12, 13, 14


def built_up(kind: int, z: float, v: float, distance: float, time: float) -> float:
    """Return how far dry friction or hysteresis has built up (-1 to 1) after ``time`` at speed ``v``.

    Friction by Dahl's law, ``dz/dt = (v - |v| z)/distance``; hysteresis by that of Bouc and Wen,
    ``dz/dt = (v - (|v| z + v |z|)/2)/distance``: a straight way back to zero. Both are solved exactly for a constant
    speed.

    Args:
        z: at the beginning, -1 to 1.
        time: [s].
    """
    if v == 0.0:
        return z
    end = 1.0 if v > 0.0 else -1.0
    way = abs(v) * time / distance
    if kind == HYSTERESIS and z * end < 0.0:
        back = -z * end
        if way <= back:
            return z + end * way
        z, way = 0.0, way - back
    return end + (z - end) * exp(-way)


def has_memory(kind: int) -> bool:
    """Tell whether a law builds up over a distance (the last of its parameters)."""
    return kind in (COULOMB, STRIBECK, HYSTERESIS)


def distance_of(kind: int, q1: float, q3: float) -> float:
    """Return the distance over which a law with memory builds up. ``q1``: second parameter of the law."""
    return q3 if kind == STRIBECK else q1


def resistance(kind: int, x: float, v: float, a: float, z: float, q0: float, q1: float, q2: float) -> float:
    """Return the force against the motion. ``z``: how far dry friction or hysteresis has built up, -1 to 1."""
    if kind in (COULOMB, HYSTERESIS):
        return q0 * z
    if kind == STRIBECK:
        ratio = v / q2
        return (q0 + (q1 - q0) * exp(-ratio * ratio)) * z
    if kind == QUADRATIC:
        return q0 * v * abs(v)
    if kind == VISCOUS:
        return q0 * v
    if kind == SPRING:
        return q0 * x
    if kind == HARDENING:
        return q0 * x * x * x
    if kind == GRAVITY:
        return q0 * sin(x) + q1 * cos(x)
    if kind == RIPPLE:
        return q0 * sin(q2 * x) + q1 * cos(q2 * x)
    if kind == LOAD:
        return q0
    if kind == DIRECTIONAL:
        return q0 * abs(v)
    return q0 * a


def cuts(kind: int) -> bool:
    """Tell whether a law stands in a connection between two FMUs, and not at a port."""
    return kind in (BACKLASH, COMPLIANCE)


def across(kind: int, near: float, other: float, sign: float, q0: float) -> float:
    """Return the position that arrives beyond a cut.

    Args:
        q0: width of the gap, or how far an effort of 1 winds the spring.
    """
    if kind == COMPLIANCE:
        return near - q0 * sign * other
    between = near - other
    return near - min(max(between, -0.5 * q0), 0.5 * q0)
