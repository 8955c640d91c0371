"""A single axis: one inertia behind the torque lag of its drive, with the effects of input, motor and sensor.

State ``x = (position, speed, drive)``: position [rad or m], its speed, and the drive's torque or force [N.m or N].
An axis is as well a motor with its load (rad, kg.m2, N.m) as a carriage on a screw (m, kg, N): the equations are the
same, the model file states the unit.

::

    J speed' = drive + ripple(position) - b speed - sign(speed) friction(|speed|) - drag speed |speed|
               - load_torque - gravity(position) - T_l
    tau drive' = u - drive          (tau = 0: drive = u)
"""

from .drivetrain_parameters import BIG, TINY, Parameter
from .effects import gravity_torque, quadratic_drag, sliding_friction, torque_ripple

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
