"""Online estimate of state, contact and half-gap: a Gaussian sum of extended Kalman filters.

One filter cannot start from "anything between 2 mrad and 0.2 rad": whether the teeth touch decides everything. So
several filters start from sizes a factor of two apart, each with the half-gap among its states (Lagerberg and
Egardt, IEEE Trans. Control Systems Technology 15, 2007), and their likelihoods weigh them (Alspach and Sorenson,
IEEE Trans. Automatic Control 17, 1972). A half-gap to start from is a prior: the middle filter starts there, and the
others, still a factor of two apart, have the weights of a log-normal density. The dead zone is averaged over what
each filter does not know (statistical linearisation, Booton 1954), which keeps the estimate smooth while the gap is
still uncertain.

A filter is a flat sequence ``f`` of ``SIZE`` floats, changed in place: nine states, their covariance row by row, and
the logarithm of the filter's weight. The states are
``(theta_m, omega_m, theta_l, omega_l, T_m, T_l, alpha, kappa, offset)``: ``kappa`` the relative error of the
stiffness, ``offset`` the twist [rad] in mid-gap. ``m`` is the tuple ``(J_m, J_l, k, c, b_m, b_l, i, tau)``.

In all functions: ``f``: the filter, changed in place; ``theta_m``: motor angle [rad]; ``theta_l``: load angle [rad].
"""

from math import erfc, exp, log, sqrt
from typing import Annotated, NamedTuple

Model = tuple[float, float, float, float, float, float, float, float]

STATES = 9
SIZE = STATES + STATES * STATES + 1
FILTERS = 7
Filter = Annotated[list[float], SIZE]
Filters = Annotated[list[Filter], FILTERS]
Row = tuple[float, float, float, float, float, float, float, float, float]
SettingValues = Row
WEIGHT = SIZE - 1
ALPHA = 6
SMALLEST = 0.0025  # half-gap of the first filter [rad]; each next one is twice as large
RELATIVE_SPREAD = 0.4  # standard deviation of each filter's half-gap over its size
FORGOTTEN = -30.0  # log weight below which a filter is no longer run
ROOT_HALF = 0.7071067811865476
ROOT_INVERSE_2PI = 0.3989422804014327
LEAST_BLUR = 1e-8  # least variance [rad2] of the distance to a flank
LAG_MEMORY = 0.6  # s over which the error of the lag acts in one direction
LARGEST_ERROR = 1e3  # innovation [rad] at which a filter counts as diverged
DEAD = -1e300  # log weight of such a filter, and of a forgotten one: no sample that the others see brings it back
LONGEST_PART = 0.06  # of the shaft's oscillation, in radians of its phase


class NoiseSettings(NamedTuple):
    """What the estimator is told about noise; each is a standard deviation."""

    noise_m: float = 3.5e-4  # of the motor's angle, rounding included [rad]
    noise_l: float = 1.75e-4  # of the load's angle [rad]
    torque_noise_m: float = 0.1  # white torque at the motor, for what the model lacks [N.m.s^0.5]
    torque_noise_l: float = 0.3  # the same at the load [N.m.s^0.5]
    load_walk: float = 2.0  # random walk of the load torque [N.m/s^0.5]
    alpha_walk: float = 1e-5  # random walk of the half-gap, for wear [rad/s^0.5]
    stiffness_spread: float = 0.03  # relative error of the stiffness
    offset_spread: float = 0.01  # twist in mid-gap [rad]
    lag_spread: float = 0.03  # relative error of the torque's lag


def covariance(r: int, c: int) -> int:
    """Return where the covariance of states ``r`` and ``c`` (from 0) stands in a filter."""
    return STATES + STATES * r + c


def start(
    f: Filter, size: float, spread: float, weight: float, theta_m: float, theta_l: float, s: SettingValues
) -> None:
    """Set a filter at the first measured angles [rad].

    ``size``: half-gap [rad]; ``spread``: its relative standard deviation; ``weight``: logarithm of the filter's weight.
    """
    for n in range(SIZE):
        f[n] = 0.0
    f[0] = theta_m
    f[2] = theta_l
    f[ALPHA] = size
    f[WEIGHT] = weight
    spreads = (s[0], 1.0, s[1], 0.3, 5.0, 1.0, spread * size, s[6], s[7])
    for n in range(STATES):
        f[covariance(n, n)] = spreads[n] * spreads[n]


def distance_variance(f: Filter, side: float) -> float:
    """Return the part of the variance [rad2] of the distance to a flank that does not concern the motor's angle."""
    return (
        f[covariance(2, 2)]
        + f[covariance(8, 8)]
        + f[covariance(6, 6)]
        + 2.0 * (f[covariance(2, 8)] + side * f[covariance(2, 6)] + side * f[covariance(6, 8)])
    )


def flank(distance: float, variance: float) -> tuple[float, float]:
    """Return (probability that a flank is loaded, mean penetration [rad]) of a Gaussian distance beyond it [rad]."""
    sigma = sqrt(variance)
    z = distance / sigma
    share = 0.5 * erfc(-z * ROOT_HALF)
    bell = ROOT_INVERSE_2PI * exp(-0.5 * z * z) if abs(z) < 37.0 else 0.0
    return share, distance * share + sigma * bell


def predict(f: Filter, m: Model, u: float, h: float, s: SettingValues) -> None:
    """Advance a filter by ``h`` [s], short beside the shaft's oscillation, with the request ``u`` [N.m] held."""
    J_m, J_l, k, c, b_m, b_l, i, tau = m
    mean = 1.0 / i
    cross = -2.0 * mean * f[covariance(0, 2)] + mean * mean * f[covariance(0, 0)]
    upper_variance = distance_variance(f, 1.0) + cross - 2.0 * mean * (f[covariance(0, 8)] + f[covariance(0, 6)])
    lower_variance = distance_variance(f, -1.0) + cross - 2.0 * mean * (f[covariance(0, 8)] - f[covariance(0, 6)])
    rate = f[1] * mean - f[3]
    wound = (f[0] + 0.5 * h * f[1]) * mean - f[2] - 0.5 * h * f[3] - f[8]
    upper, above = flank(wound - f[6], max(upper_variance, LEAST_BLUR))
    lower, below = flank(-wound - f[6], max(lower_variance, LEAST_BLUR))
    share = upper + lower
    elastic = k * (above - below)
    stiff = k * (1.0 + f[7]) * share
    damping = c * share
    shaft = (1.0 + f[7]) * elastic + damping * rate
    a_m = (f[4] - b_m * f[1] - shaft * mean) / J_m
    a_l = (shaft - b_l * f[3] - f[5]) / J_l
    squeeze = k * (1.0 + f[7]) * (lower - upper)  # of the shaft torque by alpha
    # Rows of h A for the two speeds; the other rows have one or two entries.
    s_m = -h * mean / J_m
    s_l = h / J_l
    row_m = (
        s_m * stiff * mean,
        s_m * damping * mean - h * b_m / J_m,
        -s_m * stiff,
        -s_m * damping,
        h / J_m,
        0.0,
        s_m * squeeze,
        s_m * elastic,
        -s_m * stiff,
    )
    row_l = (
        s_l * stiff * mean,
        s_l * damping * mean,
        -s_l * stiff,
        -s_l * damping - h * b_l / J_l,
        0.0,
        -h / J_l,
        s_l * squeeze,
        s_l * elastic,
        -s_l * stiff,
    )
    keep = exp(-h / tau)
    lag_error = s[8] * (u - f[4]) / tau
    f[0] += h * f[1] + 0.5 * h * h * a_m
    f[2] += h * f[3] + 0.5 * h * h * a_l
    f[1] += h * a_m
    f[3] += h * a_l
    f[4] = keep * f[4] + (1.0 - keep) * u
    _spread(f, row_m, row_l, h, keep)
    noise_m = s[2] / J_m
    noise_l = s[3] / J_l
    f[covariance(1, 1)] += h * (noise_m * noise_m)
    f[covariance(3, 3)] += h * (noise_l * noise_l)
    f[covariance(4, 4)] += h * LAG_MEMORY * lag_error * lag_error
    f[covariance(5, 5)] += h * s[4] * s[4]
    f[covariance(6, 6)] += h * s[5] * s[5]


def _spread(f: Filter, row_m: Row, row_l: Row, h: float, keep: float) -> None:
    """Replace the covariance P by F P F^T for the sparse transition F of :func:`predict`.

    Angles move with the new speeds (semi-implicit Euler), which keeps the undamped oscillation's covariance bounded.
    """
    for c in range(STATES):
        add_m = 0.0
        add_l = 0.0
        for n in range(STATES):
            value = f[STATES + STATES * n + c]
            add_m += row_m[n] * value
            add_l += row_l[n] * value
        f[STATES + STATES + c] += add_m
        f[STATES + STATES * 3 + c] += add_l
        f[STATES + c] += h * f[STATES + STATES + c]
        f[STATES + STATES * 2 + c] += h * f[STATES + STATES * 3 + c]
        f[STATES + STATES * 4 + c] *= keep
    for r in range(STATES):
        base = STATES + STATES * r
        add_m = 0.0
        add_l = 0.0
        for n in range(STATES):
            value = f[base + n]
            add_m += row_m[n] * value
            add_l += row_l[n] * value
        f[base + 1] += add_m
        f[base + 3] += add_l
        f[base] += h * f[base + 1]
        f[base + 2] += h * f[base + 3]
        f[base + 4] *= keep


def correct(f: Filter, state: int, measured: float, variance: float) -> tuple[float, float]:
    """Take in one measured angle.

    Args:
        f: the filter, changed in place; its log weight gains the log likelihood of the measurement.
        state: 0 for the motor's angle, 2 for the load's.
        measured: [rad].
        variance: of the measurement [rad2].

    Returns:
        innovation [rad] and its variance [rad2].
    """
    base = STATES + STATES * state
    spread = f[base + state] + variance
    error = measured - f[state]
    if not (spread > 0.0 and abs(error) < LARGEST_ERROR):
        # A filter on the wrong side of a small gap may diverge: it has nothing more to say.
        f[WEIGHT] = DEAD
        return error, spread
    scale = error / spread
    a, b, c, d, e = f[base], f[base + 1], f[base + 2], f[base + 3], f[base + 4]
    column = (a, b, c, d, e, f[base + 5], f[base + 6], f[base + 7], f[base + 8])
    for r in range(STATES):
        f[r] += column[r] * scale
        gain = column[r] / spread
        # The lower half repeats the upper: asymmetry of rounding would otherwise grow until the filter breaks.
        for n in range(r, STATES):
            f[STATES + STATES * r + n] -= gain * column[n]
            f[STATES + STATES * n + r] = f[STATES + STATES * r + n]
    f[ALPHA] = max(f[ALPHA], 0.0)
    f[WEIGHT] -= 0.5 * (log(spread) + error * scale)
    return error, spread


def combine(filters: Filters, count: int) -> tuple[float, float, int]:
    """Return (alpha [rad], its standard deviation [rad], number of the heaviest filter) of the Gaussian sum.

    Log weights are shifted so that the largest is zero. A filter that falls behind stays behind: its state is of
    another instant, so it must not win where a wild sample makes all that are run unlikely.
    """
    largest = filters[0][WEIGHT]
    best = 0
    for n in range(1, count):
        if filters[n][WEIGHT] > largest:
            largest = filters[n][WEIGHT]
            best = n
    total = 0.0
    mean = 0.0
    square = 0.0
    for n in range(count):
        f = filters[n]
        f[WEIGHT] -= largest
        if f[WEIGHT] <= FORGOTTEN:
            f[WEIGHT] = DEAD
        else:
            weight = exp(f[WEIGHT])
            total += weight
            mean += weight * f[ALPHA]
            square += weight * (f[ALPHA] * f[ALPHA] + max(f[covariance(ALPHA, ALPHA)], 0.0))
    mean /= total
    return mean, sqrt(max(square / total - mean * mean, 0.0)), best


def contact(f: Filter, i: float) -> int:
    """Return the flank (-1, 0, 1) at which a filter puts the gear, for the gear ratio ``i``."""
    wound = f[0] / i - f[2] - f[8]
    if wound > f[ALPHA]:
        return 1
    return -1 if wound < -f[ALPHA] else 0


def begin(
    filters: Filters, alpha_start: float, alpha_spread: float, theta_m: float, theta_l: float, s: SettingValues
) -> None:
    """Set all filters at the first measured angles [rad] with the settings ``s``.

    ``alpha_start``: half-gap to start from [rad]; 0: not known. ``alpha_spread``: its relative standard deviation.
    """
    if alpha_start <= 0.0:
        for n in range(FILTERS):
            start(filters[n], SMALLEST * 2.0**n, RELATIVE_SPREAD, 0.0, theta_m, theta_l, s)
        return
    spread = min(alpha_spread, RELATIVE_SPREAD)
    for n in range(FILTERS):
        octaves = n - FILTERS // 2
        away = octaves * log(2.0) / alpha_spread
        start(filters[n], alpha_start * 2.0**octaves, spread, -0.5 * away * away, theta_m, theta_l, s)


def advance(filters: Filters, m: Model, s: SettingValues, u: float, h: float) -> None:
    """Predict with all filters over a sample of ``h`` [s], in which the request ``u`` [N.m] is held."""
    fastest = sqrt(m[2] * (1.0 / m[1] + 1.0 / (m[0] * m[6] * m[6])))
    parts = 1 + int(h * fastest / LONGEST_PART)
    for n in range(FILTERS):
        if filters[n][WEIGHT] > FORGOTTEN:
            for _ in range(parts):
                predict(filters[n], m, u, h / parts, s)


def measure(filters: Filters, s: SettingValues, theta_m: float, theta_l: float) -> None:
    """Take both measured angles [rad] into all filters."""
    for n in range(FILTERS):
        if filters[n][WEIGHT] > FORGOTTEN:
            correct(filters[n], 0, theta_m, s[0] * s[0])
            correct(filters[n], 2, theta_l, s[1] * s[1])
