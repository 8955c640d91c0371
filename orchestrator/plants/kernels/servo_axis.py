"""The single axis's equations as the analysis takes them, and its event-located simulation.

In all functions: ``x``: the eight states of the analysis; ``values``: the parameters of the analysis.
"""

from math import exp
from typing import NamedTuple

from orchestrator.building.translation.kernel_arrays import Pairs, Reals
from orchestrator.plants.kernels.point import Point, travel_bound
from pyfmu_sources.axis.axis_equations import COUNT, AxisParameters, friction_of, initial_mode, start
from pyfmu_sources.axis.axis_equations import rates as fmu_rates
from pyfmu_sources.axis.servo_axis import advance
from pyfmu_sources.laws.friction import breakaway_torque, sliding_friction
from pyfmu_sources.laws.parameter_rows import BIG

__all__ = ["run"]

LAST_ANGLE, LAST_SPEED = 0, 1


class AxisAnalysis(NamedTuple):
    """The plant's parameters, and the logarithm [rad] of the distance that the analysis fits."""

    plant: AxisParameters
    presliding: float


Values = AxisAnalysis


def values_of(p: Reals) -> Values:
    """Return the parameters of the analysis by name."""
    return Values(AxisParameters._make(p[n] for n in range(COUNT)), p[COUNT])


def friction(x: Point, values: Values) -> tuple[float, float]:
    """Return the level of dry friction [N.m], and zero."""
    return (sliding_friction(friction_of(values.plant), x[1], x[0], 0.0), 0.0)


def rest_levels(values: Values) -> tuple[tuple[float, float], tuple[bool, bool]]:
    """Return the level to which the distance of presliding belongs, and whether it depends on more than speed."""
    at_rest = breakaway_torque(friction_of(values.plant))
    wavy = values.plant.periodic_friction_motor_amplitude
    return ((at_rest if at_rest > 0.0 else abs(wavy), 0.0), (wavy != 0.0, False))


def reaches(values: Values) -> tuple[float, float]:
    """Return the distance [rad] over which friction builds up, twice."""
    reach = exp(values.presliding)
    return (reach, reach)


def lag_of(values: Values) -> float:
    """Return the time constant [s] of the drive."""
    return values.plant.tau


def bodies_of(values: Values) -> tuple[float, float, float]:
    """Return the inertia [kg.m2] twice, and 0.0: there is no gear."""
    return (values.plant.J, values.plant.J, 0.0)


def has_flanks(values: Values) -> bool:
    """Tell whether there are end stops."""
    return values.plant.end_stop_lower > -BIG or values.plant.end_stop_upper < BIG


def meets(x: Point, rate: Point, values: Values, h: float) -> bool:
    """Tell whether the axis may meet or leave a stop within ``h`` [s]. ``rate``: of the states."""
    reach = travel_bound(x[1], rate[1], h)
    return abs(x[0] - values.plant.end_stop_lower) < reach or abs(x[0] - values.plant.end_stop_upper) < reach


def rates(x: Point, signs: tuple[float, float], values: Values, u: float) -> Point:
    """Return the rates of the states.

    ``signs``: mean direction of dry friction, first; ``u``: torque that is asked for [N.m].
    """
    speed, acceleration, lag, _, _ = fmu_rates((x[0], x[1], x[4], 0.0, u), signs[0], values.plant, u, 0.0)
    return (speed, acceleration, 0.0, 0.0, lag, 0.0, 0.0, 0.0)


def run(begin: Reals, p: Reals, early: Reals, late: Reals, first: float, h: float, out: Pairs) -> None:
    """Fill ``out`` (n, 2), the angles, as ``run`` of the drivetrain's kernels does, from ``begin`` (9,)."""
    plant = AxisParameters._make(p[n] for n in range(COUNT))
    x = start(begin[0], begin[1], begin[4], plant)
    x = (x[0], x[1], x[2], x[3], begin[8])
    mode = initial_mode(x, plant, early[0])
    for n in range(len(out)):
        out[n, 0], out[n, 1] = x[0], 0.0
        if first > 1e-9:
            x, mode = advance(x, mode, plant, early[n], 0.0, first)
        x, mode = advance(x, mode, plant, late[n], 0.0, h - first)
