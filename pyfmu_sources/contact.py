"""What happens at a contact event: which mode follows, and how the state jumps."""

from .drivetrain_parameters import (
    HYSTERESIS,
    NONE,
    P_ALPHA,
    P_I,
    P_J_L,
    P_J_M,
    P_MODEL,
    P_RESTITUTION,
    RIGID_IMPACT,
)
from .equations import (
    Parameters,
    State,
    backlash_model,
    contact_of,
    is_rigid,
    shaft_damping,
    shaft_stiffness,
    teeth_never_pull,
    twist,
    twist_rate,
)

# Below this speed [rad/s] two rigid teeth stay together instead of bouncing for ever (Zeno).
RESTING_SPEED = 1e-6
MAX_BOUNCES = 200


def parted_twist(x: State, contact: int, p: Parameters) -> float:
    """Return the twist [rad] that a shaft keeps at the moment at which its teeth part at flank ``contact``."""
    damping = shaft_damping(p)
    if damping == 0.0 or shaft_stiffness(p) > 1e7 * damping:
        return 0.0
    return twist(x, p) - contact * p[P_ALPHA]


def collide(x: State, restitution: float, p: Parameters) -> State:
    """Return the state after motor and load hit each other (eqs. 2.3 and 2.4): momentum is kept."""
    i = p[P_I]
    mobility = 1.0 / (p[P_J_M] * i * i) + 1.0 / p[P_J_L]
    impulse = (1.0 + restitution) * (x[1] / i - x[3]) / mobility
    omega_m = x[1] - impulse / (i * p[P_J_M])
    omega_l = x[3] + impulse / p[P_J_L]
    if restitution == 0.0:
        omega_l = omega_m / i
    return (x[0], omega_m, x[2], omega_l, x[4], x[5], x[6], x[7])


def parted(x: State, wound: float) -> State:
    """Return the state with the twist ``wound`` [rad] left in the shaft."""
    return (x[0], x[1], x[2], x[3], x[4], x[5], x[6], wound)


def stopped(x: State) -> State:
    """Return the state with motor and load standing still."""
    return (x[0], 0.0, x[2], 0.0, x[4], x[5], x[6], x[7])


def after_event(
    x: State, contact: int, which: int, events: int, push_m: float, push: float, p: Parameters
) -> tuple[State, int]:
    """Return state and contact after the guard ``which`` of ``contact`` has turned negative.

    Args:
        x: state at the event.
        contact: the mode that ends.
        which: its guard, as numbered by the guard functions.
        events: how many events this step has had; many mean chattering, which ends in a lasting contact.
        push_m: torque on the motor [N.m] without the shaft's.
        push: torque [N.m] on motor and load as one body, load side.
        p: parameters.
    """
    model = int(p[P_MODEL])
    if contact == 0:
        flank = 1 if which == 0 else -1
        if model == HYSTERESIS:
            return play_engaged(x, flank, push_m, push, p)
        if model == RIGID_IMPACT:
            closing = abs(x[1] / p[P_I] - x[3])
            if closing > RESTING_SPEED and events < MAX_BOUNCES and p[P_RESTITUTION] > 0.0:
                return (collide(x, p[P_RESTITUTION], p), 0)
            return (collide(x, 0.0, p), flank)
        return (parted(x, 0.0), flank)
    if contact in (-2, 2):
        return (x, 0) if which == 0 else (x, contact // 2)
    if model == HYSTERESIS:
        return play_reversed(stopped(x), contact, push_m, push)
    if teeth_never_pull(p):
        return (parted(x, parted_twist(x, contact, p)), 0)
    return (x, 0)


def play_engaged(x: State, flank: int, push_m: float, push: float, p: Parameters) -> tuple[State, int]:
    """Return state and contact of the play model (eq. 2.5) when the motor reaches a ``flank``."""
    after = collide(x, 0.0, p)
    if flank * after[1] > RESTING_SPEED:
        return (after, flank)
    return play_reversed(stopped(after), flank, push_m, push)


def play_reversed(x: State, flank: int, push_m: float, push: float) -> tuple[State, int]:
    """Return state and contact of the play model at standstill: part, rest against the flank, or go on."""
    if flank * push_m <= 0.0:
        return (x, 0)
    return (x, flank if flank * push > 0.0 else 2 * flank)


def initial_contact(x: State, p: Parameters) -> int:
    """Return the flank at which a simulation starts."""
    if backlash_model(p) == NONE or (is_rigid(p) and p[P_ALPHA] == 0.0):
        return 1
    contact = contact_of(twist(x, p), p[P_ALPHA])
    if contact != 0 and teeth_never_pull(p):
        wound = twist(x, p) - contact * p[P_ALPHA]
        if contact * (shaft_stiffness(p) * wound + shaft_damping(p) * twist_rate(x, p)) < 0.0:
            return 0
    return contact


def consistent_start(x: State, p: Parameters) -> State:
    """Return the start state as the model can have it.

    A rigid gear cannot be wound beyond its gap: the load is moved to the flank. The play model's load stands
    still inside the gap. Teeth that never pull may part at once and then leave the shaft its twist.
    """
    model = int(p[P_MODEL])
    half = p[P_ALPHA]
    wound = twist(x, p)
    if model in (HYSTERESIS, RIGID_IMPACT):
        excess = wound - half if wound > half else wound + half if wound < -half else 0.0
        x = (x[0], x[1], x[2] + excess, x[3], x[4], x[5], x[6], 0.0)
        if half == 0.0:
            return collide(x, 0.0, p)
        return (x[0], x[1], x[2], 0.0, x[4], x[5], x[6], 0.0) if model == HYSTERESIS else x
    contact = contact_of(wound, half)
    if contact != 0 and teeth_never_pull(p) and initial_contact(x, p) == 0:
        return parted(x, parted_twist(x, contact, p))
    return parted(x, 0.0)
