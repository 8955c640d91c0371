"""What resists a body: at the load of every plant, and at a port of any FMU.

A law is a function, here or in a module of its theme, and three lines beside it: a row in ``FURTHER``, its torque in
:func:`resisted`, its number in :func:`resistance`. The first two are for plants; their tables end with ``FURTHER``. The
third is for ports, where laws are fitted by number: the loop that fits them compiles this very source, and the effect
FMU of a corrected system runs it.

This module is bound to each plant (:mod:`hybrid.binding`), whose parameters have the same names.

In all functions: ``angle`` or ``x``: of the body or port; ``speed`` or ``v``: its speed; ``z``: how far dry friction or
hysteresis has built up, -1 to 1; ``q0``, ``q1``, ``q2``: parameters of a law at a port.
"""

from typing import Any

from . import friction, shaft
from .friction import directional_friction, falling_level, quadratic_drag
from .parameter_rows import Parameter
from .stops import end_stop_torque, spring_torque
from .waves import inertia_at, inertia_torque, periodic, wave

SLOTS = ("Parameters",)
Parameters = Any

FURTHER: tuple[Parameter, ...] = (
    # Rows of further laws follow here.
)
"""Rows at the end of the table of every plant whose load a law resists."""

COULOMB, STRIBECK, QUADRATIC, VISCOUS, SPRING, HARDENING, GRAVITY, RIPPLE, LOAD, DIRECTIONAL, INERTIA = range(1, 12)
HYSTERESIS, BACKLASH, COMPLIANCE = 12, 13, 14


def resisted(against: float, angle: float, speed: float, p: Parameters) -> float:
    """Return the torque ``against`` a body [N.m] with that of all laws of one that carries the load."""
    if p.gravity_load_amplitude != 0.0 or p.quadratic_drag_coefficient != 0.0:
        gravity = periodic(angle, p.gravity_load_amplitude, 1.0, p.gravity_load_phase)
        against += gravity + quadratic_drag(speed, p.quadratic_drag_coefficient)
    if p.spring_load_stiffness != 0.0 or p.spring_load_cubic != 0.0:
        against += spring_torque(angle, p.spring_load_stiffness, p.spring_load_cubic, p.spring_load_angle)
    if angle > p.end_stop_upper or angle < p.end_stop_lower:
        against += end_stop_torque(
            angle, speed, p.end_stop_lower, p.end_stop_upper, p.end_stop_stiffness, p.end_stop_dissipation
        )
    if p.varying_inertia_amplitude != 0.0:
        against += inertia_torque(
            angle, speed, p.varying_inertia_amplitude, p.varying_inertia_cycles_per_rev, p.varying_inertia_phase
        )
    return against


def ripple(angle: float, p: Parameters) -> float:
    """Return the ripple of a drive's torque [N.m] with its harmonics at the angle of its motor [rad]."""
    cycles = p.torque_ripple_cycles_per_rev
    torque = periodic(angle, p.torque_ripple_amplitude, cycles, p.torque_ripple_phase)
    if p.torque_ripple_second_amplitude != 0.0 or p.torque_ripple_third_amplitude != 0.0:
        torque += periodic(angle, p.torque_ripple_second_amplitude, 2.0 * cycles, p.torque_ripple_second_phase)
        torque += periodic(angle, p.torque_ripple_third_amplitude, 3.0 * cycles, p.torque_ripple_third_phase)
    return torque


def inertia_of(mean: float, angle: float, p: Parameters) -> float:
    """Return the inertia [kg.m2] of the load at its angle; a wave beyond the ``mean`` leaves a thousandth of it."""
    if p.varying_inertia_amplitude == 0.0:
        return mean
    return inertia_at(
        mean, angle, p.varying_inertia_amplitude, p.varying_inertia_cycles_per_rev, p.varying_inertia_phase
    )


def resistance(kind: int, x: float, v: float, a: float, z: float, q0: float, q1: float, q2: float) -> float:
    """Return the force against the motion of a port."""
    if kind in (COULOMB, HYSTERESIS):
        return q0 * z
    if kind == STRIBECK:
        return falling_level(q0, q1 - q0, q2, v) * z
    if kind == QUADRATIC:
        return quadratic_drag(v, q0)
    if kind == VISCOUS:
        return q0 * v
    if kind == SPRING:
        return spring_torque(x, q0, 0.0, 0.0)
    if kind == HARDENING:
        return spring_torque(x, 0.0, q0, 0.0)
    if kind == GRAVITY:
        return wave(x, q0, q1, 1.0)
    if kind == RIPPLE:
        return wave(x, q0, q1, q2)
    if kind == LOAD:
        return q0
    if kind == DIRECTIONAL:
        return directional_friction(v, q0)
    return q0 * a


def has_memory(kind: int) -> bool:
    """Tell whether a law builds up over a distance (the last of its parameters)."""
    return kind in (COULOMB, STRIBECK, HYSTERESIS)


def distance_of(kind: int, q1: float, q3: float) -> float:
    """Return the distance over which a law with memory builds up; ``q3``: the fourth of its parameters."""
    return q3 if kind == STRIBECK else q1


def built_up(kind: int, z: float, v: float, distance: float, time: float) -> float:
    """Return ``z`` after ``time`` [s] at a constant speed, of dry friction or of hysteresis."""
    if kind == HYSTERESIS:
        return shaft.built_up(z, v, distance, time)
    return friction.built_up(z, v, distance, time)


def cuts(kind: int) -> bool:
    """Tell whether a law stands in a connection between two FMUs, and not at a port."""
    return kind in (BACKLASH, COMPLIANCE)


def across(kind: int, near: float, other: float, sign: float, q0: float) -> float:
    """Return the position that arrives beyond a cut.

    ``q0``: width of the gap, or how far an effort of 1 winds the spring.
    """
    if kind == COMPLIANCE:
        return near - q0 * sign * other
    between = near - other
    return near - min(max(between, -0.5 * q0), 0.5 * q0)
