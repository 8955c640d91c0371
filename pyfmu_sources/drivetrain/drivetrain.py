"""The drivetrain as the adapters and the orchestrator use it: prepare, start, advance, read.

A step of ``h`` seconds with held inputs goes to the exact linear solution when no nonlinear effect is on
(:mod:`linear_mode`), else to the hybrid machine (:mod:`smooth_mode`).

In all functions: ``h``: length of the step [s]; ``u``: requested torque [N.m], delayed and saturated already;
``T_l``: load torque [N.m]; ``table``: ``prepare(p, h)`` of the same ``p`` and ``h``.
"""

from math import exp

from ..hybrid.event_numbers import NO_EVENT, TOO_MUCH
from ..laws.backlash_models import NONE
from .contact import consistent_start, initial_contact
from .dry_friction import shaft_torque, slips
from .equations import (
    DEFAULTS,
    NONLINEAR,
    Mode,
    Parameters,
    State,
    backlash_model,
    contact_of,
    is_rigid,
    rates,
    twist,
    twist_rate,
)
from .linear_mode import law_of
from .linear_steps import Table, advance_linear, leap, linear_to_event
from .smooth_mode import advance_smooth, refused, smooth_to_event
from .transition import relaxation_rate, transition

__all__ = [
    "Mode", "Parameters", "State", "Table", "advance", "advance_to_event", "consistent_start", "contact_of",
    "has_nonlinear_effect", "initial_mode", "prepare", "rates", "reported_contact", "shaft_torque", "step_table",
    "twist", "twist_rate",
]  # fmt: skip


def has_nonlinear_effect(p: Parameters) -> bool:
    """Tell whether a parameter is off its default that the linear solution cannot carry."""
    for n in NONLINEAR:  # noqa: SIM110 - a generator is outside the subset
        if p[n] != DEFAULTS[n]:
            return True
    return False


def prepare(p: Parameters, h: float) -> Table:
    """Return what steps of ``h`` [s] need again and again: the transition matrices and the relaxation."""
    return step_table(p, h, has_nonlinear_effect(p))


def step_table(p: Parameters, h: float, nonlinear: bool) -> Table:
    """Return :func:`prepare` where it is known whether an effect is on that the linear solution cannot carry."""
    kappa = relaxation_rate(p)
    if nonlinear or is_rigid(p):
        row = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        none = (row, row, row, row, row)
        return (none, none, kappa, 0.0, nonlinear)
    touching = transition(law_of(1, p), p, h)
    free = transition(law_of(0, p), p, h)
    return (touching, free, kappa, exp(-kappa * h), nonlinear)


def initial_mode(x: State, p: Parameters) -> Mode:
    """Return the mode in which a simulation starts from ``x``."""
    contact = initial_contact(x, p)
    slip_m, slip_l = slips(x, contact, p, 0.0)
    return (contact, slip_m, slip_l)


def reported_contact(x: State, mode: Mode, p: Parameters) -> int:
    """Return the output ``contact``: the flank (-1, 0, 1) that touches; without a gap, that the shaft is wound to."""
    if backlash_model(p) != NONE:
        return 1 if mode[0] > 0 else -1 if mode[0] < 0 else 0
    return contact_of(twist(x, p), 0.0)


def advance(x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float, table: Table) -> tuple[State, Mode]:
    """Return state and mode after ``h`` [s], positive, with the inputs held."""
    if table[4]:
        return advance_smooth(x, mode, p, u, T_l, h)
    if not is_rigid(p):
        moved, clear = leap(x, mode[0], p, u, T_l + p.load_torque_torque, h, table)
        if clear:
            return (moved, mode)
    return advance_linear(x, mode, p, u, T_l + p.load_torque_torque, h, table[2])


def advance_to_event(
    x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float, table: Table
) -> tuple[State, Mode, float, int]:
    """Return :func:`advance` up to the first event, which has not had its effect yet.

    Returns:
        State, mode, how far it is [s], and the guard that ends the mode (``NO_EVENT``: none does).
    """
    if table[4]:
        return smooth_to_event(x, mode, p, u, T_l, h)
    if not is_rigid(p):
        moved, clear = leap(x, mode[0], p, u, T_l + p.load_torque_torque, h, table)
        if clear:
            return (moved, mode, h, NO_EVENT)
    x, elapsed, _, which = linear_to_event(x, mode[0], p, u, T_l + p.load_torque_torque, h, table[2], 0.0, 0)
    return (refused(x) if which == TOO_MUCH else x, mode, elapsed, which)
