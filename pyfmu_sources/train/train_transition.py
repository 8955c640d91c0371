"""What steps of the two-stage drivetrain are made of: a power series within one mode, and the matrices made with it.

In all functions: ``constant``: 1; 0 leaves the gaps' offsets out; ``h``: length of the step [s]; ``torques``: what acts
from outside, see :mod:`train_equations`; ``first``, ``second``: twists beyond the gaps [rad].
"""

from math import ceil, sqrt
from typing import Annotated

from ..drivetrain.linear_mode import TERMS
from ..laws.parameter_rows import TINY
from .train_equations import Mode, Parameters, State, Torques, linear_rates

# By what twists beyond the gaps (two), speeds (three), T_m, request and constant torques on the three bodies move a
# state in one step.
Row = Annotated[tuple[float, ...], 10]
Transition = Annotated[tuple[Row, ...], 7]
# Without contact, with that of stage 1, of stage 2, of both; for how many equal parts of a step (0: none are made).
Table = tuple[Transition, Transition, Transition, Transition, int]
Coefficients = Annotated[list[State], TERMS + 1]


# A product with a matrix is for parts of a step over which the bodies move smoothly: this times the fastest rate. Then
# the rates at both ends tell what happens between them.
SMOOTH = 2.0
MOST_PARTS = 100.0
# A torque is what is asked for when it is this near [N.m, relative]: below all rounding.
REACHED_TORQUE = 1e-17


def fastest_rate(mode: Mode, p: Parameters) -> float:
    """Return a bound [1/s] on the rates of the three bodies in ``mode``, without that of the drive.

    The traces of both matrices bound their eigenvalues: stiffness and damping by the mobility that a stage works on.
    """
    first = 1.0 / (p.J_m * p.i_1 * p.i_1) + 1.0 / p.J_s if mode[0] != 0 else 0.0
    second = 1.0 / (p.J_s * p.i_2 * p.i_2) + 1.0 / p.J_l if mode[1] != 0 else 0.0
    friction = max(p.b_m / p.J_m, p.b_s / p.J_s, p.b_l / p.J_l)
    return sqrt(p.k_1 * first + p.k_2 * second) + p.c_1 * first + p.c_2 * second + friction


def longest_piece(x: State, mode: Mode, p: Parameters, u: float) -> float:
    """Return over how long [s] a power series holds; a drive that has reached its request has no rate."""
    rate = fastest_rate(mode, p)
    return 1.0 / max(TINY, rate if x[6] == u else rate + 1.0 / p.tau)


def at_request(x: State, u: float) -> State:
    """Return the state with the torque that is asked for if it is as good as reached."""
    if abs(x[6] - u) > REACHED_TORQUE * (1.0 + abs(u)):
        return x
    return (x[0], x[1], x[2], x[3], x[4], x[5], u)


def taylor(x: State, constant: float, mode: Mode, p: Parameters, torques: Torques, step: float) -> Coefficients:
    """Return the coefficients of the state's power series, scaled so that time runs from 0 to 1 over ``step`` [s]."""
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


def column(start: State, mode: Mode, p: Parameters, torques: Torques, h: float) -> State:
    """Return what ``h`` [s] in one mode add to a start value, the gaps' offsets left out."""
    x = start
    left = h
    while left > 0.0:
        step = min(left, longest_piece(x, mode, p, torques[0]))
        x = at_request(evaluate(taylor(x, 0.0, mode, p, torques, step), 1.0), torques[0])
        left -= step
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
    return tuple(tuple(columns[m][n] for m in range(10)) for n in range(7))


def prepare(p: Parameters, h: float) -> Table:
    """Return the transitions of a part of a step; a step of too many parts goes by power series alone."""
    parts = max(1.0, ceil(h * fastest_rate((1, 1, 1, 1, 1), p) / SMOOTH))
    if parts > MOST_PARTS:
        none = tuple(tuple(0.0 for m in range(10)) for n in range(7))
        return (none, none, none, none, 0)
    part = h / parts
    return (
        transition(0, 0, p, part),
        transition(1, 0, p, part),
        transition(0, 1, p, part),
        transition(1, 1, p, part),
        int(parts),
    )


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
