"""Exact steps of the two-stage drivetrain: one product with a matrix, or a power series from event to event.

The method is that of :mod:`linear_mode`. Between two events ``x' = A x + b``, so the solution is a power series, in
which the next event is a root that is found without ever stepping over one. A short step without an event needs no
series.

In all functions: ``h``: length of the step [s]; ``u``: requested torque [N.m], delayed and saturated already; ``T_l``:
load torque [N.m]; ``torques``: what acts from outside, see :mod:`train_equations`; ``table``: ``prepare(p, h)`` of the
same ``p`` and ``h``; ``first``, ``second``: twists beyond the gaps [rad].
"""

from math import ceil, sqrt
from typing import Annotated

from .event_numbers import NO_EVENT, TOO_MUCH
from .linear_mode import TERMS, Series, first_root
from .linear_steps import MAX_EVENTS, MAX_PIECES, MAX_PIECES_PER_SECOND
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

# By what twists beyond the gaps (two), speeds (three), T_m, request and constant torques on the three bodies move a
# state in one step.
Row = tuple[float, float, float, float, float, float, float, float, float, float]
Transition = tuple[Row, Row, Row, Row, Row, Row, Row]
Columns = tuple[State, State, State, State, State, State, State, State, State, State]
# Without contact, with that of stage 1, of stage 2, of both; and whether a step is short enough for them.
Table = tuple[Transition, Transition, Transition, Transition, bool]
Coefficients = Annotated[list[State], TERMS + 1]

# A product with a matrix is for steps over which the bodies move smoothly: this times the fastest rate. Then the
# rates at both ends tell what happens between them.
SMOOTH = 2.0
# Pieces of a power series that making a matrix may take.
MOST_PIECES = 512.0


def fastest_rate(mode: Mode, p: Parameters) -> float:
    """Return a bound [1/s] on the rates of the three bodies in ``mode``, without that of the drive.

    The traces of both matrices bound their eigenvalues: stiffness and damping by the mobility that a stage works on.
    """
    first = 1.0 / (p.J_m * p.i_1 * p.i_1) + 1.0 / p.J_s if mode[0] != 0 else 0.0
    second = 1.0 / (p.J_s * p.i_2 * p.i_2) + 1.0 / p.J_l if mode[1] != 0 else 0.0
    friction = max(p.b_m / p.J_m, p.b_s / p.J_s, p.b_l / p.J_l)
    return sqrt(p.k_1 * first + p.k_2 * second) + p.c_1 * first + p.c_2 * second + friction


def taylor(x: State, constant: float, mode: Mode, p: Parameters, torques: Torques, step: float) -> Coefficients:
    """Return the coefficients of the state's power series, scaled so that time runs from 0 to 1 over ``step`` [s].

    Args:
        constant: 1; 0 leaves the gaps' offsets out.
    """
    coefficients: Coefficients = [x]
    term = x
    rate = linear_rates(x, constant, mode, p, torques)
    for n in range(1, TERMS + 1):
        f = step / n
        term = (f * rate[0], f * rate[1], f * rate[2], f * rate[3], f * rate[4], f * rate[5], f * rate[6])
        coefficients.append(term)
        rate = linear_rates(term, 0.0, mode, p, (0.0, 0.0, 0.0, 0.0))
    return coefficients


def evaluate(coefficients: Coefficients, time: float) -> State:
    """Return the state of a scaled power series at ``time`` in [0, 1]."""
    x = coefficients[TERMS]
    for n in range(TERMS - 1, -1, -1):
        term = coefficients[n]
        x = (
            term[0] + time * x[0], term[1] + time * x[1], term[2] + time * x[2], term[3] + time * x[3],
            term[4] + time * x[4], term[5] + time * x[5], term[6] + time * x[6],
        )  # fmt: skip
    return x


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


def column(start: State, mode: Mode, p: Parameters, torques: Torques, h: float) -> State:
    """Return what ``h`` [s] in one mode add to a start value, the gaps' offsets left out."""
    count = max(1, ceil(h * (fastest_rate(mode, p) + 1.0 / p.tau)))
    x = start
    for _ in range(count):
        x = evaluate(taylor(x, 0.0, mode, p, torques, h / count), 1.0)
    return (
        x[0] - start[0], x[1] - start[1], x[2] - start[2], x[3] - start[3], x[4] - start[4], x[5] - start[5],
        x[6] - start[6],
    )  # fmt: skip


def transition(contact_1: int, contact_2: int, p: Parameters, h: float) -> Transition:
    """Return the rows by which a step of ``h`` [s] moves the state while no contact changes and nothing sticks."""
    mode = (contact_1, contact_2, 1, 1, 1)
    none = (0.0, 0.0, 0.0, 0.0)
    rest = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    columns = (
        column((p.i_1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), mode, p, none, h),
        column((0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0), mode, p, none, h),
        column((0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0), mode, p, none, h),
        column((0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0), mode, p, none, h),
        column((0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0), mode, p, none, h),
        column((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0), mode, p, none, h),
        column(rest, mode, p, (1.0, 0.0, 0.0, 0.0), h),
        column(rest, mode, p, (0.0, 1.0, 0.0, 0.0), h),
        column(rest, mode, p, (0.0, 0.0, 1.0, 0.0), h),
        column(rest, mode, p, (0.0, 0.0, 0.0, 1.0), h),
    )
    return (
        row_of(columns, 0), row_of(columns, 1), row_of(columns, 2), row_of(columns, 3), row_of(columns, 4),
        row_of(columns, 5), row_of(columns, 6),
    )  # fmt: skip


def row_of(columns: Columns, n: int) -> Row:
    """Return the row ``n`` of columns."""
    return (
        columns[0][n], columns[1][n], columns[2][n], columns[3][n], columns[4][n], columns[5][n], columns[6][n],
        columns[7][n], columns[8][n], columns[9][n],
    )  # fmt: skip


def prepare(p: Parameters, h: float) -> Table:
    """Return the transitions of short steps of ``h`` [s]; longer ones go by power series alone."""
    rate = fastest_rate((1, 1, 1, 1, 1), p)
    if h * rate > SMOOTH or h / p.tau > MOST_PIECES:
        row = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        none = (row, row, row, row, row, row, row)
        return (none, none, none, none, False)
    return (transition(0, 0, p, h), transition(1, 0, p, h), transition(0, 1, p, h), transition(1, 1, p, h), True)


def change(row: Row, first: float, second: float, x: State, torques: Torques) -> float:
    """Return what a step adds to one state."""
    a, b, c, d, e, f, g, m, s, load = row
    moving = a * first + b * second + c * x[1] + d * x[3] + e * x[5] + f * x[6]
    return moving + (g * torques[0] + m * torques[1] + s * torques[2] + load * torques[3])


def multiply(rows: Transition, first: float, second: float, x: State, torques: Torques) -> State:
    """Return the state after one product with a transition matrix."""
    return (
        x[0] + change(rows[0], first, second, x, torques),
        x[1] + change(rows[1], first, second, x, torques),
        x[2] + change(rows[2], first, second, x, torques),
        x[3] + change(rows[3], first, second, x, torques),
        x[4] + change(rows[4], first, second, x, torques),
        x[5] + change(rows[5], first, second, x, torques),
        x[6] + change(rows[6], first, second, x, torques),
    )


def leap(x: State, mode: Mode, p: Parameters, torques: Torques, table: Table) -> State:
    """Return the state after a step in which no contact changes and nothing sticks."""
    first, second = twists(x, p)
    first -= mode[0] * p.alpha_1
    second -= mode[1] * p.alpha_2
    if mode[0] == 0 and mode[1] == 0:
        return multiply(table[0], first, second, x, torques)
    if mode[1] == 0:
        return multiply(table[1], first, second, x, torques)
    if mode[0] == 0:
        return multiply(table[2], first, second, x, torques)
    return multiply(table[3], first, second, x, torques)


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
    if table[4] and mode[2] != 0 and mode[3] != 0 and mode[4] != 0:
        torques = outside_torques(mode, p, u, T_l)
        after = leap(x, mode, p, torques, table)
        if is_clear(x, after, mode, p, torques, h):
            return (after, mode)
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
        x, mode = switch_mode(x, mode, which, p, T_l)
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
    if table[4] and mode[2] != 0 and mode[3] != 0 and mode[4] != 0:
        torques = outside_torques(mode, p, u, T_l)
        after = leap(x, mode, p, torques, table)
        if is_clear(x, after, mode, p, torques, h):
            return (after, mode, h, NO_EVENT)
    x, mode = settle_mode(x, mode, p, T_l)
    x, elapsed, _, which = series_to_event(x, mode, p, u, T_l, h, 0.0, 0)
    return (no_state() if which == TOO_MUCH else x, mode, elapsed, which)


def no_state() -> State:
    """Return the state that says that a step has no result: NaN throughout."""
    nan = float("nan")
    return (nan, nan, nan, nan, nan, nan, nan)


def series_to_event(
    x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float, elapsed: float, pieces: int
) -> tuple[State, float, int, int]:
    """Return the solution at its next event, or at the end of a step.

    Args:
        elapsed: time since the beginning of the step at which ``x`` is [s].
        pieces: of the step that power series have taken so far.

    Returns:
        State, time since the beginning of the step [s], pieces, and the guard (``NO_EVENT``: none).
    """
    most = MAX_PIECES + int(MAX_PIECES_PER_SECOND * h)
    torques = outside_torques(mode, p, u, T_l)
    longest = 1.0 / (fastest_rate(mode, p) + 1.0 / p.tau)
    while elapsed < h:
        if pieces >= most:
            return (x, elapsed, pieces, TOO_MUCH)
        pieces += 1
        step = h - elapsed
        last = step <= longest
        if not last:
            step = longest
        coefficients = taylor(x, 1.0, mode, p, torques, step)
        time, which = first_event(coefficients, mode, p, T_l)
        x = evaluate(coefficients, time)
        elapsed += time * step
        if which != NO_EVENT:
            return (x, elapsed, pieces, which)
        if last:
            break
    return (x, h, pieces, NO_EVENT)
