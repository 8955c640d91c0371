"""Friction of one body, be it motor, load or axis: how large it is, when it holds, how it builds up over a distance.

Sources: Stribeck's curve as in Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica 30(7), 1994, with exponent 2.
The bristle is Dahl's and LuGre's (Canudas de Wit, Olsson, Astrom and Lischinsky, IEEE Trans. Automatic Control 40(3),
1995): the torque is ``stiffness z + damping z'`` with ``z' = v - |v| z / reach(v)``, where ``reach(v) = distance
friction(v) / breakaway`` and ``stiffness = breakaway / distance``. Friction that grows with the torque that is carried
builds up at this stiffness, too, with 1 N.m of it in the breakaway; where there is no other, it is set-valued, for its
reach goes to zero with that torque. Once its bristle has settled, a body slides at the friction of its speed, without
the stiff equation of the bristle, until it slows down.

In all functions: ``speed`` [rad/s] and ``angle`` [rad] of the body; ``carried``: torque [N.m] that its bearing or its
teeth carry; ``bristle``: its bending [rad]; ``slip``: direction in which it slides; 0: it sticks, or its bristle bends.
"""

from math import exp
from typing import NamedTuple

from .parameter_rows import BIG, TINY, Parameter, mark_linear
from .waves import periodic, wave_rows


def coulomb_rows(site: str, text: str) -> tuple[Parameter, ...]:
    """Return the row of Coulomb friction."""
    return (Parameter(f"effects.coulomb_friction.{site}.torque", "N.m", 0.0, 0.0, BIG, text),)


def stribeck_rows(site: str, of: str) -> tuple[Parameter, ...]:
    """Return the rows of Stribeck's friction; ``of`` follows what each is, such as " of the motor"."""
    name = f"effects.stribeck_friction.{site}"
    return (
        Parameter(f"{name}.coulomb", "N.m", 0.0, 0.0, BIG, f"Sliding friction{of}"),
        Parameter(f"{name}.breakaway", "N.m", 0.0, 0.0, BIG, f"Breakaway friction{of}"),
        *mark_linear(Parameter(f"{name}.stribeck_speed", "rad/s", 1.0, TINY, BIG, f"Stribeck speed{of}")),
    )


def directional_rows(site: str, text: str) -> tuple[Parameter, ...]:
    """Return the row of friction that depends on the direction."""
    return (Parameter(f"effects.directional_friction.{site}.difference", "N.m.s/rad", 0.0, -BIG, BIG, text),)


def presliding_rows(site: str, distance: str, damping: str) -> tuple[Parameter, ...]:
    """Return the rows of friction that builds up."""
    return mark_linear(
        Parameter(f"effects.presliding.{site}.distance", "rad", 0.0, 0.0, BIG, distance),
        Parameter(f"effects.presliding.{site}.damping", "N.m.s/rad", 0.0, 0.0, BIG, damping),
    )


def detail_rows(site: str) -> tuple[Parameter, ...]:
    """Return what the friction of a ``site`` may depend on beside its speed."""
    of = f"of the {site}'s friction"
    return (
        *presliding_rows(site, f"Distance {of} to build up (0: none)", f"Damping {of} building up"),
        *directional_rows(site, f"Viscous part {of}, forward minus mean"),
        Parameter(f"effects.load_dependent_friction.{site}.coefficient", "1", 0.0, 0.0, 1.0,
                  f"Part {of} per torque of the shaft"),
        *wave_rows(f"periodic_friction.{site}", "N.m", f"Part {of} that repeats with the angle", 1.0),
    )  # fmt: skip


def drag_rows(text: str) -> tuple[Parameter, ...]:
    """Return the row of a drag that grows with the square of the speed."""
    return (Parameter("effects.quadratic_drag.coefficient", "N.m.s2/rad2", 0.0, 0.0, BIG, text),)


def quadratic_drag(speed: float, coefficient: float) -> float:
    """Return the torque against a body [N.m] of a drag: ``coefficient`` [N.m.s2/rad2] by speed squared."""
    return coefficient * speed * abs(speed)


def directional_friction(speed: float, difference: float) -> float:
    """Return the torque against the axis [N.m] that makes its viscous friction differ by direction.

    Half of what the coefficients of the two directions differ by is ``difference`` [N.m.s/rad]: a torque
    ``b speed + difference |speed|`` is ``(b + difference) speed`` forward and ``(b - difference) speed`` backward.
    """
    return difference * abs(speed)


class BodyFriction(NamedTuple):
    """The parameters of one body's dry friction, in the order of their rows; ``distance`` 0: it does not build up."""

    coulomb: float
    sliding: float
    breakaway: float
    stribeck_speed: float
    distance: float
    damping: float
    coefficient: float
    amplitude: float
    cycles: float
    phase: float


# A bristle has settled when it is this near to its reach.
SETTLED = 1e-6
# Where friction falls with speed, a bristle follows its reach with a lag: it counts as settled so near to it where its
# equation is quicker than this [1/s]; beyond these many Stribeck speeds friction falls no more.
SETTLED_FALLING = 0.02
QUICKEST = 5e3
FALLEN = 4.0
# Faster than it was left, so that no part goes to and fro between both ways of computing it.
ENTER = 1.2
LEAST_SPEED = 1e-9


def sliding_friction(f: BodyFriction, speed: float, angle: float, carried: float) -> float:
    """Return the magnitude of dry friction [N.m] of a body that slides."""
    if f.breakaway == 0.0 and f.sliding == 0.0:
        return with_dependence(f, f.coulomb, angle, carried)
    level = falling_level(f.coulomb + f.sliding, f.breakaway - f.sliding, f.stribeck_speed, speed)
    return with_dependence(f, level, angle, carried)


def falling_level(sliding: float, more: float, stribeck_speed: float, speed: float) -> float:
    """Return the level of friction [N.m] that falls with speed: at rest it is ``more`` than when ``sliding``."""
    ratio = speed / stribeck_speed
    return sliding + more * exp(-ratio * ratio)


def with_dependence(f: BodyFriction, level: float, angle: float, carried: float) -> float:
    """Return a ``level`` of dry friction [N.m] with what depends on torque and angle, never below zero."""
    if f.coefficient == 0.0 and f.amplitude == 0.0:
        return level
    return max(0.0, level + f.coefficient * abs(carried) + periodic(angle, f.amplitude, f.cycles, f.phase))


def breakaway_torque(f: BodyFriction) -> float:
    """Return the torque [N.m] below which a body at rest stays there, without what depends on torque and angle."""
    return f.coulomb + max(f.sliding, f.breakaway)


def capacity(f: BodyFriction, angle: float, carried: float) -> float:
    """Return the torque [N.m] below which a body at rest stays there."""
    return with_dependence(f, breakaway_torque(f), angle, carried)


def is_dry(f: BodyFriction) -> bool:
    """Tell whether a body has dry friction."""
    return f.coulomb + f.sliding + f.breakaway + f.coefficient + abs(f.amplitude) > 0.0


def rest_level(f: BodyFriction) -> float:
    """Return the breakaway torque [N.m] at 1 N.m that is carried, without what depends on the angle."""
    return breakaway_torque(f) + f.coefficient


def builds_up(f: BodyFriction) -> bool:
    """Tell whether friction builds up over a distance; what only the carried torque makes is set-valued."""
    return f.distance > 0.0 and breakaway_torque(f) > 0.0


def falls(f: BodyFriction) -> bool:
    """Tell whether friction depends on the speed."""
    return f.sliding != f.breakaway


def leaving_speed(f: BodyFriction) -> float:
    """Return the speed [rad/s] below which the bristle of a body that slides must be followed; 0: it has none."""
    return min(FALLEN * f.stribeck_speed, QUICKEST * f.distance) if falls(f) and builds_up(f) else 0.0


def reach(f: BodyFriction, speed: float, angle: float, carried: float) -> float:
    """Return the bending [rad] at which the bristle slides."""
    return f.distance * sliding_friction(f, speed, angle, carried) / rest_level(f)


def start_bristle(f: BodyFriction, speed: float, angle: float, carried: float) -> float:
    """Return the bristle as a simulation starts: that of a body that moves has settled."""
    if speed == 0.0 or not builds_up(f):
        return 0.0
    far = reach(f, speed, angle, carried)
    return far if speed > 0.0 else -far


def bristle_sign(
    f: BodyFriction, slip: int, bristle: float, speed: float, angle: float, carried: float
) -> tuple[float, float]:
    """Return the direction of friction, -1 to 1 without damping, and the rate of the bristle [rad/s]."""
    if slip != 0 or not builds_up(f):
        return (float(slip), 0.0)
    far = reach(f, speed, angle, carried)
    if far <= 0.0:
        return (0.0, 0.0)
    rate = speed - abs(speed) * bristle / far
    return ((bristle + f.damping / (rest_level(f) / f.distance) * rate) / far, rate)


def bristle_slip(f: BodyFriction, slip: int, bristle: float, speed: float, angle: float, carried: float) -> int:
    """Return the direction of sliding, which is that of the speed once the bristle has settled at its reach."""
    if slip != 0 or not builds_up(f):
        return slip
    far = reach(f, speed, angle, carried)
    if abs(speed) < max(LEAST_SPEED, ENTER * leaving_speed(f)) or far <= 0.0:
        return 0
    side = 1 if speed > 0.0 else -1
    near = SETTLED_FALLING if falls(f) and abs(speed) > QUICKEST * far else SETTLED
    return side if abs(side * bristle - far) <= near * far else 0


def built_up(z: float, v: float, distance: float, time: float) -> float:
    """Return the share ``z`` (-1 to 1) of its reach that a bristle is bent by, after ``time`` [s] at a constant speed.

    Dahl's law, ``z' = (v - |v| z) / distance``, solved exactly; ``v`` [rad/s].
    """
    if v == 0.0:
        return z
    end = 1.0 if v > 0.0 else -1.0
    return end + (z - end) * exp(-abs(v) * time / distance)
