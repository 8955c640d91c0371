"""The transition matrix of a linear mode: a step without an event is one product with it.

In all functions: ``h``: length of the step [s].
"""

from math import ceil, sqrt

from .equations import Parameters, shaft_damping, shaft_stiffness, teeth_never_pull
from .linear_mode import Law, Row, State6, Transition, evaluate, taylor

# A law so stiff that a step would need more Taylor steps than this is brought over it by doubling a shorter one.
MOST_PIECES = 512.0
MOST_DOUBLINGS = 200


def fastest_rate(law: Law, p: Parameters) -> float:
    """Return a bound [1/s] on the rates of the linear law, by which Taylor steps are scaled."""
    mobility = 1.0 / p.J_l + 1.0 / (p.J_m * p.i * p.i)
    friction = p.b_m / p.J_m + p.b_l / p.J_l + 1.0 / p.tau
    return sqrt(law[1] * mobility) + law[2] * mobility + friction


def relaxation_rate(p: Parameters) -> float:
    """Return the rate [1/s] at which a parted shaft unwinds; zero where it does so at once or has none."""
    damping = shaft_damping(p)
    stiffness = shaft_stiffness(p)
    if not teeth_never_pull(p) or damping == 0.0 or stiffness > 1e7 * damping:
        return 0.0
    return stiffness / damping


def column(x: State6, start: State6) -> Row:
    """Return what a unit start value has added to each state."""
    return (x[0] - start[0], x[1] - start[1], x[2] - start[2], x[3] - start[3], x[4] - start[4], 0.0)


def propagate(x: State6, law: Law, p: Parameters, u: float, T_l: float, h: float) -> State6:
    """Return the state after ``h`` [s] in one linear mode, whatever its guards say, under ``u`` and ``T_l`` [N.m]."""
    count = max(1, ceil(h * fastest_rate(law, p)))
    for _ in range(count):
        x = evaluate(taylor(x, law, p, u, T_l, h / count, 0.0), 1.0)
    return x


def transition(law: Law, p: Parameters, h: float) -> Transition:
    """Return the five rows by which ``(twist, omega_m, omega_l, T_m, u, T_l)`` moves the state in ``h`` [s]."""
    free = (law[0], law[1], law[2], 0.0)
    doublings = 0
    while h * fastest_rate(law, p) > MOST_PIECES and doublings < MOST_DOUBLINGS:
        h *= 0.5
        doublings += 1
    zero = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    wound = (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)
    motor = (0.0, 1.0, 0.0, 0.0, 0.0, 0.0)
    load = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0)
    torque = (0.0, 0.0, 0.0, 0.0, 1.0, 0.0)
    a = column(propagate(wound, free, p, 0.0, 0.0, h), wound)
    b = column(propagate(motor, free, p, 0.0, 0.0, h), motor)
    c = column(propagate(load, free, p, 0.0, 0.0, h), load)
    d = column(propagate(torque, free, p, 0.0, 0.0, h), torque)
    e = column(propagate(zero, free, p, 1.0, 0.0, h), zero)
    f = column(propagate(zero, free, p, 0.0, 1.0, h), zero)
    rows = tuple((a[n], b[n], c[n], d[n], e[n], f[n]) for n in range(5))
    for _ in range(doublings):
        rows = double_step(rows, p.i)
    return rows


def double_step(rows: Transition, i: float) -> Transition:
    """Return the transition rows of two steps in a row: a stiff law needs too many Taylor steps for one."""
    wound = add(scale(rows[0], 1.0 / i), scale(rows[2], -1.0))
    return tuple(add(rows[n], followed(rows[n], wound, rows[1], rows[3], rows[4])) for n in range(5))


def scale(row: Row, f: float) -> Row:
    """Return ``f row``."""
    return (f * row[0], f * row[1], f * row[2], f * row[3], f * row[4], f * row[5])


def add(a: Row, b: Row) -> Row:
    """Return ``a + b``."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5])


def followed(row: Row, wound: Row, motor: Row, load: Row, torque: Row) -> Row:
    """Return what ``row`` of a second step adds, which starts where a step with the given rows has ended."""
    moved = add(add(scale(wound, row[0]), scale(motor, row[1])), add(scale(load, row[2]), scale(torque, row[3])))
    return add(row, moved)
