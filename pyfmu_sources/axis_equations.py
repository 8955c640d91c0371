"""A single axis: one inertia behind the torque lag of its drive, with the effects of input, motor and sensor.

State ``x = (position, speed, drive, bristle, request)``: position [rad or m], its speed, the drive's torque or force
[N.m or N], the bristle of friction that builds up [rad or m], the filtered request [N.m or N].
An axis is as well a motor with its load (rad, kg.m2, N.m) as a carriage on a screw (m, kg, N): the equations are the
same, the model file states the unit.

::

    J speed' = drive + ripple(position) - b speed - sign(speed) friction(|speed|) - drag speed |speed|
               - difference |speed| - load_torque - gravity(position) - spring(position) - stops(position, speed) - T_l
    tau drive' = u - drive          (tau = 0: drive = u)

In all functions: ``u``: requested torque [N.m], delayed and saturated already; ``T_l``: load torque [N.m].
"""

from typing import TYPE_CHECKING, Any, NamedTuple

from .laws import drive, stops, waves
from .laws import friction as friction_laws
from .laws.bristles import bent_sign, has_settled, leaving_speed
from .laws.drive import UNASKED, request_rate
from .laws.friction import (
    breakaway,
    bristle_rate,
    dependent_friction,
    directional_friction,
    quadratic_drag,
    sliding_friction,
)
from .laws.stops import end_stop_torque, spring_torque
from .laws.waves import inertia_at, inertia_torque, periodic
from .parameter_rows import BIG, TINY, Parameter, field_name, mark_linear

PARAMETERS = (
    *mark_linear(
        Parameter("J", "kg.m2", 1.0, TINY, BIG, "Inertia (or mass)"),
        Parameter("b", "N.m.s/rad", 1.0, 0.0, BIG, "Viscous friction"),
        Parameter("tau", "s", 0.0, 0.0, BIG, "Time constant of the drive's torque (0: none)"),
    ),
    *drive.INPUT,
    *waves.ripple_rows("Amplitude of the ripple", "Ripple, rad of phase per unit of position", "position"),
    *friction_laws.coulomb_rows("motor", "Dry friction"),
    *friction_laws.stribeck_rows("motor", ""),
    *drive.load_rows("axis"),
    *waves.gravity_rows("position"),
    *friction_laws.drag_rows("Drag"),
    *friction_laws.directional_rows("motor", "Viscous friction, forward minus b"),
    *drive.encoder_rows("motor", "encoder"),
    *friction_laws.presliding_rows(
        "motor", "Distance of friction to build up (0: none)", "Damping of friction building up"
    ),
    *waves.wave_rows("periodic_friction.motor", "N.m", "Part of dry friction that repeats with the position", 1.0),
    *drive.REQUEST,
    *waves.HARMONICS,
    *stops.SPRING,
    *stops.END_STOPS,
    *waves.VARYING_INERTIA,
)

NAMES = tuple(parameter.name for parameter in PARAMETERS)
COUNT = len(PARAMETERS)

if TYPE_CHECKING:
    AxisParameters = Any
else:
    AxisParameters = NamedTuple("AxisParameters", [(field_name(name), float) for name in NAMES])

DEFAULTS = AxisParameters(*(parameter.default for parameter in PARAMETERS))

State = tuple[float, float, float, float, float]
Parameters = AxisParameters


def start(position: float, speed: float, drive: float, p: Parameters) -> State:
    """Return the state in which a simulation starts: the bristle of an axis that moves has settled.

    Args:
        position: [rad].
        speed: [rad/s].
        drive: torque of the drive [N.m].
    """
    x = (position, speed, drive, 0.0, UNASKED)
    if speed == 0.0 or not builds_up(p):
        return x
    return (position, speed, drive, reach(x, p) if speed > 0.0 else -reach(x, p), UNASKED)


def friction(x: State, p: Parameters) -> float:
    """Return the magnitude of dry friction [N.m] at the axis's speed and position."""
    level = sliding_friction(
        x[1], p.coulomb_friction_motor_torque, p.stribeck_friction_motor_coulomb, p.stribeck_friction_motor_breakaway,
        p.stribeck_friction_motor_stribeck_speed,
    )  # fmt: skip
    return dependent(level, x, p)


def dependent(level: float, x: State, p: Parameters) -> float:
    """Return a ``level`` of dry friction [N.m] with what depends on the position."""
    if p.periodic_friction_motor_amplitude == 0.0:
        return level
    return dependent_friction(
        level, 0.0, 0.0, x[0], p.periodic_friction_motor_amplitude, p.periodic_friction_motor_cycles_per_rev,
        p.periodic_friction_motor_phase,
    )  # fmt: skip


def filtered(p: Parameters) -> bool:
    """Tell whether the request is filtered or limited in rate."""
    return p.drive_filter_time_constant > 0.0 or p.rate_limit_rate < BIG


def drive_torque(x: State, p: Parameters, u: float) -> float:
    """Return the drive's torque [N.m]: the state behind the lag, or the (filtered) request itself without one."""
    if p.tau > 0.0:
        return x[2]
    return x[4] if filtered(p) and x[4] != UNASKED else u


def sliding_torque(x: State, p: Parameters, u: float, T_l: float) -> float:
    """Return the torque on the axis [N.m] of all but dry friction."""
    torque = drive_torque(x, p, u) + periodic(
        x[0], p.torque_ripple_amplitude, p.torque_ripple_cycles_per_rev, p.torque_ripple_phase
    )
    if p.torque_ripple_second_amplitude != 0.0 or p.torque_ripple_third_amplitude != 0.0:
        torque += periodic(
            x[0], p.torque_ripple_second_amplitude, 2.0 * p.torque_ripple_cycles_per_rev, p.torque_ripple_second_phase
        )
        torque += periodic(
            x[0], p.torque_ripple_third_amplitude, 3.0 * p.torque_ripple_cycles_per_rev, p.torque_ripple_third_phase
        )
    torque -= p.b * x[1] + quadratic_drag(x[1], p.quadratic_drag_coefficient) + p.load_torque_torque + T_l
    torque -= directional_friction(x[1], p.directional_friction_motor_difference)
    torque -= periodic(x[0], p.gravity_load_amplitude, 1.0, p.gravity_load_phase)
    if p.spring_load_stiffness != 0.0 or p.spring_load_cubic != 0.0:
        torque -= spring_torque(x[0], p.spring_load_stiffness, p.spring_load_cubic, p.spring_load_angle)
    if x[0] > p.end_stop_upper or x[0] < p.end_stop_lower:
        torque -= end_stop_torque(
            x[0], x[1], p.end_stop_lower, p.end_stop_upper, p.end_stop_stiffness, p.end_stop_dissipation
        )
    if p.varying_inertia_amplitude != 0.0:
        torque -= inertia_torque(
            x[0], x[1], p.varying_inertia_amplitude, p.varying_inertia_cycles_per_rev, p.varying_inertia_phase
        )
    return torque


def inertia(x: State, p: Parameters) -> float:
    """Return the inertia [kg.m2] at a position; a wave larger than it leaves a thousandth of it."""
    if p.varying_inertia_amplitude == 0.0:
        return p.J
    return inertia_at(p.J, x[0], p.varying_inertia_amplitude, p.varying_inertia_cycles_per_rev, p.varying_inertia_phase)


def rates(x: State, sign: float, p: Parameters, u: float, T_l: float) -> State:
    """Return the time derivative of ``x``, the bristle apart.

    Args:
        sign: direction of dry friction, -1 to 1; a smooth approximation passes ``tanh(speed/width)``.
    """
    asked = u
    follows = 0.0
    if filtered(p):
        asked = x[4]
        follows = request_rate(x[4], u, p.drive_filter_time_constant, p.rate_limit_rate)
    lag = (asked - x[2]) / p.tau if p.tau > 0.0 else 0.0
    accelerated = (sliding_torque(x, p, u, T_l) - sign * friction(x, p)) / inertia(x, p)
    return (x[1], accelerated, lag, 0.0, follows)


def breakaway_torque(p: Parameters) -> float:
    """Return the breakaway torque [N.m] without what depends on the position."""
    return breakaway(
        p.coulomb_friction_motor_torque, p.stribeck_friction_motor_coulomb, p.stribeck_friction_motor_breakaway
    )


def capacity(x: State, p: Parameters) -> float:
    """Return the breakaway torque [N.m] below which an axis that stands still keeps standing."""
    return dependent(breakaway_torque(p), x, p)


def builds_up(p: Parameters) -> bool:
    """Tell whether friction builds up over a distance."""
    return p.presliding_motor_distance > 0.0 and breakaway_torque(p) > 0.0


def reach(x: State, p: Parameters) -> float:
    """Return the bending [rad] at which the bristle slides at its speed."""
    return p.presliding_motor_distance * friction(x, p) / breakaway_torque(p)


def falls(p: Parameters) -> bool:
    """Tell whether friction depends on the speed."""
    return p.stribeck_friction_motor_coulomb != p.stribeck_friction_motor_breakaway


def leaves_sliding(p: Parameters) -> float:
    """Return the speed [rad/s] below which the bristle of an axis that slides must be followed."""
    return (
        leaving_speed(p.presliding_motor_distance, falls(p), p.stribeck_friction_motor_stribeck_speed)
        if builds_up(p)
        else 0.0
    )


def mode_rates(x: State, mode: int, p: Parameters, u: float, T_l: float) -> State:
    """Return the derivative of ``x``; an axis in mode 0 bends its bristle, or sticks where it has none."""
    if mode != 0:
        return rates(x, float(mode), p, u, T_l)
    if builds_up(p):
        far = reach(x, p)
        bends = bristle_rate(x[3], x[1], far)
        r = rates(
            x,
            bent_sign(x[3], bends, far, breakaway_torque(p) / p.presliding_motor_distance, p.presliding_motor_damping),
            p,
            u,
            T_l,
        )
        return (r[0], r[1], r[2], bends, r[4])
    r = rates(x, 0.0, p, u, T_l)
    return (0.0, 0.0, r[2], 0.0, r[4])


def slip_at_rest(x: State, p: Parameters, u: float, T_l: float) -> int:
    """Return the direction (-1 or 1) in which an axis at rest starts to slide, 0 when friction holds it."""
    push = sliding_torque((x[0], 0.0, x[2], x[3], x[4]), p, u, T_l)
    if push > capacity(x, p):
        return 1
    if push < -capacity(x, p):
        return -1
    return 0


def initial_mode(x: State, p: Parameters, u: float) -> int:
    """Return the direction of sliding (0: none) in which a simulation starts from ``x``, asked for ``u`` [N.m]."""
    if builds_up(p):
        return 0
    if x[1] != 0.0:
        return 1 if x[1] > 0.0 else -1
    return slip_at_rest(x, p, u, 0.0)


def settled(x: State, p: Parameters) -> int:
    """Return the direction of sliding (-1 or 1) of an axis whose bristle has settled, or 0."""
    if has_settled(x[3], x[1], reach(x, p), leaves_sliding(p), falls(p)):
        return 1 if x[1] > 0.0 else -1
    return 0


def past_stop(x: State, p: Parameters) -> int:
    """Return the end stop at which the axis is: -1, 0 (none) or 1."""
    return 1 if x[0] > p.end_stop_upper else -1 if x[0] < p.end_stop_lower else 0
