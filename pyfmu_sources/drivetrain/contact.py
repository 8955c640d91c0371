"""What happens at a contact event: which mode follows, and how the state jumps.

In all functions: ``side``: flank, -1 or 1; ``flank``: that is reached, -1 or 1; ``push_m``: torque on the motor
without the shaft's [N.m]; ``push``: torque on motor and load as one body, load side [N.m]; ``held_m``: dry friction
that holds a motor at rest [N.m]; ``held``: dry friction, load side, that holds motor and load as one body [N.m].
"""

from ..laws.backlash_models import BOUNCING, HELD, NONE, RIGID
from ..laws.drive import UNASKED
from .bristles import resting_bristles
from .equations import (
    Parameters,
    State,
    backlash_model,
    contact_of,
    gear,
    is_rigid,
    load_inertia,
    shaft_damping,
    shaft_stiffness,
    teeth_never_pull,
    twist,
    twist_rate,
)

Start = tuple[float, float, float, float, float, float, float, float]

# Below this speed [rad/s] two rigid teeth stay together instead of bouncing for ever (Zeno).
RESTING_SPEED = 1e-6
MAX_BOUNCES = 200
# Rounding takes rigid teeth in contact less than this apart [rad, rad/s, relative]; a state handed in may be farther.
NOT_JOINED = 1e-9


def parted_twist(x: State, contact: int, p: Parameters) -> float:
    """Return the twist [rad] that a shaft keeps at the moment at which its teeth part at flank ``contact``.

    ``contact``: flank that touches: -1, 0 or 1; -2 or 2 where both bodies stand still against it.
    """
    damping = shaft_damping(p)
    if damping == 0.0 or shaft_stiffness(p) > 1e7 * damping:
        return 0.0
    return twist(x, p) - contact * p.alpha


def collide(x: State, restitution: float, p: Parameters) -> State:
    """Return the state after motor and load hit each other (eqs. 2.3 and 2.4): momentum is kept."""
    i = gear(x, p)
    mobility = 1.0 / (p.J_m * i * i) + 1.0 / load_inertia(x, p)
    impulse = (1.0 + restitution) * (x[1] / i - x[3]) / mobility
    omega_m = x[1] - impulse / (i * p.J_m)
    omega_l = x[3] + impulse / load_inertia(x, p)
    if restitution == 0.0:
        omega_l = omega_m / i
    return (x[0], omega_m, x[2], omega_l, x[4], x[5], x[6], x[7], x[8], x[9], x[10], x[11])


def on_flank(x: State, side: int, p: Parameters) -> State:
    """Return the state with the load moved to the flank ``side`` of rigid teeth and both at one speed."""
    theta_l = x[2] + twist(x, p) - side * p.alpha
    return collide((x[0], x[1], theta_l, x[3], x[4], x[5], x[6], 0.0, x[8], x[9], x[10], x[11]), 0.0, p)


def join_teeth(x: State, side: int, p: Parameters) -> State:
    """Return a state of rigid teeth in contact as it must be: at the flank and at one speed; mostly ``x`` itself."""
    apart = abs(twist(x, p) - side * p.alpha)
    sliding = abs(twist_rate(x, p))
    if apart <= NOT_JOINED * (1.0 + abs(x[2])) and sliding <= NOT_JOINED * (1.0 + abs(x[3])):
        return x
    return on_flank(x, side, p)


def part_teeth(x: State, wound: float) -> State:
    """Return the state with the twist ``wound`` [rad] left in the shaft, whose hysteresis starts anew."""
    return (x[0], x[1], x[2], x[3], x[4], x[5], x[6], wound, x[8], x[9], 0.0, x[11])


def stop_bodies(x: State) -> State:
    """Return the state with motor and load standing still."""
    return (x[0], 0.0, x[2], 0.0, x[4], x[5], x[6], x[7], x[8], x[9], x[10], x[11])


def after_event(
    x: State,
    contact: int,
    which: int,
    events: int,
    push_m: float,
    push: float,
    p: Parameters,
    held_m: float,
    held: float,
) -> tuple[State, int]:
    """Return state and contact after the guard ``which`` of ``contact`` has turned negative."""
    model = int(p.backlash_model)
    if contact == 0:
        flank = 1 if which == 0 else -1
        if model in HELD:
            return play_engaged(x, flank, push_m, push, p, held_m, held)
        if model in BOUNCING:
            closing = abs(x[1] / gear(x, p) - x[3])
            if closing > RESTING_SPEED and events < MAX_BOUNCES and p.restitution > 0.0:
                return (collide(x, p.restitution, p), 0)
            return (collide(x, 0.0, p), flank)
        return (part_teeth(x, 0.0), flank)
    if contact in (-2, 2):
        return (x, 0) if which == 0 else (x, contact // 2)
    if model in HELD:
        return play_reversed(stop_bodies(x), contact, push_m, push, held_m, held)
    if teeth_never_pull(p):
        return (part_teeth(x, parted_twist(x, contact, p)), 0)
    return (x, 0)


def play_engaged(
    x: State, flank: int, push_m: float, push: float, p: Parameters, held_m: float, held: float
) -> tuple[State, int]:
    """Return state and contact of the play model (eq. 2.5) when the motor reaches a ``flank``."""
    after = collide(x, 0.0, p)
    if flank * after[1] > RESTING_SPEED:
        return (after, flank)
    return play_reversed(stop_bodies(after), flank, push_m, push, held_m, held)


def play_reversed(x: State, flank: int, push_m: float, push: float, held_m: float, held: float) -> tuple[State, int]:
    """Return state and contact of the play model at standstill: part, rest against the flank, or go on."""
    if flank * push_m <= -held_m:
        return (x, 0)
    return (x, flank if flank * push > held else 2 * flank)


def initial_contact(x: State, p: Parameters) -> int:
    """Return the flank at which a simulation starts."""
    if backlash_model(p) == NONE or (is_rigid(p) and p.alpha == 0.0):
        return 1
    contact = contact_of(twist(x, p), p.alpha)
    if contact != 0 and is_rigid(p):
        # Rigid teeth that close or open are an event of the first step.
        return contact if x[1] == x[3] * gear(x, p) else 0
    if contact != 0 and teeth_never_pull(p):
        wound = twist(x, p) - contact * p.alpha
        if contact * (shaft_stiffness(p) * wound + shaft_damping(p) * twist_rate(x, p)) < 0.0:
            return 0
    return contact


def consistent_start(start: Start, p: Parameters) -> State:
    """Return the start state as the model can have it.

    A rigid gear cannot be wound beyond its gap: the load is moved to the flank. The play model's load stands
    still inside the gap. Teeth that never pull may part at once and then leave the shaft its twist. What is not part of
    the first eight entries (bristles, hysteresis, filter of the drive) starts at rest, so that they may be left out.
    """
    model = int(p.backlash_model)
    half = p.alpha
    x = (start[0], start[1], start[2], start[3], start[4], start[5], start[6], start[7], 0.0, 0.0, 0.0, UNASKED)
    wound = twist(x, p)
    if model in RIGID:
        excess = wound - half if wound > half else wound + half if wound < -half else 0.0
        x = (x[0], x[1], x[2] + excess, x[3], x[4], x[5], x[6], 0.0, x[8], x[9], x[10], x[11])
        if half == 0.0:
            return collide(x, 0.0, p)
        return (x[0], x[1], x[2], 0.0, x[4], x[5], x[6], 0.0, x[8], x[9], x[10], x[11]) if model in HELD else x
    contact = contact_of(wound, half)
    if contact != 0 and teeth_never_pull(p) and initial_contact(x, p) == 0:
        return resting_bristles(part_teeth(x, parted_twist(x, contact, p)), 0, p)
    return resting_bristles(part_teeth(x, 0.0), contact, p)
