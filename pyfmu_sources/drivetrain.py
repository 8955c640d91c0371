"""The drivetrain as the adapters and the orchestrator use it: prepare, start, advance, read.

A step of ``h`` seconds with held inputs goes to the exact linear solution when no nonlinear effect is on
(:mod:`linear_mode`), else to the integrator with event location (:mod:`smooth_mode`).
"""

from math import exp

from .contact import after_event, consistent_start, initial_contact
from .drivetrain_parameters import (
    DEAD_ZONE,
    NONE,
    P_ALPHA,
    P_B_L,
    P_B_M,
    P_BREAKAWAY_L,
    P_BREAKAWAY_M,
    P_COULOMB_L,
    P_COULOMB_M,
    P_CUBIC,
    P_DRAG,
    P_ECC,
    P_GRAVITY,
    P_I,
    P_LOAD_TORQUE,
    P_RES_J,
    P_RIPPLE,
    P_STRIBECK_L,
    P_STRIBECK_M,
)
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
    shaft_torque,
    twist,
    twist_rate,
)
from .linear_mode import (
    Transition,
    evaluate,
    fastest_rate,
    first_event,
    law_of,
    propagate,
    relaxation_rate,
    taylor,
    transition,
)
from .smooth_mode import advance_smooth, initial_slip

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

Table = tuple[Transition, Transition, float, float]

MAX_EVENTS = 5000
NEGLIGIBLE_TWIST = 1e-18


def has_nonlinear_effect(p: Parameters) -> bool:
    """Tell whether an effect is on that the linear solution cannot carry."""
    friction = p[P_COULOMB_M] + p[P_COULOMB_L] + p[P_STRIBECK_M] + p[P_STRIBECK_L]
    friction += p[P_BREAKAWAY_M] + p[P_BREAKAWAY_L]
    periodic = abs(p[P_RIPPLE]) + abs(p[P_ECC]) + abs(p[P_GRAVITY])
    return friction + periodic + p[P_CUBIC] + p[P_RES_J] + p[P_DRAG] > 0.0


def prepare(p: Parameters, h: float) -> Table:
    """Return what steps of ``h`` [s] need again and again: the transition matrices and the relaxation."""
    kappa = relaxation_rate(p)
    if has_nonlinear_effect(p) or is_rigid(p):
        row = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        none = (row, row, row, row, row)
        return (none, none, kappa, 0.0)
    touching = transition(law_of(1, p), p, h)
    free = transition(law_of(0, p), p, h)
    return (touching, free, kappa, exp(-kappa * h))


def initial_mode(x: State, p: Parameters) -> Mode:
    """Return the mode in which a simulation starts from ``x``."""
    contact = initial_contact(x, p)
    slip_m, slip_l = initial_slip(x, contact, p)
    return (contact, slip_m, slip_l)


def reported_contact(x: State, mode: Mode, p: Parameters) -> int:
    """Return the output ``contact``: the flank that touches; without a gap, the one the shaft is wound to."""
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
    """
    if has_nonlinear_effect(p):
        return advance_smooth(x, mode, p, u, T_l, h)
    if not is_rigid(p):
        moved, clear = leap(x, mode[0], p, u, T_l + p[P_LOAD_TORQUE], h, table)
        if clear:
            return (moved, mode)
    return advance_linear(x, mode, p, u, T_l + p[P_LOAD_TORQUE], h, table[2])


def leap(x: State, contact: int, p: Parameters, u: float, T_l: float, h: float, table: Table) -> tuple[State, bool]:
    """Return the state after one product with the transition matrix, and whether no event can lie inside.

    An event is ruled out when both ends are farther from it than the speeds at both ends could carry.
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
    moved = (theta_m, next_m, theta_l, next_l, T_m + (lag[3] * T_m + lag[4] * u), x[5], x[6], left)
    if model == NONE:
        return (moved, True)
    wound_next = theta_m / i - theta_l - offset
    speed = omega_m / i - omega_l
    speed_next = next_m / i - next_l
    reach = h * (abs(speed) + abs(speed_next))
    if contact == 0:
        room = p[P_ALPHA] - max(abs(wound), abs(wound_next))
        return (moved, room > reach + 2.0 * abs(x[7]))
    if model == DEAD_ZONE:
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
    """Return state and mode after ``h`` [s] of the exact linear solution, every contact event located."""
    contact = mode[0]
    elapsed = 0.0
    events = 0
    while elapsed < h and events < MAX_EVENTS:
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
        x = (a, b, c, d, e, x[5], x[6], left if abs(left) >= NEGLIGIBLE_TWIST else 0.0)
        elapsed += time * step
        if which >= 0:
            push_m = x[4] - p[P_B_M] * x[1]
            push = p[P_I] * push_m - p[P_B_L] * x[3] - T_l
            x, contact = after_event(x, contact, which, events, push_m, push, p)
            events += 1
        elif last:
            return (x, (contact, mode[1], mode[2]))
    a, b, c, d, e, _ = propagate((x[0], x[1], x[2], x[3], x[4], 0.0), law_of(contact, p), p, u, T_l, h - elapsed)
    return ((a, b, c, d, e, x[5], x[6], x[7]), (contact, mode[1], mode[2]))
