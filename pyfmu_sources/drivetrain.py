"""The drivetrain as the adapters and the orchestrator use it: prepare, start, advance, read.

A step of ``h`` seconds with held inputs goes to the exact linear solution when no nonlinear effect is on
(:mod:`linear_mode`), else to the integrator with event location (:mod:`smooth_mode`).
"""

from math import exp

from .backlash_models import NEVER_PULLING
from .bristles import has_friction_l, has_friction_m
from .contact import after_event, consistent_start, initial_contact
from .drive_request import UNASKED, ramp_end, ramp_target, ramp_time
from .drivetrain_parameters import (
    BIG,
    NONE,
    P_ALPHA,
    P_B_L,
    P_B_M,
    P_CUBIC,
    P_DIRECTION_L,
    P_DIRECTION_M,
    P_DRAG,
    P_ECC,
    P_FILTER,
    P_GRAVITY,
    P_HYSTERESIS,
    P_I,
    P_J_WAVE,
    P_K_WAVE,
    P_LOAD_TORQUE,
    P_ONSET,
    P_RATE,
    P_RES_J,
    P_RIPPLE,
    P_RIPPLE_2,
    P_RIPPLE_3,
    P_SPRING,
    P_SPRING_CUBIC,
    P_STOP_LOWER,
    P_STOP_UPPER,
)
from .dry_friction import shaft_torque, slips
from .equations import (
    Mode,
    Parameters,
    State,
    backlash_model,
    contact_of,
    is_rigid,
    rates,
    shaft_damping,
    shaft_stiffness,
    twist,
    twist_rate,
)
from .linear_mode import Transition, evaluate, first_event, law_of, taylor
from .smooth_mode import advance_smooth, refused
from .transition import fastest_rate, relaxation_rate, transition

__all__ = [
    "Mode",
    "Parameters",
    "State",
    "Table",
    "advance",
    "consistent_start",
    "contact_of",
    "has_nonlinear_effect",
    "initial_mode",
    "prepare",
    "rates",
    "reported_contact",
    "shaft_torque",
    "twist",
    "twist_rate",
]

# Transitions with and without contact, relaxation of a parted shaft (rate, and factor of a step), whether nonlinear.
Table = tuple[Transition, Transition, float, float, bool]

# Work that one communication step may take, and how much more for each second of it; see ``smooth_mode``.
MAX_EVENTS = 5000
MAX_PIECES = 1000
MAX_PIECES_PER_SECOND = 20000.0
NEGLIGIBLE_TWIST = 1e-18


def has_nonlinear_effect(p: Parameters) -> bool:
    """Tell whether an effect is on that the linear solution cannot carry.

    Args:
        p: parameters, in the order of the FMU's table.

    Returns:
        True when one is.
    """
    friction = has_friction_m(p) or has_friction_l(p) or p[P_DIRECTION_M] != 0.0 or p[P_DIRECTION_L] != 0.0
    ripples = abs(p[P_RIPPLE]) + abs(p[P_RIPPLE_2]) + abs(p[P_RIPPLE_3]) + abs(p[P_ECC]) + abs(p[P_GRAVITY])
    shaft = p[P_CUBIC] + abs(p[P_K_WAVE]) + p[P_HYSTERESIS] + p[P_ONSET]
    load = p[P_RES_J] + p[P_DRAG] + abs(p[P_SPRING]) + abs(p[P_SPRING_CUBIC]) + abs(p[P_J_WAVE])
    stops = p[P_STOP_LOWER] > -BIG or p[P_STOP_UPPER] < BIG
    return friction or stops or p[P_RATE] < BIG or ripples + shaft + load + p[P_FILTER] > 0.0


def prepare(p: Parameters, h: float) -> Table:
    """Return what steps of ``h`` [s] need again and again: the transition matrices and the relaxation.

    Args:
        p: parameters, in the order of the FMU's table.
        h: length of the step [s].

    Returns:
        Transition matrices with and without contact, rate and decay of a parted shaft, and whether an effect is on.
    """
    kappa = relaxation_rate(p)
    nonlinear = has_nonlinear_effect(p)
    if nonlinear or is_rigid(p):
        row = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        none = (row, row, row, row, row)
        return (none, none, kappa, 0.0, nonlinear)
    touching = transition(law_of(1, p), p, h)
    free = transition(law_of(0, p), p, h)
    return (touching, free, kappa, exp(-kappa * h), nonlinear)


def initial_mode(x: State, p: Parameters) -> Mode:
    """Return the mode in which a simulation starts from ``x``.

    Args:
        x: state, as in ``equations``.
        p: parameters, in the order of the FMU's table.

    Returns:
        The mode.
    """
    contact = initial_contact(x, p)
    slip_m, slip_l = slips(x, contact, p, 0.0)
    return (contact, slip_m, slip_l)


def reported_contact(x: State, mode: Mode, p: Parameters) -> int:
    """Return the output ``contact``: the flank that touches; without a gap, the one the shaft is wound to.

    Args:
        x: state, as in ``equations``.
        mode: contact, and the directions in which motor and load slide.
        p: parameters, in the order of the FMU's table.

    Returns:
        -1, 0 or 1.
    """
    if backlash_model(p) != NONE:
        return 1 if mode[0] > 0 else -1 if mode[0] < 0 else 0
    return contact_of(twist(x, p), 0.0)


def advance(x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float, table: Table) -> tuple[State, Mode]:
    """Return state and mode after ``h`` [s] with the inputs held.

    Args:
        x: state.
        mode: mode, from :func:`initial_mode` or the step before.
        p: parameters.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].
        h: step [s], positive.
        table: ``prepare(p, h)`` of the same ``p`` and ``h``.

    Returns:
        Both.
    """
    if table[4]:
        if x[11] == UNASKED and (p[P_FILTER] > 0.0 or p[P_RATE] < BIG):
            x = (x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], x[10], u)
        if p[P_RATE] < BIG:
            return advance_ramp(x, mode, p, u, T_l, h)
        return advance_smooth(x, mode, p, u, T_l, h)
    if not is_rigid(p):
        moved, clear = leap(x, mode[0], p, u, T_l + p[P_LOAD_TORQUE], h, table)
        if clear:
            return (moved, mode)
    return advance_linear(x, mode, p, u, T_l + p[P_LOAD_TORQUE], h, table[2])


def advance_ramp(x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float) -> tuple[State, Mode]:
    """Return state and mode after ``h`` [s] of a drive limited in its rate; the end of a ramp is met exactly.

    Args:
        x: state, as in ``equations``.
        mode: contact, and the directions in which motor and load slide.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].
        h: length of the step [s].

    Returns:
        Both.
    """
    before = x[11]
    ramp = min(h, ramp_time(before, u, p[P_FILTER], p[P_RATE]))
    if ramp > 0.0:
        x, mode = advance_smooth(x, mode, p, ramp_target(before, u, p[P_FILTER], p[P_RATE], ramp), T_l, ramp)
    if ramp < h:
        if ramp > 0.0:
            end = ramp_end(before, u, p[P_FILTER], p[P_RATE])
            x = (x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7], x[8], x[9], x[10], end)
        x, mode = advance_smooth(x, mode, p, u, T_l, h - ramp)
    return (x, mode)


def leap(x: State, contact: int, p: Parameters, u: float, T_l: float, h: float, table: Table) -> tuple[State, bool]:
    """Return the state after one product with the transition matrix, and whether no event can lie inside.

    An event is ruled out when both ends are farther from it than the speeds at both ends could carry.

    Args:
        x: state, as in ``equations``.
        contact: flank that touches: -1, 0 or 1; -2 or 2 where both bodies stand still against it.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].
        h: length of the step [s].
        table: ``prepare(p, h)`` of the same ``p`` and ``h``.

    Returns:
        Both.
    """
    i = p[P_I]
    model = backlash_model(p)
    offset = 0.0 if model == NONE else contact * p[P_ALPHA]
    rows = table[1] if contact == 0 else table[0]
    theta_m, omega_m, theta_l, omega_l, T_m = x[0], x[1], x[2], x[3], x[4]
    wound = theta_m / i - theta_l - offset
    a, b, c, d, e, f = rows[0]
    theta_m += a * wound + b * omega_m + c * omega_l + d * T_m + e * u + f * T_l
    a, b, c, d, e, f = rows[2]
    theta_l += a * wound + b * omega_m + c * omega_l + d * T_m + e * u + f * T_l
    a, b, c, d, e, f = rows[1]
    next_m = omega_m + (a * wound + b * omega_m + c * omega_l + d * T_m + e * u + f * T_l)
    a, b, c, d, e, f = rows[3]
    next_l = omega_l + (a * wound + b * omega_m + c * omega_l + d * T_m + e * u + f * T_l)
    lag = rows[4]
    left = x[7] * table[3]
    if abs(left) < NEGLIGIBLE_TWIST:
        left = 0.0
    moved = (
        theta_m,
        next_m,
        theta_l,
        next_l,
        T_m + (lag[3] * T_m + lag[4] * u),
        x[5],
        x[6],
        left,
        x[8],
        x[9],
        x[10],
        x[11],
    )
    if model == NONE:
        return (moved, True)
    wound_next = theta_m / i - theta_l - offset
    speed = omega_m / i - omega_l
    speed_next = next_m / i - next_l
    reach = h * (abs(speed) + abs(speed_next))
    if contact == 0:
        room = p[P_ALPHA] - max(abs(wound), abs(wound_next))
        return (moved, room > reach + 2.0 * abs(x[7]))
    if model not in NEVER_PULLING:
        return (moved, min(contact * wound, contact * wound_next) > reach)
    stiffness = shaft_stiffness(p)
    damping = shaft_damping(p)
    torque = contact * (stiffness * wound + damping * speed)
    torque_next = contact * (stiffness * wound_next + damping * speed_next)
    swing = stiffness * reach + 2.0 * damping * abs(speed_next - speed)
    return (moved, min(torque, torque_next) > swing)


def advance_linear(
    x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float, kappa: float
) -> tuple[State, Mode]:
    """Return state and mode after ``h`` [s] of the exact linear solution, events located; NaN for too much work.

    Args:
        x: state, as in ``equations``.
        mode: contact, and the directions in which motor and load slide.
        p: parameters, in the order of the FMU's table.
        u: requested torque [N.m], delayed and saturated already.
        T_l: load torque [N.m].
        h: length of the step [s].
        kappa: rate at which a parted shaft unwinds [1/s].

    Returns:
        Both.
    """
    contact = mode[0]
    elapsed = 0.0
    events = 0
    pieces = 0
    most = MAX_PIECES + int(MAX_PIECES_PER_SECOND * h)
    while elapsed < h:
        if events >= MAX_EVENTS or pieces >= most:
            return (refused(x), mode)
        pieces += 1
        law = law_of(contact, p)
        unwinding = kappa if x[7] != 0.0 else 0.0
        step = h - elapsed
        longest = 1.0 / (fastest_rate(law, p) + unwinding)
        last = step <= longest
        if not last:
            step = longest
        start = (x[0], x[1], x[2], x[3], x[4], x[7])
        coefficients = taylor(start, law, p, u, T_l, step, unwinding)
        time, which = first_event(coefficients, contact, p, u, T_l)
        a, b, c, d, e, left = evaluate(coefficients, time)
        left = left if abs(left) >= NEGLIGIBLE_TWIST else 0.0
        x = (a, b, c, d, e, x[5], x[6], left, x[8], x[9], x[10], x[11])
        elapsed += time * step
        if which >= 0:
            push_m = x[4] - p[P_B_M] * x[1]
            push = p[P_I] * push_m - p[P_B_L] * x[3] - T_l
            x, contact = after_event(x, contact, which, events, push_m, push, p, 0.0, 0.0)
            events += 1
        elif last:
            break
    return (x, (contact, mode[1], mode[2]))
