"""One step of Dormand and Prince's method of order 5(4) inside a smooth mode of the drivetrain.

Source: Dormand and Prince, J. Comput. Appl. Math. 6, 1980. The torque of a drive that follows a held request has a
closed form, from which stages take it: a drive that is far quicker than its machine asks for no short steps.

In all functions: ``u``: requested torque [N.m], delayed and saturated already; ``T_l``: load torque [N.m]; ``h``:
length of the step [s].
"""

from math import exp, sqrt

from ..laws.friction import bristle_sign, builds_up
from ..laws.parameter_rows import BIG
from .bristles import carried_l, carried_m
from .equations import Mode, Parameters, State, load_friction, motor_friction, rates

RELATIVE_TOLERANCE = 1e-11
ABSOLUTE_TOLERANCE = 1e-13
SLOW = 0.01  # of the drive's lag: its torque is smooth within a shorter step


def mode_rates(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> State:
    """Return the derivative of ``x`` in ``mode``; what sticks does not move."""
    contact, slip_m, slip_l = mode
    if slip_m != 0 and slip_l != 0:
        return rates(x, contact, float(slip_m), float(slip_l), p, u, T_l)
    motor, load = motor_friction(p), load_friction(p)
    sign_m, bends_m = bristle_sign(motor, slip_m, x[8], x[1], x[0], carried_m(x, contact, p))
    sign_l, bends_l = bristle_sign(load, slip_l, x[9], x[3], x[2], carried_l(x, contact, p))
    r = rates(x, contact, sign_m, sign_l, p, u, T_l)
    still_m = slip_m == 0 and not builds_up(motor)
    still_l = slip_l == 0 and not builds_up(load)
    return (
        0.0 if still_m else r[0], 0.0 if still_m else r[1], 0.0 if still_l else r[2], 0.0 if still_l else r[3], r[4],
        r[5], r[6], r[7], bends_m, bends_l, r[10], r[11],
    )  # fmt: skip


def ahead(x: State, f: float, k: State) -> State:
    """Return ``x + f k``."""
    return (
        x[0] + f * k[0], x[1] + f * k[1], x[2] + f * k[2], x[3] + f * k[3], x[4] + f * k[4], x[5] + f * k[5],
        x[6] + f * k[6], x[7] + f * k[7], x[8] + f * k[8], x[9] + f * k[9], x[10] + f * k[10], x[11] + f * k[11],
    )  # fmt: skip


def combine(a: float, k: State, b: float, m: State) -> State:
    """Return ``a k + b m``."""
    return (
        a * k[0] + b * m[0], a * k[1] + b * m[1], a * k[2] + b * m[2], a * k[3] + b * m[3], a * k[4] + b * m[4],
        a * k[5] + b * m[5], a * k[6] + b * m[6], a * k[7] + b * m[7], a * k[8] + b * m[8], a * k[9] + b * m[9],
        a * k[10] + b * m[10], a * k[11] + b * m[11],
    )  # fmt: skip


def is_quick(p: Parameters, h: float) -> bool:
    """Tell whether a drive moves within a step, and follows the request itself: not a filtered or limited one."""
    return h > SLOW * p.tau and p.drive_filter_time_constant <= 0.0 and p.rate_limit_rate >= BIG


def driven(x: State, after: State, quick: bool, p: Parameters, u: float, h: float) -> State:
    """Return ``after``, ``h`` [s] later, with the torque of a quick drive then: ``u + (T_m - u) exp(-h / tau)``."""
    if not quick:
        return after
    torque = u + (x[4] - u) * exp(-h / p.tau)
    return (
        after[0], after[1], after[2], after[3], torque, after[5], after[6], after[7], after[8], after[9], after[10],
        after[11],
    )  # fmt: skip


def runge_kutta(
    x: State, k1: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float
) -> tuple[State, State, float]:
    """Return the state after one step, its derivative there and the scaled error: below 1 within the tolerance."""
    quick = is_quick(p, h)
    k2 = mode_rates(driven(x, ahead(x, h / 5.0, k1), quick, p, u, h / 5.0), mode, p, u, T_l)
    at3 = ahead(x, h, combine(3.0 / 40.0, k1, 9.0 / 40.0, k2))
    k3 = mode_rates(driven(x, at3, quick, p, u, 0.3 * h), mode, p, u, T_l)
    sum4 = ahead(combine(44.0 / 45.0, k1, -56.0 / 15.0, k2), 32.0 / 9.0, k3)
    k4 = mode_rates(driven(x, ahead(x, h, sum4), quick, p, u, 0.8 * h), mode, p, u, T_l)
    sum5 = combine(19372.0 / 6561.0, k1, -25360.0 / 2187.0, k2)
    sum5 = ahead(ahead(sum5, 64448.0 / 6561.0, k3), -212.0 / 729.0, k4)
    k5 = mode_rates(driven(x, ahead(x, h, sum5), quick, p, u, 8.0 / 9.0 * h), mode, p, u, T_l)
    sum6 = combine(9017.0 / 3168.0, k1, -355.0 / 33.0, k2)
    sum6 = ahead(ahead(ahead(sum6, 46732.0 / 5247.0, k3), 49.0 / 176.0, k4), -5103.0 / 18656.0, k5)
    k6 = mode_rates(driven(x, ahead(x, h, sum6), quick, p, u, h), mode, p, u, T_l)
    sum7 = combine(35.0 / 384.0, k1, 500.0 / 1113.0, k3)
    sum7 = ahead(ahead(ahead(sum7, 125.0 / 192.0, k4), -2187.0 / 6784.0, k5), 11.0 / 84.0, k6)
    after = driven(x, ahead(x, h, sum7), quick, p, u, h)
    k7 = mode_rates(after, mode, p, u, T_l)
    wrong = combine(71.0 / 57600.0, k1, -71.0 / 16695.0, k3)
    wrong = ahead(ahead(ahead(wrong, 71.0 / 1920.0, k4), -17253.0 / 339200.0, k5), 22.0 / 525.0, k6)
    wrong = ahead(wrong, -1.0 / 40.0, k7)
    square = 0.0
    known = 4 if quick else -1
    for n in range(12):
        if n != known:
            scale = ABSOLUTE_TOLERANCE + RELATIVE_TOLERANCE * max(abs(x[n]), abs(after[n]))
            share = h * wrong[n] / scale
            square += share * share
    return (after, k7, sqrt(square / 8.0))
