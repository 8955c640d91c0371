"""The compiled inner loops of :mod:`innovations`: transitions, located flanks, the filter.

``mats`` (3, 5, 5), ``b_u`` (5,) and ``b_1`` (3, 5) are the affine modes, index 0: flank -1, 1: free, 2: flank +1;
``phi``, ``gain_u`` and ``gain_1`` the same over a sample ``h`` [s]; ``normal`` (5,) takes the twist from the state.
``jump`` (5,) is how the state changes at once when the teeth touch at flank +1; at flank -1, and when they part, it
is the opposite. ``x`` (5,) is the state, ``total`` (5, 5) is filled with its Jacobian, ``u`` is the torque [N.m] of a
sample or (n,), ``alpha`` the half-gap [rad].

In all functions: ``x0``: (5,) first state; ``states``: (n, 5) filled.
"""

import math

import numpy as np

from orchestrator.shared.numba_cache import njit_on_disk

BLUR = 3e-4  # least standard deviation of the twist [rad] in a soft run
MOST_EVENTS = 20  # in one sample
TERMS = 20  # of a Taylor series whose terms fall by half at least: the last is below the rounding of the first
MOST_HALVINGS = 60  # of a sample; a rate beyond that is no number any more


@njit_on_disk(nogil=True)
def multiply(left, right, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` with the product of two (5, 5) matrices, of which it is neither."""
    for r in range(5):
        for c in range(5):
            acc = 0.0
            for m in range(5):
                acc += left[r, m] * right[m, c]
            out[r, c] = acc


@njit_on_disk(nogil=True)
def advance_by(phi, gain_u, gain_1, u, x, out):  # type: ignore[no-untyped-def]
    """Fill ``out`` (5,) with where a transition leads from ``x``; of a rate, with the time derivative there."""
    for r in range(5):
        acc = gain_u[r] * u + gain_1[r]
        for c in range(5):
            acc += phi[r, c] * x[c]
        out[r] = acc


@njit_on_disk(nogil=True)
def transition(a, b_u, b_1, h, phi, gain_u, gain_1):  # type: ignore[no-untyped-def]
    """Fill the exact transition over ``h`` of ``x' = a x + b_u u + b_1``: a Taylor series, scaled and squared.

    The series is that of ``h`` over a power of two, in which nothing of the plant moves far (Moler and Van Loan 2003,
    method 3); a drive whose time constant is a thousandth of a sample costs ten products more, and no accuracy.
    """
    fastest = 0.0
    for r in range(5):
        row = 0.0
        for c in range(5):
            row += abs(a[r, c])
        fastest = max(fastest, row)
    halvings = 0
    part = h
    while abs(part) * fastest > 0.5 and halvings < MOST_HALVINGS:
        part *= 0.5
        halvings += 1
    power = np.eye(5)
    other = np.empty((5, 5))
    integral_u = b_u * part
    integral_1 = b_1 * part
    moved_u = np.empty(5)
    moved_1 = np.empty(5)
    for r in range(5):
        for c in range(5):
            phi[r, c] = power[r, c]
        gain_u[r] = integral_u[r]
        gain_1[r] = integral_1[r]
    for n in range(1, TERMS + 1):
        multiply(a, power, other)
        largest = 0.0
        for r in range(5):
            moved_u[r] = 0.0
            moved_1[r] = 0.0
            for c in range(5):
                power[r, c] = other[r, c] * (part / n)
                phi[r, c] += power[r, c]
                largest = max(largest, abs(power[r, c]))
                moved_u[r] += a[r, c] * integral_u[c] * (part / (n + 1))
                moved_1[r] += a[r, c] * integral_1[c] * (part / (n + 1))
        for r in range(5):
            integral_u[r] = moved_u[r]
            integral_1[r] = moved_1[r]
            gain_u[r] += moved_u[r]
            gain_1[r] += moved_1[r]
        if largest < 1e-18:
            break
    for _ in range(halvings):
        for r in range(5):
            moved_u[r] = gain_u[r]
            moved_1[r] = gain_1[r]
            for c in range(5):
                moved_u[r] += phi[r, c] * gain_u[c]
                moved_1[r] += phi[r, c] * gain_1[c]
        multiply(phi, phi, other)
        for r in range(5):
            gain_u[r] = moved_u[r]
            gain_1[r] = moved_1[r]
            for c in range(5):
                phi[r, c] = other[r, c]


@njit_on_disk(nogil=True)
def _first_root(v0, s0, v1, s1, h):  # type: ignore[no-untyped-def]
    """Return the first time in (0, h] at which the cubic with these end values and slopes turns negative, or -1.0."""
    c1 = h * s0
    c2 = 3.0 * (v1 - v0) - h * (2.0 * s0 + s1)
    c3 = 2.0 * (v0 - v1) + h * (s0 + s1)
    # Between its turning points the cubic is monotone, so looking there finds even a shallow dip.
    first, second = 1.0, 1.0
    square = c2 * c2 - 3.0 * c1 * c3
    if square > 0.0:
        q = -(c2 + math.sqrt(square) * (1.0 if c2 >= 0.0 else -1.0))
        one = q / (3.0 * c3) if c3 != 0.0 else 1.0
        two = c1 / q if q != 0.0 else 1.0
        first, second = min(one, two), max(one, two)
    low = 0.0
    for m in range(3):
        t = first if m == 0 else (second if m == 1 else 1.0)
        if t <= low or t > 1.0:
            continue
        value = v1 if t == 1.0 else v0 + t * (c1 + t * (c2 + t * c3))
        if value < 0.0:
            high = t
            for _ in range(45):
                t = 0.5 * (low + high)
                if v0 + t * (c1 + t * (c2 + t * c3)) < 0.0:
                    high = t
                else:
                    low = t
            return 0.5 * (low + high) * h
        low = t
    return -1.0


@njit_on_disk(nogil=True)
def _next_event(normal, alpha, flank, x, end, h):  # type: ignore[no-untyped-def]
    """Return (time, side) of the first meeting of twist and flank between states ``x`` and ``end``; -1.0: none.

    ``end`` is where the present mode alone leads in ``h``; the cubic through both ends is close enough to find it.
    """
    hit = -1.0
    side = 0.0
    if alpha <= 0.0:
        return hit, side
    d0 = normal[0] * x[0] + normal[2] * x[2]
    w0 = normal[0] * x[1] + normal[2] * x[3]
    d1 = normal[0] * end[0] + normal[2] * end[2]
    w1 = normal[0] * end[1] + normal[2] * end[3]
    reach = h * (abs(w0) + abs(w1))
    if flank == 1:
        for way in range(2):
            s = 1.0 if way == 0 else -1.0
            if alpha - s * d1 > reach and alpha - s * d0 > reach:
                continue
            when = _first_root(max(alpha - s * d0, 0.0), -s * w0, alpha - s * d1, -s * w1, h)
            if when >= 0.0 and (hit < 0.0 or when < hit):
                hit, side = when, s
        return hit, side
    side = 1.0 if flank == 2 else -1.0
    if not (side * d1 - alpha > reach and side * d0 - alpha > reach):
        hit = _first_root(max(side * d0 - alpha, 0.0), side * w0, side * d1 - alpha, side * w1, h)
    return hit, side


@njit_on_disk(nogil=True)
def _cut_at(mats, b_u, b_1, normal, edge, hit, left, u, x, part, y):  # type: ignore[no-untyped-def]
    """Fill ``y`` and the transition ``part`` at the event near ``hit``, and return its time; ``edge`` is the flank."""
    part_u = np.empty(5)
    part_1 = np.empty(5)
    for newton in range(3):
        transition(mats, b_u, b_1, hit, part, part_u, part_1)
        for r in range(5):
            acc = part_u[r] * u + part_1[r]
            for c in range(5):
                acc += part[r, c] * x[c]
            y[r] = acc
        gap = normal[0] * y[0] + normal[2] * y[2] - edge
        rate = normal[0] * y[1] + normal[2] * y[3]
        # Two Newton steps on the exact solution put the event where the cubic almost did.
        if newton == 2 or abs(rate) < 1e-9 or abs(gap) < 1e-15:
            break
        hit = min(max(hit - gap / rate, 0.0), left)
    return hit


@njit_on_disk(nogil=True)
def propagate(mats, b_u, b_1, normal, alpha, jump, phi, gain_u, gain_1, h, u, x, total, end):  # type: ignore[no-untyped-def]
    """Advance ``x`` in place over ``h`` and leave its Jacobian in ``total``; ``end`` is scratch."""
    d = normal[0] * x[0] + normal[2] * x[2]
    flank = 2
    if alpha > 0.0:
        flank = 2 if d > alpha else (0 if d < -alpha else 1)
    f = phi[flank]
    g_u = gain_u[flank]
    g_1 = gain_1[flank]
    left = h
    first = True
    for _ in range(MOST_EVENTS):
        for r in range(5):
            acc = g_u[r] * u + g_1[r]
            for c in range(5):
                acc += f[r, c] * x[c]
            end[r] = acc
        hit, side = _next_event(normal, alpha, flank, x, end, left)
        if hit < 0.0:
            if first:
                for r in range(5):
                    for c in range(5):
                        total[r, c] = f[r, c]
            else:
                total[:, :] = f @ total
            for r in range(5):
                x[r] = end[r]
            return
        part = np.empty((5, 5))
        y = np.empty(5)
        hit = _cut_at(mats[flank], b_u, b_1[flank], normal, side * alpha, hit, left, u, x, part, y)
        if first:
            total[:, :] = part
        else:
            total[:, :] = part @ total
        first = False
        after = (2 if side > 0.0 else 0) if flank == 1 else 1
        speed0 = np.empty(5)
        speed1 = np.empty(5)
        advance_by(mats[flank], b_u, b_1[flank], u, y, speed0)
        rate = normal[0] * y[1] + normal[2] * y[3]
        way = side if flank == 1 else -side
        for r in range(5):
            y[r] += way * jump[r]
        advance_by(mats[after], b_u, b_1[after], u, y, speed1)
        if abs(rate) > 1e-6:
            for c in range(5):
                along = (normal[0] * total[0, c] + normal[2] * total[2, c]) / rate
                for r in range(5):
                    total[r, c] += (speed1[r] - speed0[r]) * along
        for r in range(5):
            x[r] = y[r]
        left -= hit
        flank = after
        if left <= 0.0:
            return
        f = np.empty((5, 5))
        g_u = np.empty(5)
        g_1 = np.empty(5)
        transition(mats[flank], b_u, b_1[flank], left, f, g_u, g_1)


@njit_on_disk(nogil=True)
def advance_blurred(mats, b_u, b_1, normal, alpha, cov, h, u, x, total):  # type: ignore[no-untyped-def]
    """Advance ``x`` over ``h`` with the dead zone averaged over the twist's distribution (Booton 1954).

    Args:
        cov: (5, 5) covariance of the state.
    """
    variance = 0.0
    for r in range(0, 3, 2):
        for c in range(0, 3, 2):
            variance += normal[r] * normal[c] * cov[r, c]
    sigma = math.sqrt(max(variance, 0.0) + BLUR * BLUR)
    for r in range(5):
        for c in range(5):
            total[r, c] = 1.0 if r == c else 0.0
    parts = 4
    dt = h / parts
    lin = np.empty((5, 5))
    one = np.empty((5, 5))
    moved = np.empty(5)
    new = np.empty(5)
    for _ in range(parts):
        # The dead zone at the middle of the part, reached at the present rate.
        d = normal[0] * (x[0] + 0.5 * dt * x[1]) + normal[2] * (x[2] + 0.5 * dt * x[3])
        a = (d - alpha) / sigma
        b = (-d - alpha) / sigma
        upper = 0.5 * math.erfc(-a * 0.7071067811865476)
        lower = 0.5 * math.erfc(-b * 0.7071067811865476)
        bell = 0.3989422804014327 * sigma * (math.exp(-0.5 * a * a) - math.exp(-0.5 * b * b))
        share = upper + lower
        wound = (d - alpha) * upper + (d + alpha) * lower + bell
        for r in range(5):
            for c in range(5):
                lin[r, c] = dt * (mats[1, r, c] + share * (mats[2, r, c] - mats[1, r, c]))
            push = mats[2, r, 2] - mats[1, r, 2]
            moved[r] = dt * (b_u[r] * u + b_1[1, r] - push * (wound - share * d))
        for r in range(5):
            acc = moved[r]
            for c in range(5):
                square = 0.0
                for m in range(5):
                    square += lin[r, m] * lin[m, c]
                one[r, c] = (1.0 if r == c else 0.0) + lin[r, c] + 0.5 * square
                acc += 0.5 * lin[r, c] * moved[c] + one[r, c] * x[c]
            new[r] = acc
        for r in range(5):
            x[r] = new[r]
        total[:, :] = one @ total


@njit_on_disk(nogil=True)
def run_free(mats, b_u, b_1, normal, alpha, jump, phi, gain_u, gain_1, h, u, x0, states):  # type: ignore[no-untyped-def]
    """Fill ``states`` (n, 5) with the run from ``x0`` under ``u`` (n,), nothing measured."""
    x = x0.copy()
    total = np.empty((5, 5))
    end = np.empty(5)
    for k in range(u.size):
        for r in range(5):
            states[k, r] = x[r]
        propagate(mats, b_u, b_1, normal, alpha, jump, phi, gain_u, gain_1, h, u[k], x, total, end)


@njit_on_disk(nogil=True)
def _update(x, cov, row, e, s, gain, work):  # type: ignore[no-untyped-def]
    """Correct state and covariance in place by the error ``e``, of variance ``s``, of the measured state ``row``."""
    for r in range(5):
        gain[r] = cov[r, row] / s
    for r in range(5):
        x[r] += gain[r] * e
        for c in range(5):
            work[r, c] = cov[r, c] - gain[r] * gain[c] * s
    for r in range(5):
        for c in range(5):
            cov[r, c] = 0.5 * (work[r, c] + work[c, r])


@njit_on_disk(nogil=True)
def run_filter(  # type: ignore[no-untyped-def]
    mats, b_u, b_1, normal, alpha, jump, phi, gain_u, gain_1, h, u, u_variance, y, variance, intensity, x0, errors,
    variances, states, contacts, soft,
):  # fmt: skip
    """Fill one-step ``errors`` and ``variances`` (n, outputs); and states and contacts where they have n rows.

    A measurement that is NaN is skipped: error 0, variance 1. ``u_variance`` is what the torque may be off by: (n,), or
    (0,) where it is known.

    Args:
        u_variance: of the torque [N^2.m^2].
        y: (n, outputs) measured angles [rad].
        variance: (outputs,) of the measurement [rad^2].
        intensity: (2,) of the torque noise at motor and load.
        errors: (n, outputs) filled.
        variances: (n, outputs) filled.
        contacts: (n,) filled, or (0,).
    """
    n, outputs = y.shape
    x = x0.copy()
    cov = np.zeros((5, 5))
    total = np.empty((5, 5))
    work = np.empty((5, 5))
    gain = np.empty(5)
    keep = states.shape[0] == n
    for k in range(n):
        for o in range(outputs):
            row = 2 * o
            s = cov[row, row] + variance[o]
            e = y[k, o] - x[row]
            if math.isnan(e):
                # A state that has become NaN must show; a sample that is missing must not.
                errors[k, o] = x[row] - x[row]
                variances[k, o] = 1.0
                continue
            if not s > 0.0:  # rounding has used the covariance up: the filter has diverged
                errors[k:, :] = math.nan
                variances[k:, :] = math.nan
                states[k:, :] = math.nan
                contacts[k:] = 0
                return
            errors[k, o] = e
            variances[k, o] = s
            _update(x, cov, row, e, s, gain, work)
        if keep:
            d = normal[0] * x[0] + normal[2] * x[2]
            contacts[k] = 1 if d > alpha else (-1 if d < -alpha else 0)
            for r in range(5):
                states[k, r] = x[r]
        if soft:
            advance_blurred(mats, b_u, b_1, normal, alpha, cov, h, u[k], x, total)
        else:
            propagate(mats, b_u, b_1, normal, alpha, jump, phi, gain_u, gain_1, h, u[k], x, total, gain)
        for r in range(5):
            for c in range(5):
                acc = 0.0
                for m in range(5):
                    acc += total[r, m] * cov[m, c]
                work[r, c] = acc
        for r in range(5):
            for c in range(r, 5):
                acc = 0.0
                for m in range(5):
                    acc += work[r, m] * total[c, m]
                cov[r, c] = acc
                cov[c, r] = acc
        if u_variance.size == n and u_variance[k] > 0.0:
            for r in range(5):
                for c in range(5):
                    cov[r, c] += u_variance[k] * gain_u[1, r] * gain_u[1, c]
        for body in range(2):
            a = 2 * body
            q = intensity[body]
            cov[a, a] += q * h * h * h / 3.0
            cov[a, a + 1] += q * h * h / 2.0
            cov[a + 1, a] += q * h * h / 2.0
            cov[a + 1, a + 1] += q * h
