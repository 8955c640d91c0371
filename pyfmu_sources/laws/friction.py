"""Friction of one body, be it motor, load or axis: how large it is, when it holds, how it builds up over a distance.

In all functions: ``speed``: of the body [rad/s].
"""

from math import exp

from ..parameter_rows import BIG, TINY, Parameter, mark_linear
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


def breakaway(coulomb: float, sliding: float, static: float) -> float:
    """Return the torque [N.m] below which a part that stands still keeps standing.

    Args:
        coulomb: Coulomb friction [N.m].
        sliding: Stribeck's friction at high speed, above Coulomb's [N.m].
        static: Stribeck's friction at rest, above Coulomb's [N.m].
    """
    return coulomb + max(sliding, static)


def bristle_rate(bristle: float, speed: float, reach: float) -> float:
    """Return the rate [rad/s] of a friction bristle (Canudas de Wit et al., IEEE Trans. Automatic Control 40, 1995).

    Args:
        bristle: its bending [rad].
        speed: of the part [rad/s].
        reach: bending [rad] at which it slides, in proportion to the friction at this speed.
    """
    return speed - abs(speed) * bristle / reach if reach > 0.0 else 0.0
