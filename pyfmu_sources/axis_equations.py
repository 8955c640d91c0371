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

from .bristles import bent_sign, has_settled, leaving_speed
from .drive_request import UNASKED, request_rate
from .drivetrain_parameters import BIG
from .effects import (
    bristle_rate,
    dependent_friction,
    directional_friction,
    end_stop_torque,
    periodic,
    periodic_slope,
    quadratic_drag,
    sliding_friction,
    spring_torque,
)
from .servo_axis_parameters import (
    P_B,
    P_BREAKAWAY,
    P_BRISTLE_C,
    P_COULOMB,
    P_DIRECTION,
    P_DRAG,
    P_FILTER,
    P_GRAVITY,
    P_GRAVITY_PHASE,
    P_J,
    P_J_WAVE,
    P_J_WAVE_N,
    P_J_WAVE_PHASE,
    P_LOAD_TORQUE,
    P_PRESLIDING,
    P_RATE,
    P_RIPPLE,
    P_RIPPLE_2,
    P_RIPPLE_2_PHASE,
    P_RIPPLE_3,
    P_RIPPLE_3_PHASE,
    P_RIPPLE_N,
    P_RIPPLE_PHASE,
    P_SPRING,
    P_SPRING_ANGLE,
    P_SPRING_CUBIC,
    P_STOP_D,
    P_STOP_K,
    P_STOP_LOWER,
    P_STOP_UPPER,
    P_STRIBECK,
    P_STRIBECK_SPEED,
    P_TAU,
    P_WAVY,
    P_WAVY_N,
    P_WAVY_PHASE,
)

State = tuple[float, float, float, float, float]
Parameters = tuple[float, ...]


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
    level = sliding_friction(x[1], p[P_COULOMB], p[P_STRIBECK], p[P_BREAKAWAY], p[P_STRIBECK_SPEED])
    if p[P_WAVY] == 0.0:
        return level
    return dependent_friction(level, 0.0, 0.0, x[0], p[P_WAVY], p[P_WAVY_N], p[P_WAVY_PHASE])


def filtered(p: Parameters) -> bool:
    """Tell whether the request is filtered or limited in rate."""
    return p[P_FILTER] > 0.0 or p[P_RATE] < BIG


def drive_torque(x: State, p: Parameters, u: float) -> float:
    """Return the drive's torque [N.m]: the state behind the lag, or the (filtered) request itself without one."""
    if p[P_TAU] > 0.0:
        return x[2]
    return x[4] if filtered(p) and x[4] != UNASKED else u


def sliding_torque(x: State, p: Parameters, u: float, T_l: float) -> float:
    """Return the torque on the axis [N.m] of all but dry friction."""
    torque = drive_torque(x, p, u) + periodic(x[0], p[P_RIPPLE], p[P_RIPPLE_N], p[P_RIPPLE_PHASE])
    if p[P_RIPPLE_2] != 0.0 or p[P_RIPPLE_3] != 0.0:
        torque += periodic(x[0], p[P_RIPPLE_2], 2.0 * p[P_RIPPLE_N], p[P_RIPPLE_2_PHASE])
        torque += periodic(x[0], p[P_RIPPLE_3], 3.0 * p[P_RIPPLE_N], p[P_RIPPLE_3_PHASE])
    torque -= p[P_B] * x[1] + quadratic_drag(x[1], p[P_DRAG]) + p[P_LOAD_TORQUE] + T_l
    torque -= directional_friction(x[1], p[P_DIRECTION])
    torque -= periodic(x[0], p[P_GRAVITY], 1.0, p[P_GRAVITY_PHASE])
    if p[P_SPRING] != 0.0 or p[P_SPRING_CUBIC] != 0.0:
        torque -= spring_torque(x[0], p[P_SPRING], p[P_SPRING_CUBIC], p[P_SPRING_ANGLE])
    if x[0] > p[P_STOP_UPPER] or x[0] < p[P_STOP_LOWER]:
        torque -= end_stop_torque(x[0], x[1], p[P_STOP_LOWER], p[P_STOP_UPPER], p[P_STOP_K], p[P_STOP_D])
    if p[P_J_WAVE] != 0.0:
        torque -= 0.5 * periodic_slope(x[0], p[P_J_WAVE], p[P_J_WAVE_N], p[P_J_WAVE_PHASE]) * x[1] * x[1]
    return torque


def inertia(x: State, p: Parameters) -> float:
    """Return the inertia [kg.m2] at a position; a wave larger than it leaves a thousandth of it."""
    if p[P_J_WAVE] == 0.0:
        return p[P_J]
    return max(1e-3 * p[P_J], p[P_J] + periodic(x[0], p[P_J_WAVE], p[P_J_WAVE_N], p[P_J_WAVE_PHASE]))


def rates(x: State, sign: float, p: Parameters, u: float, T_l: float) -> State:
    """Return the time derivative of ``x``, the bristle apart.

    Args:
        sign: direction of dry friction, -1 to 1; a smooth approximation passes ``tanh(speed/width)``.
    """
    asked = u
    follows = 0.0
    if filtered(p):
        asked = x[4]
        follows = request_rate(x[4], u, p[P_FILTER], p[P_RATE])
    lag = (asked - x[2]) / p[P_TAU] if p[P_TAU] > 0.0 else 0.0
    accelerated = (sliding_torque(x, p, u, T_l) - sign * friction(x, p)) / inertia(x, p)
    return (x[1], accelerated, lag, 0.0, follows)


def rest(p: Parameters) -> float:
    """Return the breakaway torque [N.m] without what depends on the position."""
    return p[P_COULOMB] + max(p[P_STRIBECK], p[P_BREAKAWAY])


def capacity(x: State, p: Parameters) -> float:
    """Return the breakaway torque [N.m] below which an axis that stands still keeps standing."""
    if p[P_WAVY] == 0.0:
        return rest(p)
    return dependent_friction(rest(p), 0.0, 0.0, x[0], p[P_WAVY], p[P_WAVY_N], p[P_WAVY_PHASE])


def builds_up(p: Parameters) -> bool:
    """Tell whether friction builds up over a distance."""
    return p[P_PRESLIDING] > 0.0 and rest(p) > 0.0


def reach(x: State, p: Parameters) -> float:
    """Return the bending [rad] at which the bristle slides at its speed."""
    return p[P_PRESLIDING] * friction(x, p) / rest(p)


def falls(p: Parameters) -> bool:
    """Tell whether friction depends on the speed."""
    return p[P_STRIBECK] != p[P_BREAKAWAY]


def leaves_sliding(p: Parameters) -> float:
    """Return the speed [rad/s] below which the bristle of an axis that slides must be followed."""
    return leaving_speed(p[P_PRESLIDING], falls(p), p[P_STRIBECK_SPEED]) if builds_up(p) else 0.0


def mode_rates(x: State, mode: int, p: Parameters, u: float, T_l: float) -> State:
    """Return the derivative of ``x``; an axis in mode 0 bends its bristle, or sticks where it has none."""
    if mode != 0:
        return rates(x, float(mode), p, u, T_l)
    if builds_up(p):
        far = reach(x, p)
        bends = bristle_rate(x[3], x[1], far)
        r = rates(x, bent_sign(x[3], bends, far, rest(p) / p[P_PRESLIDING], p[P_BRISTLE_C]), p, u, T_l)
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
    return 1 if x[0] > p[P_STOP_UPPER] else -1 if x[0] < p[P_STOP_LOWER] else 0
