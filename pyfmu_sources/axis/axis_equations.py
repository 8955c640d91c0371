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

import sys
from typing import TYPE_CHECKING, Any, NamedTuple

from ..hybrid.binding import bind
from ..laws import body, drive, friction, stops, waves
from ..laws.drive import UNASKED, request_rate
from ..laws.friction import (
    BodyFriction,
    builds_up,
    capacity,
    directional_friction,
    sliding_friction,
    start_bristle,
)
from ..laws.parameter_rows import BIG, TINY, Parameter, field_name, keep_last, mark_linear

PARAMETERS = (
    *mark_linear(
        Parameter("J", "kg.m2", 1.0, TINY, BIG, "Inertia (or mass)"),
        Parameter("b", "N.m.s/rad", 1.0, 0.0, BIG, "Viscous friction"),
        Parameter("tau", "s", 0.0, 0.0, BIG, "Time constant of the drive's torque (0: none)"),
    ),
    *drive.INPUT,
    *waves.ripple_rows("Amplitude of the ripple", "Ripple, rad of phase per unit of position", "position"),
    *friction.coulomb_rows("motor", "Dry friction"),
    *friction.stribeck_rows("motor", ""),
    *drive.load_rows("axis"),
    *waves.gravity_rows("position"),
    *friction.drag_rows("Drag"),
    *friction.directional_rows("motor", "Viscous friction, forward minus b"),
    *drive.encoder_rows("motor", "encoder"),
    *friction.presliding_rows("motor", "Distance of friction to build up (0: none)", "Damping of friction building up"),
    *waves.wave_rows("periodic_friction.motor", "N.m", "Part of dry friction that repeats with the position", 1.0),
    *drive.REQUEST,
    *waves.HARMONICS,
    *stops.SPRING,
    *stops.END_STOPS,
    *waves.VARYING_INERTIA,
    *body.FURTHER,
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
of_body = bind(body, sys.modules[__name__])


def start(position: float, speed: float, drive: float, p: Parameters) -> State:
    """Return the state in which a simulation starts, of position [rad], speed [rad/s] and torque of the drive [N.m]."""
    return (position, speed, drive, start_bristle(friction_of(p), speed, position, 0.0), UNASKED)


def _friction_of(p: Parameters) -> BodyFriction:
    """Return the dry friction of the axis, which no torque of a shaft makes larger."""
    return BodyFriction(
        p.coulomb_friction_motor_torque, p.stribeck_friction_motor_coulomb, p.stribeck_friction_motor_breakaway,
        p.stribeck_friction_motor_stribeck_speed, p.presliding_motor_distance, p.presliding_motor_damping, 0.0,
        p.periodic_friction_motor_amplitude, p.periodic_friction_motor_cycles_per_rev, p.periodic_friction_motor_phase,
    )  # fmt: skip


friction_of = keep_last(_friction_of)


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
    against = of_body.resisted(p.b * x[1] + p.load_torque_torque + T_l, x[0], x[1], p)
    if p.directional_friction_motor_difference != 0.0:
        against += directional_friction(x[1], p.directional_friction_motor_difference)
    return drive_torque(x, p, u) + of_body.ripple(x[0], p) - against


def inertia(x: State, p: Parameters) -> float:
    """Return the inertia [kg.m2] at a position."""
    return of_body.inertia_of(p.J, x[0], p)


def rates(x: State, sign: float, p: Parameters, u: float, T_l: float) -> State:
    """Return the time derivative of ``x``, the bristle apart.

    ``sign``: direction of dry friction, -1 to 1; a smooth approximation passes ``tanh(speed/width)``.
    """
    asked = u
    follows = 0.0
    if filtered(p):
        asked = x[4]
        follows = request_rate(x[4], u, p.drive_filter_time_constant, p.rate_limit_rate)
    lag = (asked - x[2]) / p.tau if p.tau > 0.0 else 0.0
    torque = sliding_torque(x, p, u, T_l) - sign * sliding_friction(friction_of(p), x[1], x[0], 0.0)
    return (x[1], torque / inertia(x, p), lag, 0.0, follows)


def slip_at_rest(x: State, p: Parameters, u: float, T_l: float) -> int:
    """Return the direction (-1 or 1) in which an axis at rest starts to slide, 0 when friction holds it."""
    push = sliding_torque((x[0], 0.0, x[2], x[3], x[4]), p, u, T_l)
    holds = capacity(friction_of(p), x[0], 0.0)
    return 1 if push > holds else -1 if push < -holds else 0


def initial_mode(x: State, p: Parameters, u: float) -> int:
    """Return the direction of sliding (0: none) in which a simulation starts from ``x``, asked for ``u`` [N.m]."""
    if builds_up(friction_of(p)):
        return 0
    if x[1] != 0.0:
        return 1 if x[1] > 0.0 else -1
    return slip_at_rest(x, p, u, 0.0)


def past_stop(x: State, p: Parameters) -> int:
    """Return the end stop at which the axis is: -1, 0 (none) or 1."""
    return 1 if x[0] > p.end_stop_upper else -1 if x[0] < p.end_stop_lower else 0
