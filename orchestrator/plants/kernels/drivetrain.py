"""The drivetrain's equations as the analysis takes them, and its event-located simulation.

The analysis bends its own bristles, gets a filtered request, and the last of its eight states is the shaft's memory.

In all functions: ``x``: the eight states of the analysis; ``values``: the parameters of the analysis.
"""

from math import exp
from typing import NamedTuple

from orchestrator.building.translation.kernel_arrays import Pairs, Reals
from orchestrator.plants.kernels.point import Point, travel_bound
from pyfmu_sources.drivetrain.contact import consistent_start
from pyfmu_sources.drivetrain.drivetrain import advance, has_nonlinear_effect, initial_mode, step_table
from pyfmu_sources.drivetrain.equations import (
    COUNT,
    DrivetrainParameters,
    State,
    contact_of,
    elastic_torque,
    lever_arm,
    load_friction,
    motor_friction,
    twist,
    twist_rate,
    twist_slope,
)
from pyfmu_sources.drivetrain.equations import rates as fmu_rates
from pyfmu_sources.laws.friction import rest_level, sliding_friction
from pyfmu_sources.laws.parameter_rows import BIG

__all__ = ["run"]

SETTING_IN = 4.0  # distances over which the damping of teeth sets in, after which it is all there
FIRST_SPEED, LAST_ANGLE, LAST_SPEED = 1, 2, 3


class DrivetrainAnalysis(NamedTuple):
    """The plant's parameters, and the logarithms [rad] of the distances that the analysis fits."""

    plant: DrivetrainParameters
    presliding_m: float
    presliding_l: float
    onset: float


Values = DrivetrainAnalysis


def values_of(p: Reals) -> Values:
    """Return the parameters of the analysis by name."""
    plant = DrivetrainParameters._make(p[n] for n in range(COUNT))
    return Values(plant, p[COUNT], p[COUNT + 1], p[COUNT + 2])


def whole(x: Point, u: float) -> State:
    """Return the state of the FMU's equations."""
    return (x[0], x[1], x[2], x[3], x[4], x[5], x[6], 0.0, 0.0, 0.0, x[7], u)


def friction(x: Point, values: Values) -> tuple[float, float]:
    """Return the levels of dry friction [N.m] of motor and load."""
    p = values.plant
    full = whole(x, 0.0)
    shaft = 0.0
    if p.load_dependent_friction_motor_coefficient + p.load_dependent_friction_load_coefficient > 0.0:
        contact = contact_of(twist(full, p), p.alpha) if p.alpha > 0.0 else 1
        shaft = elastic_torque(full, contact, p)
    at_motor = sliding_friction(motor_friction(p), x[1], x[0], shaft * lever_arm(full, p))
    return (at_motor, sliding_friction(load_friction(p), x[3], x[2], shaft))


def rest_levels(values: Values) -> tuple[tuple[float, float], tuple[bool, bool]]:
    """Return the levels to which distances of presliding belong, and whether each depends on more than speed."""
    p = values.plant
    at_motor = rest_level(motor_friction(p))
    at_load = rest_level(load_friction(p))
    wavy_m = p.periodic_friction_motor_amplitude
    wavy_l = p.periodic_friction_load_amplitude
    levels = (at_motor if at_motor > 0.0 else abs(wavy_m), at_load if at_load > 0.0 else abs(wavy_l))
    varies_m = p.load_dependent_friction_motor_coefficient != 0.0 or wavy_m != 0.0
    varies_l = p.load_dependent_friction_load_coefficient != 0.0 or wavy_l != 0.0
    return (levels, (varies_m, varies_l))


def reaches(values: Values) -> tuple[float, float]:
    """Return the distances [rad] over which friction of motor and load builds up."""
    return (exp(values.presliding_m), exp(values.presliding_l))


def lag_of(values: Values) -> float:
    """Return the time constant [s] of the drive."""
    return values.plant.tau


def bodies_of(values: Values) -> tuple[float, float, float]:
    """Return the inertias of the first and the last body [kg.m2] and the ratio of the gear; 0.0: there is no gear."""
    return (values.plant.J_m, values.plant.J_l, values.plant.i)


def has_flanks(values: Values) -> bool:
    """Tell whether there are teeth or end stops that can meet and part."""
    p = values.plant
    return p.alpha > 0.0 or p.end_stop_lower > -BIG or p.end_stop_upper < BIG


def meets(x: Point, rate: Point, values: Values, h: float) -> bool:
    """Tell whether any teeth or stops may meet or part within ``h`` [s]. ``rate``: of the states."""
    p = values.plant
    reach = travel_bound(x[3], rate[3], h)
    if abs(x[2] - p.end_stop_lower) < reach or abs(x[2] - p.end_stop_upper) < reach:
        return True
    if p.alpha == 0.0:
        return False
    full = whole(x, 0.0)
    slope = twist_slope(full, p)
    depth = abs(twist(full, p)) - p.alpha
    reach = travel_bound(x[1] * slope - x[3], rate[1] * slope - rate[3], h)
    return -reach < depth < reach + SETTING_IN * exp(values.onset)


def rates(x: Point, signs: tuple[float, float], values: Values, u: float) -> Point:
    """Return the rates of the states; the damping of teeth that meet grows with their penetration.

    ``signs``: mean directions of dry friction; ``u``: torque that is asked for [N.m].
    """
    p = values.plant
    full = whole(x, u)
    angle = twist(full, p)
    contact = contact_of(angle, p.alpha) if p.alpha > 0.0 else 1
    r = fmu_rates(full, contact, signs[0], signs[1], p, u, 0.0)
    motor = 0.0
    load = 0.0
    if p.alpha > 0.0 and contact != 0 and p.impact_damping_depth == 0.0:
        depth = abs(angle) - p.alpha
        lacking = p.c * twist_rate(full, p) * exp(-depth / exp(values.onset))
        motor = lacking * lever_arm(full, p) / p.J_m
        load = lacking / p.J_l
    return (r[0], r[1] + motor, r[2], r[3] - load, (u - x[4]) / p.tau, r[5], r[6], r[10])


def run(start: Reals, p: Reals, early: Reals, late: Reals, first: float, h: float, out: Pairs) -> None:
    """Fill ``out`` (n, 2), the angles, by the event-located simulation of the FMU.

    In each sample of ``h`` [s] the torque ``early`` (n,) acts for ``first`` [s], then ``late`` (n,).

    Args:
        start: (9,) the states of the analysis, and the request behind a second lag and a limited rate [N.m].
        p: parameters of the FMU.
        early: (n,) [N.m].
        late: (n,) [N.m].
        first: [s].
        h: [s].
        out: (n, 2) filled [rad].
    """
    plant = DrivetrainParameters._make(p[n] for n in range(COUNT))
    x = consistent_start((start[0], start[1], start[2], start[3], start[4], start[5], start[6], 0.0), plant)
    x = (x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], start[7], start[8])
    mode = initial_mode(x, plant)
    nonlinear = has_nonlinear_effect(plant)
    unbroken = step_table(plant, h, nonlinear)
    before = step_table(plant, max(first, 1e-9), nonlinear)
    after = step_table(plant, max(h - first, 1e-9), nonlinear)
    for n in range(len(out)):
        out[n, 0], out[n, 1] = x[0], x[2]
        if first <= 1e-9:
            x, mode = advance(x, mode, plant, late[n], 0.0, h, unbroken)
        else:
            x, mode = advance(x, mode, plant, early[n], 0.0, first, before)
            x, mode = advance(x, mode, plant, late[n], 0.0, h - first, after)
