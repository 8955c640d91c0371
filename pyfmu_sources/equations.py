"""The drivetrain with backlash: motor with lag, gear with play, elastic shaft, load.

Sources: the thesis's eqs. 2.1 to 2.6 and 3.5 with gear ratio and signs mended; the physical shaft model with
backlash of Nordin, Galic and Gutman (Int. J. Adaptive Control and Signal Processing 11, 1997) for ``nordin``.

Conventions, the same in every function:

- ``x = (theta_m, omega_m, theta_l, omega_l, T_m, theta_r, omega_r, s, z_m, z_l, w, y)`` in rad, rad/s and N.m; ``r``
  is the inertia of ``extra_resonance``, ``s`` the twist that a shaft still has just after its teeth parted, ``z`` the
  bristles of friction that builds up, ``w`` the memory of the shaft's hysteresis, ``y`` the filtered request;
- ``mode = (contact, slip_m, slip_l)``: ``contact`` is the flank that touches (-1, 0, 1; -2 and 2: touching and
  standing still, ``hysteresis`` only), ``slip`` the direction in which dry friction slides (0: it sticks);
- ``p`` is the flat parameter tuple of :mod:`drivetrain_parameters`;
- ``u`` [N.m] and ``T_l`` [N.m] are held over a step of ``h`` [s].

Torques are positive when they drive motor or load forward; ``T_l`` and the loads' effects act against the load.

In all functions: ``contact``: flank that touches: -1, 0 or 1; -2 or 2 where both bodies stand still against it;
``transmitted``: torque of the shaft that friction depends on [N.m]; ``sign_m``: direction of the motor's dry
friction, -1 to 1; ``T_l``: load torque [N.m].
"""

from .backlash_models import GRADUAL, HELD, NEVER_PULLING, OWN_CONTACT, PLAIN_WHEN_CLOSED, RIGID
from .drive_request import request_rate
from .drivetrain_parameters import (
    BIG,
    NONE,
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
    P_DIRECTION_L,
    P_DIRECTION_M,
    P_DRAG,
    P_ECC,
    P_ECC_LEVER,
    P_ECC_N,
    P_ECC_PHASE,
    P_FILTER,
    P_GRAVITY,
    P_GRAVITY_PHASE,
    P_HYSTERESIS,
    P_HYSTERESIS_TWIST,
    P_I,
    P_J_L,
    P_J_M,
    P_J_WAVE,
    P_J_WAVE_N,
    P_J_WAVE_PHASE,
    P_K,
    P_K_WAVE,
    P_K_WAVE_N,
    P_K_WAVE_PHASE,
    P_LOAD_TORQUE,
    P_LOADED_L,
    P_LOADED_M,
    P_MODEL,
    P_ONSET,
    P_RATE,
    P_RES_J,
    P_RES_W,
    P_RES_ZETA,
    P_RIPPLE,
    P_RIPPLE_2,
    P_RIPPLE_2_PHASE,
    P_RIPPLE_3,
    P_RIPPLE_3_PHASE,
    P_RIPPLE_N,
    P_RIPPLE_PHASE,
    P_SHARPNESS,
    P_SPRING,
    P_SPRING_ANGLE,
    P_SPRING_CUBIC,
    P_STOP_D,
    P_STOP_K,
    P_STOP_LOWER,
    P_STOP_UPPER,
    P_STRIBECK_L,
    P_STRIBECK_M,
    P_STRIBECK_SPEED_L,
    P_STRIBECK_SPEED_M,
    P_TAU,
    P_WAVY_L,
    P_WAVY_M,
    P_WAVY_N_L,
    P_WAVY_N_M,
    P_WAVY_PHASE_L,
    P_WAVY_PHASE_M,
)
from .effects import (
    dependent_friction,
    directional_friction,
    end_stop_torque,
    hardening_torque,
    hysteresis_rate,
    periodic,
    periodic_curvature,
    periodic_slope,
    quadratic_drag,
    resonance_torque,
    set_in,
    sliding_friction,
    spring_torque,
)

State = tuple[float, float, float, float, float, float, float, float, float, float, float, float]
Mode = tuple[int, int, int]
Parameters = tuple[float, ...]

# An eccentric gear whose ratio passes through infinity has no meaning; below this slope the ratio is cut off.
SMALLEST_SLOPE = 1e-12


def backlash_model(p: Parameters) -> int:
    """Return the backlash model that acts: without a gap, the elastic models are all ``NONE``."""
    model = int(p[P_MODEL])
    if p[P_ALPHA] == 0.0 and model in PLAIN_WHEN_CLOSED:
        return NONE
    return model


def is_rigid(p: Parameters) -> bool:
    """Tell whether teeth in contact couple motor and load rigidly (``hysteresis``, ``rigid_impact``)."""
    return int(p[P_MODEL]) in RIGID


def teeth_never_pull(p: Parameters) -> bool:
    """Tell whether the teeth part when their torque reaches zero (``nordin``, ``elastic_impact``)."""
    return backlash_model(p) in NEVER_PULLING


def shaft_stiffness(p: Parameters) -> float:
    """Return the stiffness [N.m/rad] of teeth in contact and shaft."""
    model = int(p[P_MODEL])  # whose teeth may have a stiffness of their own
    return p[P_CONTACT_K] if model in OWN_CONTACT else p[P_K]


def shaft_damping(p: Parameters) -> float:
    """Return the damping [N.m.s/rad] of teeth in contact and shaft."""
    return p[P_CONTACT_C] if int(p[P_MODEL]) in OWN_CONTACT else p[P_C]


def twist(x: State, p: Parameters) -> float:
    """Return the twist [rad], ``theta_m / i - theta_l`` plus the error of an eccentric gear."""
    return x[0] / p[P_I] - x[2] + periodic(x[0], p[P_ECC], p[P_ECC_N], p[P_ECC_PHASE])


def twist_slope(x: State, p: Parameters) -> float:
    """Return the derivative of the twist by the motor angle [rad/rad], which is 1/i for an ideal gear."""
    return 1.0 / p[P_I] + periodic_slope(x[0], p[P_ECC], p[P_ECC_N], p[P_ECC_PHASE])


def lever_arm(x: State, p: Parameters) -> float:
    """Return the torque on the motor over that of the elastic shaft [N.m/(N.m)], which is 1/i for an ideal gear.

    The arm of teeth that conserve energy is :func:`twist_slope`. That of a gear whose teeth only stand off their
    places, or of an encoder that sits off its axis, keeps its length.
    """
    return 1.0 / p[P_I] + p[P_ECC_LEVER] * periodic_slope(x[0], p[P_ECC], p[P_ECC_N], p[P_ECC_PHASE])


def twist_rate(x: State, p: Parameters) -> float:
    """Return the time derivative of the twist [rad/s]."""
    return x[1] * twist_slope(x, p) - x[3]


def contact_of(angle: float, alpha: float) -> int:
    """Return the flank (-1, 0, 1) at which a twist ``angle`` [rad] lies for a half-gap ``alpha`` [rad]."""
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
    stiffness = shaft_stiffness(p)
    damping = shaft_damping(p)
    if p[P_K_WAVE] != 0.0:
        stiffness *= 1.0 + periodic(x[0], p[P_K_WAVE], p[P_K_WAVE_N], p[P_K_WAVE_PHASE])
    if p[P_ONSET] != 0.0 and int(p[P_MODEL]) in GRADUAL:
        damping *= set_in(wound, p[P_ONSET])
    torque = stiffness * wound + damping * twist_rate(x, p)
    torque += hardening_torque(wound, p[P_CUBIC], shaft_stiffness(p), p[P_SHARPNESS])
    if p[P_HYSTERESIS] != 0.0:
        torque += p[P_HYSTERESIS] * x[10]
    return torque


def friction_m(x: State, transmitted: float, p: Parameters) -> float:
    """Return the magnitude of the motor's dry friction [N.m]; ``transmitted`` [N.m] is the shaft's torque on it."""
    level = sliding_friction(x[1], p[P_COULOMB_M], p[P_STRIBECK_M], p[P_BREAKAWAY_M], p[P_STRIBECK_SPEED_M])
    if p[P_LOADED_M] == 0.0 and p[P_WAVY_M] == 0.0:
        return level
    return dependent_friction(level, transmitted, p[P_LOADED_M], x[0], p[P_WAVY_M], p[P_WAVY_N_M], p[P_WAVY_PHASE_M])


def friction_l(x: State, transmitted: float, p: Parameters) -> float:
    """Return the magnitude of the load's dry friction [N.m]; ``transmitted`` [N.m] is the shaft's torque on it."""
    level = sliding_friction(x[3], p[P_COULOMB_L], p[P_STRIBECK_L], p[P_BREAKAWAY_L], p[P_STRIBECK_SPEED_L])
    if p[P_LOADED_L] == 0.0 and p[P_WAVY_L] == 0.0:
        return level
    return dependent_friction(level, transmitted, p[P_LOADED_L], x[2], p[P_WAVY_L], p[P_WAVY_N_L], p[P_WAVY_PHASE_L])


def ripple(theta_m: float, p: Parameters) -> float:
    """Return the ripple of the motor's torque [N.m] with its harmonics at the motor's angle [rad]."""
    cycles = p[P_RIPPLE_N]
    torque = periodic(theta_m, p[P_RIPPLE], cycles, p[P_RIPPLE_PHASE])
    if p[P_RIPPLE_2] != 0.0 or p[P_RIPPLE_3] != 0.0:
        torque += periodic(theta_m, p[P_RIPPLE_2], 2.0 * cycles, p[P_RIPPLE_2_PHASE])
        torque += periodic(theta_m, p[P_RIPPLE_3], 3.0 * cycles, p[P_RIPPLE_3_PHASE])
    return torque


def motor_torque(x: State, transmitted: float, sign_m: float, p: Parameters) -> float:
    """Return the torque on the motor [N.m] without the shaft's: drive, ripple, viscous and dry friction."""
    torque = x[4] + ripple(x[0], p) - p[P_B_M] * x[1] - sign_m * friction_m(x, transmitted, p)
    if p[P_DIRECTION_M] != 0.0:
        torque -= directional_friction(x[1], p[P_DIRECTION_M])
    return torque


def load_torque(x: State, transmitted: float, sign_l: float, p: Parameters, T_l: float) -> float:
    """Return the torque on the load [N.m] without the shaft's: external, friction, gravity, drag, springs, stops."""
    against = T_l + p[P_LOAD_TORQUE] + p[P_B_L] * x[3] + sign_l * friction_l(x, transmitted, p)
    against += periodic(x[2], p[P_GRAVITY], 1.0, p[P_GRAVITY_PHASE]) + quadratic_drag(x[3], p[P_DRAG])
    if p[P_RES_J] > 0.0:
        against += resonance_torque(x[2] - x[5], x[3] - x[6], p[P_RES_J], p[P_RES_W], p[P_RES_ZETA])
    if p[P_DIRECTION_L] != 0.0:
        against += directional_friction(x[3], p[P_DIRECTION_L])
    if p[P_SPRING] != 0.0 or p[P_SPRING_CUBIC] != 0.0:
        against += spring_torque(x[2], p[P_SPRING], p[P_SPRING_CUBIC], p[P_SPRING_ANGLE])
    if x[2] > p[P_STOP_UPPER] or x[2] < p[P_STOP_LOWER]:
        against += end_stop_torque(x[2], x[3], p[P_STOP_LOWER], p[P_STOP_UPPER], p[P_STOP_K], p[P_STOP_D])
    if p[P_J_WAVE] != 0.0:
        against += 0.5 * periodic_slope(x[2], p[P_J_WAVE], p[P_J_WAVE_N], p[P_J_WAVE_PHASE]) * x[3] * x[3]
    return -against


def load_inertia(x: State, p: Parameters) -> float:
    """Return the load's inertia [kg.m2] at its angle; a wave larger than the inertia leaves a thousandth of it."""
    if p[P_J_WAVE] == 0.0:
        return p[P_J_L]
    return max(1e-3 * p[P_J_L], p[P_J_L] + periodic(x[2], p[P_J_WAVE], p[P_J_WAVE_N], p[P_J_WAVE_PHASE]))


def gear(x: State, p: Parameters) -> float:
    """Return motor angle over load angle [rad/rad] for small motions of rigid teeth: ``i``, unless eccentric."""
    if p[P_ECC] == 0.0:
        return p[P_I]
    slope = twist_slope(x, p)
    return 1.0 / slope if abs(slope) > SMALLEST_SLOPE else 1.0 / SMALLEST_SLOPE


def rigid_acceleration(x: State, sign_m: float, sign_l: float, p: Parameters, T_l: float) -> float:
    """Return the load's acceleration [rad/s2] while gear and load turn as one body."""
    i = gear(x, p)
    drive = i * motor_torque(x, 0.0, sign_m, p) + load_torque(x, 0.0, sign_l, p, T_l)
    if p[P_ECC] != 0.0:
        drive += p[P_J_M] * i * i * gear_acceleration(x, p)
    return drive / (p[P_J_M] * i * i + load_inertia(x, p))


def gear_acceleration(x: State, p: Parameters) -> float:
    """Return the load's acceleration [rad/s2] that an eccentric gear makes of a constant motor speed."""
    return periodic_curvature(x[0], p[P_ECC], p[P_ECC_N], p[P_ECC_PHASE]) * x[1] * x[1]


def rates(x: State, contact: int, sign_m: float, sign_l: float, p: Parameters, u: float, T_l: float) -> State:
    """Return the time derivative of ``x`` in one smooth mode (eq. 3.5 with the effects).

    Args:
        sign_m: direction of the motor's dry friction, -1 to 1; a smooth approximation passes ``tanh(w/v)``.
        u: requested torque [N.m], delayed and saturated already.
    """
    wound_rate = 0.0
    if contact == 0 and x[7] != 0.0:
        stiffness = shaft_stiffness(p)
        torque = stiffness * x[7] + hardening_torque(x[7], p[P_CUBIC], stiffness, p[P_SHARPNESS])
        wound_rate = -torque / shaft_damping(p)
    follower = 0.0
    if p[P_RES_J] > 0.0:
        pull = resonance_torque(x[2] - x[5], x[3] - x[6], p[P_RES_J], p[P_RES_W], p[P_RES_ZETA])
        follower = pull / p[P_RES_J]
    lag = (u - x[4]) / p[P_TAU]
    follows = 0.0
    if p[P_FILTER] > 0.0 or p[P_RATE] < BIG:
        lag = (x[11] - x[4]) / p[P_TAU]
        follows = request_rate(x[11], u, p[P_FILTER], p[P_RATE])
    memory = 0.0
    if is_rigid(p):
        accelerated_m, accelerated_l = rigid_rates(x, contact, sign_m, sign_l, p, T_l)
    else:
        shaft = elastic_torque(x, contact, p)
        transmitted = shaft * lever_arm(x, p)
        accelerated_m = (motor_torque(x, transmitted, sign_m, p) - transmitted) / p[P_J_M]
        accelerated_l = (load_torque(x, shaft, sign_l, p, T_l) + shaft) / load_inertia(x, p)
        if p[P_HYSTERESIS] != 0.0 and contact != 0:
            memory = hysteresis_rate(x[10], twist_rate(x, p), p[P_HYSTERESIS_TWIST])
    return (x[1], accelerated_m, x[3], accelerated_l, lag, x[6], follower, wound_rate, 0.0, 0.0, memory, follows)


def rigid_rates(x: State, contact: int, sign_m: float, sign_l: float, p: Parameters, T_l: float) -> tuple[float, float]:
    """Return both accelerations [rad/s2] of the rigid models (eqs. 2.3 to 2.5)."""
    if contact in (-2, 2):
        return (0.0, 0.0)
    if contact != 0:
        together = rigid_acceleration(x, sign_m, sign_l, p, T_l)
        if p[P_ECC] == 0.0:
            return (together * p[P_I], together)
        return ((together - gear_acceleration(x, p)) * gear(x, p), together)
    alone = motor_torque(x, 0.0, sign_m, p) / p[P_J_M]
    if int(p[P_MODEL]) in HELD:
        return (alone, 0.0)
    return (alone, load_torque(x, 0.0, sign_l, p, T_l) / load_inertia(x, p))
