"""The drivetrain with backlash: motor with lag, gear with play, elastic shaft, load.

Sources: the thesis's eqs. 2.1 to 2.6 and 3.5 with gear ratio and signs mended; the physical shaft model with
backlash of Nordin, Galic and Gutman (Int. J. Adaptive Control and Signal Processing 11, 1997) for ``nordin``.

Conventions, the same in every function:

- ``x = (theta_m, omega_m, theta_l, omega_l, T_m, theta_r, omega_r, s)`` in rad, rad/s and N.m; ``r`` is the
  inertia of ``extra_resonance``, ``s`` the twist that a shaft still has just after its teeth parted;
- ``mode = (contact, slip_m, slip_l)``: ``contact`` is the flank that touches (-1, 0, 1; -2 and 2: touching and
  standing still, ``hysteresis`` only), ``slip`` the direction in which dry friction slides (0: it sticks);
- ``p`` is the flat parameter tuple of :mod:`drivetrain_parameters`;
- ``u`` [N.m] and ``T_l`` [N.m] are held over a step of ``h`` [s].

Torques are positive when they drive motor or load forward; ``T_l`` and the loads' effects act against the load.
"""

from .drivetrain_parameters import (
    DEAD_ZONE,
    ELASTIC_IMPACT,
    HYSTERESIS,
    NONE,
    NORDIN,
    P_ALPHA,
    P_B_L,
    P_B_M,
    P_BREAKAWAY_L,
    P_BREAKAWAY_M,
    P_C,
    P_CONTACT_C,
    P_CONTACT_K,
    P_COULOMB_L,
    P_COULOMB_M,
    P_CUBIC,
    P_DRAG,
    P_ECC,
    P_ECC_N,
    P_ECC_PHASE,
    P_GRAVITY,
    P_GRAVITY_PHASE,
    P_I,
    P_J_L,
    P_J_M,
    P_K,
    P_LOAD_TORQUE,
    P_MODEL,
    P_RES_J,
    P_RES_W,
    P_RES_ZETA,
    P_RIPPLE,
    P_RIPPLE_N,
    P_RIPPLE_PHASE,
    P_STRIBECK_L,
    P_STRIBECK_M,
    P_STRIBECK_SPEED_L,
    P_STRIBECK_SPEED_M,
    P_TAU,
    RIGID_IMPACT,
)
from .effects import (
    gravity_torque,
    hardening_torque,
    quadratic_drag,
    resonance_torque,
    sliding_friction,
    torque_ripple,
    twist_error,
    twist_error_slope,
)

State = tuple[float, float, float, float, float, float, float, float]
Mode = tuple[int, int, int]
Parameters = tuple[float, ...]


def backlash_model(p: Parameters) -> int:
    """Return the backlash model that acts: without a gap, the elastic models are all ``NONE``."""
    model = int(p[P_MODEL])
    if p[P_ALPHA] == 0.0 and model in (DEAD_ZONE, NORDIN):
        return NONE
    return model


def is_rigid(p: Parameters) -> bool:
    """Tell whether teeth in contact couple motor and load rigidly (``hysteresis``, ``rigid_impact``)."""
    return int(p[P_MODEL]) in (HYSTERESIS, RIGID_IMPACT)


def teeth_never_pull(p: Parameters) -> bool:
    """Tell whether the teeth part when their torque reaches zero (``nordin``, ``elastic_impact``)."""
    return backlash_model(p) in (NORDIN, ELASTIC_IMPACT)


def shaft_stiffness(p: Parameters) -> float:
    """Return the stiffness [N.m/rad] of teeth in contact and shaft."""
    return p[P_CONTACT_K] if int(p[P_MODEL]) == ELASTIC_IMPACT else p[P_K]


def shaft_damping(p: Parameters) -> float:
    """Return the damping [N.m.s/rad] of teeth in contact and shaft."""
    return p[P_CONTACT_C] if int(p[P_MODEL]) == ELASTIC_IMPACT else p[P_C]


def twist(x: State, p: Parameters) -> float:
    """Return the twist [rad], ``theta_m / i - theta_l`` plus the error of an eccentric gear."""
    return x[0] / p[P_I] - x[2] + twist_error(x[0], p[P_ECC], p[P_ECC_N], p[P_ECC_PHASE])


def twist_slope(x: State, p: Parameters) -> float:
    """Return the derivative of the twist by the motor angle [rad/rad], which is 1/i for an ideal gear."""
    return 1.0 / p[P_I] + twist_error_slope(x[0], p[P_ECC], p[P_ECC_N], p[P_ECC_PHASE])


def twist_rate(x: State, p: Parameters) -> float:
    """Return the time derivative of the twist [rad/s]."""
    return x[1] * twist_slope(x, p) - x[3]


def contact_of(angle: float, alpha: float) -> int:
    """Return the flank (-1, 0, 1) at which a ``twist`` angle [rad] lies for a half-gap ``alpha`` [rad]."""
    if angle > alpha:
        return 1
    if angle < -alpha:
        return -1
    return 0


def elastic_torque(x: State, contact: int, p: Parameters) -> float:
    """Return the load-side shaft torque [N.m] of an elastic model at the flank ``contact`` (eq. 2.6, mended)."""
    if contact == 0:
        return 0.0
    offset = 0.0 if backlash_model(p) == NONE else contact * p[P_ALPHA]
    wound = twist(x, p) - offset
    return shaft_stiffness(p) * wound + shaft_damping(p) * twist_rate(x, p) + hardening_torque(wound, p[P_CUBIC])


def motor_torque(x: State, sign_m: float, p: Parameters) -> float:
    """Return the torque on the motor [N.m] without the shaft's: drive, ripple, viscous and dry friction."""
    friction = sliding_friction(x[1], p[P_COULOMB_M], p[P_STRIBECK_M], p[P_BREAKAWAY_M], p[P_STRIBECK_SPEED_M])
    ripple = torque_ripple(x[0], p[P_RIPPLE], p[P_RIPPLE_N], p[P_RIPPLE_PHASE])
    return x[4] + ripple - p[P_B_M] * x[1] - sign_m * friction


def load_torque(x: State, sign_l: float, p: Parameters, T_l: float) -> float:
    """Return the torque on the load [N.m] without the shaft's: external, friction, gravity, drag, resonance."""
    friction = sliding_friction(x[3], p[P_COULOMB_L], p[P_STRIBECK_L], p[P_BREAKAWAY_L], p[P_STRIBECK_SPEED_L])
    against = T_l + p[P_LOAD_TORQUE] + p[P_B_L] * x[3] + sign_l * friction
    against += gravity_torque(x[2], p[P_GRAVITY], p[P_GRAVITY_PHASE]) + quadratic_drag(x[3], p[P_DRAG])
    if p[P_RES_J] > 0.0:
        against += resonance_torque(x[2] - x[5], x[3] - x[6], p[P_RES_J], p[P_RES_W], p[P_RES_ZETA])
    return -against


def rigid_acceleration(x: State, sign_m: float, sign_l: float, p: Parameters, T_l: float) -> float:
    """Return the load's acceleration [rad/s2] while gear and load turn as one body."""
    i = p[P_I]
    drive = i * motor_torque(x, sign_m, p) + load_torque(x, sign_l, p, T_l)
    return drive / (p[P_J_M] * i * i + p[P_J_L])


def shaft_torque(x: State, mode: Mode, p: Parameters, T_l: float) -> float:
    """Return the torque [N.m] that the shaft exerts on the load, whatever the model."""
    contact = mode[0]
    if contact == 0:
        return 0.0
    if not is_rigid(p):
        return elastic_torque(x, contact, p)
    if contact in (-2, 2):
        return -load_torque(x, 0.0, p, T_l)
    accelerated = rigid_acceleration(x, float(mode[1]), float(mode[2]), p, T_l)
    return p[P_J_L] * accelerated - load_torque(x, float(mode[2]), p, T_l)


def rates(x: State, contact: int, sign_m: float, sign_l: float, p: Parameters, u: float, T_l: float) -> State:
    """Return the time derivative of ``x`` in one smooth mode (eq. 3.5 with the effects).

    Args:
        x: state.
        contact: flank that touches.
        sign_m: direction of the motor's dry friction, -1 to 1; a smooth approximation passes ``tanh(w/v)``.
        sign_l: the same of the load.
        p: parameters.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].
    """
    wound_rate = 0.0
    if contact == 0 and x[7] != 0.0:
        stiffness = shaft_stiffness(p)
        wound_rate = -(stiffness * x[7] + hardening_torque(x[7], p[P_CUBIC])) / shaft_damping(p)
    follower = 0.0
    if p[P_RES_J] > 0.0:
        pull = resonance_torque(x[2] - x[5], x[3] - x[6], p[P_RES_J], p[P_RES_W], p[P_RES_ZETA])
        follower = pull / p[P_RES_J]
    lag = (u - x[4]) / p[P_TAU]
    if is_rigid(p):
        accelerated_m, accelerated_l = rigid_rates(x, contact, sign_m, sign_l, p, T_l)
    else:
        shaft = elastic_torque(x, contact, p)
        accelerated_m = (motor_torque(x, sign_m, p) - shaft * twist_slope(x, p)) / p[P_J_M]
        accelerated_l = (load_torque(x, sign_l, p, T_l) + shaft) / p[P_J_L]
    return (x[1], accelerated_m, x[3], accelerated_l, lag, x[6], follower, wound_rate)


def rigid_rates(x: State, contact: int, sign_m: float, sign_l: float, p: Parameters, T_l: float) -> tuple[float, float]:
    """Return both accelerations [rad/s2] of the rigid models (eqs. 2.3 to 2.5)."""
    if contact in (-2, 2):
        return (0.0, 0.0)
    if contact != 0:
        together = rigid_acceleration(x, sign_m, sign_l, p, T_l)
        return (together * p[P_I], together)
    alone = motor_torque(x, sign_m, p) / p[P_J_M]
    if int(p[P_MODEL]) == HYSTERESIS:
        return (alone, 0.0)
    return (alone, load_torque(x, sign_l, p, T_l) / p[P_J_L])
