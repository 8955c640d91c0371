"""A single axis: one inertia behind the torque lag of its drive, with the effects of input, motor and sensor.

State ``x = (position, speed, drive)``: position [rad or m], its speed, and the drive's torque or force [N.m or N].
An axis is as well a motor with its load (rad, kg.m2, N.m) as a carriage on a screw (m, kg, N): the equations are the
same, the model file states the unit.

::

    J speed' = drive + ripple(position) - b speed - sign(speed) friction(|speed|) - drag speed |speed|
               - difference |speed| - load_torque - gravity(position) - T_l
    tau drive' = u - drive          (tau = 0: drive = u)
"""

from math import exp, sqrt

from .drivetrain_parameters import BIG, TINY, Parameter
from .effects import directional_friction, gravity_torque, quadratic_drag, sliding_friction, torque_ripple

PARAMETERS = (
    Parameter("J", "kg.m2", 1.0, TINY, BIG, "Inertia (or mass)"),
    Parameter("b", "N.m.s/rad", 1.0, 0.0, BIG, "Viscous friction"),
    Parameter("tau", "s", 0.0, 0.0, BIG, "Time constant of the drive's torque (0: none)"),
    Parameter("effects.input_delay.delay", "s", 0.0, 0.0, 10.0, "Dead time of the requested torque"),
    Parameter("effects.torque_saturation.limit", "N.m", BIG, 0.0, BIG, "Largest torque that the drive delivers"),
    Parameter("effects.torque_ripple.amplitude", "N.m", 0.0, -BIG, BIG, "Amplitude of the ripple"),
    Parameter("effects.torque_ripple.cycles_per_rev", "1", 6.0, 0.0, BIG, "Ripple, rad of phase per unit of position"),
    Parameter("effects.torque_ripple.phase", "rad", 0.0, -BIG, BIG, "Ripple phase at position zero"),
    Parameter("effects.coulomb_friction.motor.torque", "N.m", 0.0, 0.0, BIG, "Dry friction"),
    Parameter("effects.stribeck_friction.motor.coulomb", "N.m", 0.0, 0.0, BIG, "Sliding friction"),
    Parameter("effects.stribeck_friction.motor.breakaway", "N.m", 0.0, 0.0, BIG, "Breakaway friction"),
    Parameter("effects.stribeck_friction.motor.stribeck_speed", "rad/s", 1.0, TINY, BIG, "Stribeck speed"),
    Parameter("effects.load_torque.torque", "N.m", 0.0, -BIG, BIG, "Constant torque against the axis"),
    Parameter("effects.gravity_load.amplitude", "N.m", 0.0, -BIG, BIG, "Amplitude of the gravity torque"),
    Parameter("effects.gravity_load.phase", "rad", 0.0, -BIG, BIG, "Gravity phase at position zero"),
    Parameter("effects.quadratic_drag.coefficient", "N.m.s2/rad2", 0.0, 0.0, BIG, "Drag"),
    Parameter(
        "effects.directional_friction.motor.difference",
        "N.m.s/rad",
        0.0,
        -BIG,
        BIG,
        "Viscous friction, forward minus b",
    ),
    Parameter("effects.sensor_offset.motor.offset", "rad", 0.0, -BIG, BIG, "Offset of the encoder"),
)

NAMES = tuple(parameter.name for parameter in PARAMETERS)
DEFAULTS = tuple(parameter.default for parameter in PARAMETERS)
COUNT = len(PARAMETERS)

(
    P_J,
    P_B,
    P_TAU,
    P_DELAY,
    P_LIMIT,
    P_RIPPLE,
    P_RIPPLE_N,
    P_RIPPLE_PHASE,
    P_COULOMB,
    P_STRIBECK,
    P_BREAKAWAY,
    P_STRIBECK_SPEED,
    P_LOAD_TORQUE,
    P_GRAVITY,
    P_GRAVITY_PHASE,
    P_DRAG,
    P_DIRECTION,
    P_OFFSET,
) = range(COUNT)

State = tuple[float, float, float]
Parameters = tuple[float, ...]


def friction(x: State, p: Parameters) -> float:
    """Return the magnitude of dry friction [N.m] at the axis's speed."""
    return sliding_friction(x[1], p[P_COULOMB], p[P_STRIBECK], p[P_BREAKAWAY], p[P_STRIBECK_SPEED])


def drive_torque(x: State, p: Parameters, u: float) -> float:
    """Return the drive's torque [N.m]: the state behind the lag, or the request itself without one."""
    return x[2] if p[P_TAU] > 0.0 else u


def sliding_torque(x: State, p: Parameters, u: float, T_l: float) -> float:
    """Return the torque on the axis [N.m] of all but dry friction."""
    torque = drive_torque(x, p, u) + torque_ripple(x[0], p[P_RIPPLE], p[P_RIPPLE_N], p[P_RIPPLE_PHASE])
    torque -= p[P_B] * x[1] + quadratic_drag(x[1], p[P_DRAG]) + p[P_LOAD_TORQUE] + T_l
    torque -= directional_friction(x[1], p[P_DIRECTION])
    return torque - gravity_torque(x[0], p[P_GRAVITY], p[P_GRAVITY_PHASE])


def rates(x: State, sign: float, p: Parameters, u: float, T_l: float) -> State:
    """Return the time derivative of ``x``.

    Args:
        x: state.
        sign: direction of dry friction, -1 to 1; a smooth approximation passes ``tanh(speed/width)``.
        p: parameters in the order of ``PARAMETERS``.
        u: requested torque [N.m], delayed and saturated already, held.
        T_l: external load torque [N.m], held.
    """
    lag = (u - x[2]) / p[P_TAU] if p[P_TAU] > 0.0 else 0.0
    return (x[1], (sliding_torque(x, p, u, T_l) - sign * friction(x, p)) / p[P_J], lag)


def capacity(p: Parameters) -> float:
    """Return the breakaway torque [N.m] below which an axis that stands still keeps standing."""
    return p[P_COULOMB] + max(p[P_STRIBECK], p[P_BREAKAWAY])


def slip_at_rest(x: State, p: Parameters, u: float, T_l: float) -> int:
    """Return the direction in which an axis at rest starts to slide, 0 when friction holds it."""
    push = sliding_torque((x[0], 0.0, x[2]), p, u, T_l)
    if push > capacity(p):
        return 1
    if push < -capacity(p):
        return -1
    return 0


def initial_mode(x: State, p: Parameters, u: float) -> int:
    """Return the direction of sliding (-1, 1; 0: held by friction) from which a simulation starts."""
    if x[1] > 0.0:
        return 1
    if x[1] < 0.0:
        return -1
    return slip_at_rest(x, p, u, 0.0)


def longest_step(x: State, p: Parameters, h: float) -> float:
    """Return a step [s] that resolves damping, lag and ripple well (a Runge-Kutta step errs by its 5th power)."""
    rate = (p[P_B] + abs(p[P_DIRECTION]) + 2.0 * p[P_DRAG] * abs(x[1])) / p[P_J]
    if p[P_TAU] > 0.0:
        rate = max(rate, 1.0 / p[P_TAU])
    if p[P_RIPPLE] != 0.0:
        rate = max(rate, p[P_RIPPLE_N] * (abs(x[1]) + sqrt(abs(p[P_RIPPLE]) / (p[P_RIPPLE_N] * p[P_J] + TINY))))
    if p[P_BREAKAWAY] != p[P_STRIBECK]:
        rate = max(rate, abs(p[P_BREAKAWAY] - p[P_STRIBECK]) / (p[P_STRIBECK_SPEED] * p[P_J]))
    return min(h, 0.05 / (rate + TINY))


def smooth_step(x: State, sign: float, p: Parameters, u: float, T_l: float, h: float) -> State:
    """Return the state after one classical Runge-Kutta step in one direction of sliding."""
    a = rates(x, sign, p, u, T_l)
    b = rates((x[0] + 0.5 * h * a[0], x[1] + 0.5 * h * a[1], x[2] + 0.5 * h * a[2]), sign, p, u, T_l)
    c = rates((x[0] + 0.5 * h * b[0], x[1] + 0.5 * h * b[1], x[2] + 0.5 * h * b[2]), sign, p, u, T_l)
    d = rates((x[0] + h * c[0], x[1] + h * c[1], x[2] + h * c[2]), sign, p, u, T_l)
    w = h / 6.0
    return (
        x[0] + w * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0]),
        x[1] + w * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1]),
        x[2] + w * (a[2] + 2.0 * b[2] + 2.0 * c[2] + d[2]),
    )


def stopping_time(x: State, sign: int, p: Parameters, u: float, T_l: float, h: float) -> float:
    """Return when within ``h`` [s] an axis that slides comes to rest (bisection; its speed changes sign in ``h``)."""
    low, high = 0.0, h
    for _ in range(50):
        middle = 0.5 * (low + high)
        if smooth_step(x, float(sign), p, u, T_l, middle)[1] * sign > 0.0:
            low = middle
        else:
            high = middle
    return high


def held(x: State, p: Parameters, u: float, h: float) -> State:
    """Return the state after ``h`` [s] at rest: the drive's torque alone moves."""
    share = 1.0 - exp(-h / p[P_TAU]) if p[P_TAU] > 0.0 else 0.0
    return (x[0], 0.0, x[2] + share * (u - x[2]))


def advance(x: State, mode: int, p: Parameters, u: float, T_l: float, h: float) -> tuple[State, int]:
    """Return state and direction of sliding after ``h`` [s] with the inputs held; stops are located.

    Args:
        x: state.
        mode: direction of sliding, from :func:`initial_mode` or the step before.
        p: parameters.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].
        h: step [s], positive.
    """
    dry = capacity(p) > 0.0
    elapsed = 0.0
    while h - elapsed > 1e-12 * h:
        step = min(longest_step(x, p, h), h - elapsed)
        if dry and mode == 0:
            mode = slip_at_rest(x, p, u, T_l)
            if mode == 0:
                x = held(x, p, u, step)
                elapsed += step
                continue
        moved = smooth_step(x, float(mode), p, u, T_l, step)
        if dry and moved[1] * mode < 0.0:
            step = stopping_time(x, mode, p, u, T_l, step)
            moved = smooth_step(x, float(mode), p, u, T_l, step)
            x = (moved[0], 0.0, moved[2])
            mode = slip_at_rest(x, p, u, T_l)
        else:
            x = moved
        elapsed += step
    return (x, mode)
