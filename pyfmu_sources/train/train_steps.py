"""Exact steps of the two-stage drivetrain: one product with a matrix, or a power series from event to event.

The method is that of :mod:`linear_mode`. Between two events ``x' = A x + b``, so the solution is a power series, in
which the next event is a root that is found without ever stepping over one. A short step without an event needs no
series.

In all functions: ``h``: length of the step [s]; ``u``: requested torque [N.m], delayed and saturated already; ``T_l``:
load torque [N.m]; ``torques``: what acts from outside, see :mod:`train_equations`; ``table``: ``prepare(p, h)`` of the
same ``p`` and ``h``.
"""

from ..drivetrain.linear_mode import TERMS, Series, first_root
from ..drivetrain.linear_steps import MAX_EVENTS, MAX_PIECES, MAX_PIECES_PER_SECOND
from ..hybrid.event_numbers import NO_EVENT, TOO_MUCH
from .train_equations import (
    Mode,
    Parameters,
    State,
    Torques,
    friction_levels,
    half_gaps,
    linear_rates,
    outside_torques,
    twists,
)
from .train_modes import GUARDS, guard, guard_room, is_in_use, settle_mode, switch_mode
from .train_transition import Coefficients, Table, at_request, evaluate, longest_piece, multiply, taylor


def first_event(coefficients: Coefficients, mode: Mode, p: Parameters, T_l: float) -> tuple[float, int]:
    """Return (time in [0, 1], guard) of the first event of a scaled power series, or (1, ``NO_EVENT``)."""
    earliest = 1.0
    which = NO_EVENT
    for candidate in range(GUARDS):
        if not is_in_use(mode, candidate, p):
            continue
        room = guard_room(coefficients[0], mode, candidate, p)
        series: Series = [guard(coefficients[0], 1.0, mode, candidate, p, T_l) + room]
        for n in range(1, TERMS + 1):
            series.append(guard(coefficients[n], 0.0, mode, candidate, p, T_l))
        time = first_root(series, earliest, room)
        if time < earliest:
            earliest = time
            which = candidate
    return (earliest, which)


def leap(x: State, mode: Mode, p: Parameters, u: float, T_l: float, part: float, table: Table) -> tuple[State, bool]:
    """Return the state ``part`` [s] later by one product with a matrix, and whether no event can lie inside."""
    if table[4] == 0 or mode[2] == 0 or mode[3] == 0 or mode[4] == 0:
        return (x, False)
    torques = outside_torques(mode, p, u, T_l)
    first, second = twists(x, p)
    first -= mode[0] * p.alpha_1
    second -= mode[1] * p.alpha_2
    if mode[0] == 0 and mode[1] == 0:
        after = multiply(table[0], first, second, x, torques)
    elif mode[1] == 0:
        after = multiply(table[1], first, second, x, torques)
    elif mode[0] == 0:
        after = multiply(table[2], first, second, x, torques)
    else:
        after = multiply(table[3], first, second, x, torques)
    return (after, is_clear(x, after, mode, p, torques, part))


def is_clear(x: State, after: State, mode: Mode, p: Parameters, torques: Torques, h: float) -> bool:
    """Tell whether no event can lie inside a short step: both its ends are farther from each than motion carries."""
    r = linear_rates(x, 1.0, mode, p, torques)
    s = linear_rates(after, 1.0, mode, p, torques)
    twist, twist_after = twists(x, p), twists(after, p)
    speed, speed_after = twists(r, p), twists(s, p)
    bends = twists((r[1], 0.0, r[3], 0.0, r[5], 0.0, 0.0), p)
    bends_after = twists((s[1], 0.0, s[3], 0.0, s[5], 0.0, 0.0), p)
    alpha = half_gaps(p)
    for n in range(2):
        if alpha[n] > 0.0:
            reach = h * (abs(speed[n]) + abs(speed_after[n])) + 0.25 * h * h * (abs(bends[n]) + abs(bends_after[n]))
            room = alpha[n] - max(abs(twist[n]), abs(twist_after[n]))
            if mode[n] != 0:
                room = min(mode[n] * twist[n], mode[n] * twist_after[n]) - alpha[n]
            if room <= reach:
                return False
    level = friction_levels(p)
    for n in range(3):
        if level[n] > 0.0:
            place = 2 * n + 1
            slide = min(mode[2 + n] * x[place], mode[2 + n] * after[place])
            if slide <= h * (abs(r[place]) + abs(s[place])):
                return False
    return True


def advance(x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float, table: Table) -> tuple[State, Mode]:
    """Return state and mode after ``h`` [s], positive, with the inputs held; NaN where it takes too much work."""
    if table[4] == 0:
        return advance_series(x, mode, p, u, T_l, h)
    part = h / table[4]
    for _ in range(table[4]):
        after, clear = leap(x, mode, p, u, T_l, part, table)
        if clear:
            x = after
        else:
            x, mode = advance_series(x, mode, p, u, T_l, part)
    return (x, mode)


def advance_series(x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float) -> tuple[State, Mode]:
    """Return :func:`advance` by power series, from event to event."""
    elapsed = 0.0
    events = 0
    pieces = 0
    x, mode = settle_mode(x, mode, p, T_l)
    while elapsed < h:
        x, elapsed, pieces, which = series_to_event(x, mode, p, u, T_l, h, elapsed, pieces)
        if which == TOO_MUCH or events >= MAX_EVENTS:
            return (no_state(), mode)
        if which == NO_EVENT:
            return (x, mode)
        x, mode = switch_mode(x, mode, which)
        x, mode = settle_mode(x, mode, p, T_l)
        events += 1
    return (x, mode)


def advance_to_event(
    x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float, table: Table
) -> tuple[State, Mode, float, int]:
    """Return :func:`advance` up to the first event, which has not had its effect yet.

    Returns:
        State, mode, how far it is [s], and the guard that ends the mode (``NO_EVENT``: none does).
    """
    parts = max(1, table[4])
    part = h / parts
    for n in range(parts):
        after, clear = leap(x, mode, p, u, T_l, part, table)
        if clear:
            x = after
            continue
        x, mode = settle_mode(x, mode, p, T_l)
        x, elapsed, _, which = series_to_event(x, mode, p, u, T_l, part, 0.0, 0)
        if which != NO_EVENT:
            return (no_state() if which == TOO_MUCH else x, mode, n * part + elapsed, which)
    return (x, mode, h, NO_EVENT)


def no_state() -> State:
    """Return the state that says that a step has no result: NaN throughout."""
    nan = float("nan")
    return (nan, nan, nan, nan, nan, nan, nan)


def series_to_event(
    x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float, elapsed: float, pieces: int
) -> tuple[State, float, int, int]:
    """Return the solution at its next event, or at the end of a step.

    ``elapsed``: time since the beginning of the step at which ``x`` is [s]; ``pieces``: of the step that power series
    have taken so far.

    Returns:
        State, time since the beginning of the step [s], pieces, and the guard (``NO_EVENT``: none).
    """
    most = MAX_PIECES + int(MAX_PIECES_PER_SECOND * h)
    torques = outside_torques(mode, p, u, T_l)
    while elapsed < h:
        if pieces >= most:
            return (x, elapsed, pieces, TOO_MUCH)
        pieces += 1
        longest = longest_piece(x, mode, p, u)
        step = h - elapsed
        last = step <= longest
        if not last:
            step = longest
        coefficients = taylor(x, 1.0, mode, p, torques, step)
        time, which = first_event(coefficients, mode, p, T_l)
        x = at_request(evaluate(coefficients, time), u)
        elapsed += time * step
        if which != NO_EVENT:
            return (x, elapsed, pieces, which)
        if last:
            break
    return (x, h, pieces, NO_EVENT)
