"""One-step prediction errors of the drivetrain: an extended Kalman filter over located contact events.

Between two events the dead-zone model is affine in ``x = (theta_m, omega_m, theta_l, omega_l, T_m)``. Its matrices
come from :func:`pyfmu_sources.equations.rates`; here they are discretised once per parameter set, the flank is
followed inside each sample, and the covariance is carried through every change of flank by its saltation matrix.
With the process noise at zero this is the output-error likelihood of the deterministic plant; with process noise it
is the likelihood in innovation form, in which an imperfect model does not drift away from the record.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pyfmu_sources.drivetrain_parameters import DEAD_ZONE, P_ALPHA, P_I, P_J_L, P_J_M, P_MODEL
from pyfmu_sources.equations import rates

Array = NDArray[np.float64]
STATES = 5
BLUR = 3e-4  # least standard deviation of the twist [rad] in a soft run


@dataclass(frozen=True)
class AffineModel:
    """The plant in its three smooth modes, index 0: flank -1, 1: free, 2: flank +1.

    Attributes:
        matrices: (3, 5, 5) A, 1/s.
        inputs: (5,) b_u, effect of the requested torque.
        constants: (3, 5) effect of offsets and constant torques.
        normal: (5,) twist = normal . x.
        alpha: half gap [rad].
        mobility: (2,) what a torque at motor or load does to the speed beside it, 1/inertia.
    """

    matrices: Array
    inputs: Array
    constants: Array
    normal: Array
    alpha: float
    mobility: Array


def affine_model(p: tuple[float, ...]) -> AffineModel:
    """Return the smooth modes of the dead-zone plant with parameters ``p``; nonlinear effects are not seen."""
    chosen = list(p)
    chosen[P_MODEL] = float(DEAD_ZONE)
    p = tuple(chosen)
    matrices = np.zeros((3, STATES, STATES))
    constants = np.zeros((3, STATES))
    zero = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    inputs = np.zeros(STATES)
    for flank in (-1, 0, 1):
        base: tuple[float, ...] = rates(zero, flank, 0.0, 0.0, p, 0.0, 0.0)
        constants[flank + 1] = base[:STATES]
        for n in range(STATES):
            unit = _unit(n)
            moved = rates(unit, flank, 0.0, 0.0, p, 0.0, 0.0)
            matrices[flank + 1, :, n] = [moved[m] - base[m] for m in range(STATES)]
        moved = rates(zero, flank, 0.0, 0.0, p, 1.0, 0.0)
        inputs = np.array([moved[m] - base[m] for m in range(STATES)])
    normal = np.array([1.0 / p[P_I], 0.0, -1.0, 0.0, 0.0])
    mobility = np.array([1.0 / p[P_J_M], 1.0 / p[P_J_L]])
    return AffineModel(matrices, inputs, constants, normal, p[P_ALPHA], mobility)


def _unit(n: int) -> tuple[float, float, float, float, float, float, float, float]:
    a, b, c, d, e = (1.0 if m == n else 0.0 for m in range(STATES))
    return (a, b, c, d, e, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class NoiseLevels:
    """Standard deviations of measurement [rad] and of white torque noise [N.m.s^0.5], motor and load each."""

    measured: tuple[float, float]
    torque: tuple[float, float]


@dataclass(frozen=True)
class Innovations:
    """Result of a filter run.

    Attributes:
        errors: (n, outputs) measured minus predicted [rad].
        variances: (n, outputs) what the filter expects of their squares.
        states: (n, 5) state after the measurement, empty unless asked for.
        contacts: (n,) flank after the measurement, empty unless asked for.
    """

    errors: Array
    variances: Array
    states: Array
    contacts: NDArray[np.int64]

    @property
    def deviance(self) -> float:
        """Return twice the negative log likelihood without its constant."""
        return float(np.sum(np.log(self.variances) + self.errors**2 / self.variances))


def innovations(
    model: AffineModel,
    u: Array,
    y: Array,
    step: float,
    x0: Array,
    noise: NoiseLevels,
    keep: bool = False,
    soft: bool = False,
) -> Innovations:
    """Run the filter over a record.

    Args:
        model: plant.
        u: (n,) requested torque, held over a sample [N.m].
        y: (n, 2) motor and load angle, or (n, 1) motor angle only [rad].
        step: sample time [s].
        x0: (5,) state at the first sample, taken as exact (its uncertainty is the fit's business).
        noise: measurement and process noise.
        keep: whether to return the states.
        soft: whether the flanks are blurred by the uncertainty of the twist (statistical linearisation) instead of
            followed sharply: coarser, but smooth in every unknown, so a fit may start with it.
    """
    phi, gain_u, gain_1 = _discrete(model, step)
    intensity = (np.array(noise.torque) * model.mobility) ** 2
    variance = np.array(noise.measured[: y.shape[1]]) ** 2
    n = y.shape[0]
    errors, variances = np.empty(y.shape), np.empty(y.shape)
    states = np.empty((n if keep else 0, STATES))
    contacts = np.empty(n if keep else 0, dtype=np.int64)
    _filter(
        model.matrices, model.inputs, model.constants, model.normal, model.alpha, phi, gain_u, gain_1, step,
        u, y, variance, intensity, x0, errors, variances, states, contacts, soft,
    )  # fmt: skip
    return Innovations(errors, variances, states, contacts)


def simulate(model: AffineModel, u: Array, step: float, x0: Array) -> Array:
    """Return the states (n, 5) of the plant that is fed ``u`` (n,) from ``x0`` (5,), without any measurement."""
    phi, gain_u, gain_1 = _discrete(model, step)
    states = np.empty((u.size, STATES))
    _simulate(
        model.matrices, model.inputs, model.constants, model.normal, model.alpha, phi, gain_u, gain_1, step, u, x0,
        states,
    )  # fmt: skip
    return states


def _discrete(model: AffineModel, step: float) -> tuple[Array, Array, Array]:
    """Return the transition matrices (3, 5, 5) and input gains (3, 5) of the three modes over a whole sample."""
    phi = np.empty((3, STATES, STATES))
    gain_u = np.empty((3, STATES))
    gain_1 = np.empty((3, STATES))
    for m in range(3):
        _transition(model.matrices[m], model.inputs, model.constants[m], step, phi[m], gain_u[m], gain_1[m])
    return phi, gain_u, gain_1


@njit(cache=True, nogil=True)
def _transition(a, b_u, b_1, h, phi, gain_u, gain_1):  # type: ignore[no-untyped-def]
    """Fill the exact transition over ``h`` of ``x' = a x + b_u u + b_1`` from its Taylor series."""
    for r in range(5):
        for c in range(5):
            phi[r, c] = 1.0 if r == c else 0.0
        gain_u[r] = 0.0
        gain_1[r] = 0.0
    power = np.eye(5)
    # Terms of a Taylor series: a sample is short beside the plant's fastest rate.
    integral_u = b_u * h
    integral_1 = b_1 * h
    for n in range(1, 200):
        power = power @ a * (h / n)
        gain_u += integral_u
        gain_1 += integral_1
        integral_u = a @ integral_u * (h / (n + 1))
        integral_1 = a @ integral_1 * (h / (n + 1))
        phi += power
        if n > 4 and np.max(np.abs(power)) < 1e-18:
            break


@njit(cache=True, nogil=True)
def _drift(a, b_u, b_1, x, u, out):  # type: ignore[no-untyped-def]
    for r in range(5):
        total = b_u[r] * u + b_1[r]
        for c in range(5):
            total += a[r, c] * x[c]
        out[r] = total


@njit(cache=True, nogil=True)
def _root(v0, s0, v1, s1, h):  # type: ignore[no-untyped-def]
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


@njit(cache=True, nogil=True)
def _propagate(mats, b_u, b_1, normal, alpha, phi, gain_u, gain_1, h, u, x, total, end):  # type: ignore[no-untyped-def]
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
    for _ in range(20):
        for r in range(5):
            acc = g_u[r] * u + g_1[r]
            for c in range(5):
                acc += f[r, c] * x[c]
            end[r] = acc
        hit = -1.0
        side = 0.0
        if alpha > 0.0:
            d0 = normal[0] * x[0] + normal[2] * x[2]
            w0 = normal[0] * x[1] + normal[2] * x[3]
            d1 = normal[0] * end[0] + normal[2] * end[2]
            w1 = normal[0] * end[1] + normal[2] * end[3]
            reach = left * (abs(w0) + abs(w1))
            if flank == 1:
                for way in range(2):
                    s = 1.0 if way == 0 else -1.0
                    if alpha - s * d1 > reach and alpha - s * d0 > reach:
                        continue
                    when = _root(max(alpha - s * d0, 0.0), -s * w0, alpha - s * d1, -s * w1, left)
                    if when >= 0.0 and (hit < 0.0 or when < hit):
                        hit, side = when, s
            else:
                side = 1.0 if flank == 2 else -1.0
                if not (side * d1 - alpha > reach and side * d0 - alpha > reach):
                    hit = _root(max(side * d0 - alpha, 0.0), side * w0, side * d1 - alpha, side * w1, left)
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
        # One Newton step on the exact solution puts the event where the cubic almost did.
        part = np.empty((5, 5))
        part_u = np.empty(5)
        part_1 = np.empty(5)
        y = np.empty(5)
        for _newton in range(2):
            _transition(mats[flank], b_u, b_1[flank], hit, part, part_u, part_1)
            for r in range(5):
                acc = part_u[r] * u + part_1[r]
                for c in range(5):
                    acc += part[r, c] * x[c]
                y[r] = acc
            gap = normal[0] * y[0] + normal[2] * y[2] - side * alpha
            rate = normal[0] * y[1] + normal[2] * y[3]
            if abs(rate) < 1e-9 or abs(gap) < 1e-15:
                break
            hit = min(max(hit - gap / rate, 0.0), left)
        _transition(mats[flank], b_u, b_1[flank], hit, part, part_u, part_1)
        for r in range(5):
            acc = part_u[r] * u + part_1[r]
            for c in range(5):
                acc += part[r, c] * x[c]
            y[r] = acc
        if first:
            total[:, :] = part
        else:
            total[:, :] = part @ total
        first = False
        after = (2 if side > 0.0 else 0) if flank == 1 else 1
        speed0 = np.empty(5)
        speed1 = np.empty(5)
        _drift(mats[flank], b_u, b_1[flank], y, u, speed0)
        _drift(mats[after], b_u, b_1[after], y, u, speed1)
        rate = normal[0] * y[1] + normal[2] * y[3]
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
        _transition(mats[flank], b_u, b_1[flank], left, f, g_u, g_1)


@njit(cache=True, nogil=True)
def _blurred(mats, b_u, b_1, normal, alpha, cov, h, u, x, total):  # type: ignore[no-untyped-def]
    """Advance ``x`` over ``h`` with the dead zone averaged over the twist's distribution (Booton 1954)."""
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


@njit(cache=True, nogil=True)
def _simulate(mats, b_u, b_1, normal, alpha, phi, gain_u, gain_1, h, u, x0, states):  # type: ignore[no-untyped-def]
    x = x0.copy()
    total = np.empty((5, 5))
    end = np.empty(5)
    for k in range(u.size):
        for r in range(5):
            states[k, r] = x[r]
        _propagate(mats, b_u, b_1, normal, alpha, phi, gain_u, gain_1, h, u[k], x, total, end)


@njit(cache=True, nogil=True)
def _filter(  # type: ignore[no-untyped-def]
    mats, b_u, b_1, normal, alpha, phi, gain_u, gain_1, h, u, y, variance, intensity, x0, errors, variances,
    states, contacts, soft,
):  # fmt: skip
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
            errors[k, o] = e
            variances[k, o] = s
            for r in range(5):
                gain[r] = cov[r, row] / s
            for r in range(5):
                x[r] += gain[r] * e
                for c in range(5):
                    work[r, c] = cov[r, c] - gain[r] * gain[c] * s
            for r in range(5):
                for c in range(5):
                    cov[r, c] = 0.5 * (work[r, c] + work[c, r])
        if keep:
            d = normal[0] * x[0] + normal[2] * x[2]
            contacts[k] = 1 if d > alpha else (-1 if d < -alpha else 0)
            for r in range(5):
                states[k, r] = x[r]
        if soft:
            _blurred(mats, b_u, b_1, normal, alpha, cov, h, u[k], x, total)
        else:
            _propagate(mats, b_u, b_1, normal, alpha, phi, gain_u, gain_1, h, u[k], x, total, gain)
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
        for body in range(2):
            a = 2 * body
            q = intensity[body]
            cov[a, a] += q * h * h * h / 3.0
            cov[a, a + 1] += q * h * h / 2.0
            cov[a + 1, a] += q * h * h / 2.0
            cov[a + 1, a + 1] += q * h
