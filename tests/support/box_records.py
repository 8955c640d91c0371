"""Records of the FMUs of :mod:`tests.support.box_fmu` by equations of their own, with an effect hidden around them.

They are made by small midpoint steps. Nothing is shared with the project.
"""

from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np

from tests.support.box_fmu import DOMAINS, LOAD, MOTOR, Domain

FINE = 40  # steps of the independent solution in a sample


@numba.njit(cache=True)
def _rates(number, x, u, p):
    d = np.zeros(4)
    if number == 0:
        d[0] = x[1]
        d[1] = (u - p[1] * x[0] - p[2] * x[1]) / p[0]
    elif number == 1:
        t = p[2] * (x[0] - x[2]) + p[3] * (x[1] - x[3])
        d[0], d[2] = x[1], x[3]
        d[1] = (u - t - p[4] * x[1]) / p[0]
        d[3] = t / p[1]
    elif number == 2:
        d[0] = x[1]
        d[1] = (u - p[1] * x[1] - x[0] / p[2]) / p[0]
    else:
        gap = x[0] - x[1]
        a = p[2] * np.sign(gap) * (np.sqrt(abs(gap)) if abs(gap) > 0.01 else abs(gap) * 10.0)
        b = p[3] * (np.sqrt(x[1]) if x[1] > 0.01 else x[1] * 10.0)
        d[0] = (u - a) / p[0]
        d[1] = (a - b) / p[1]
    return d


@numba.njit(cache=True)
def _force(kind, x, v, z, q, t):
    """Resisting force at the port; LuGre for friction, with damping of the bristles."""
    if kind == 1:
        rate = v - abs(v) * z / q[1]
        return q[0] * (z / q[1] + q[2] * rate)
    if kind == 2:
        return q[0] * v * abs(v)
    if kind == 3:
        return q[0] * x**3
    if kind == 4:
        return q[0] * np.sin(x + q[1])
    if kind == 5:
        return q[0]
    if kind == 6:  # a load that comes
        return q[0] if t > q[1] else 0.0
    if kind == 7:  # drag that grows with time
        return q[0] * v * (t / q[1]) ** 2
    if kind == 8:  # drag that depends on the way
        return q[0] * v * np.cos(q[1] * x) ** 2
    if kind == 9:
        return q[0] * z
    return 0.0


@numba.njit(cache=True)
def _memory(kind, z, v, q):
    """Rate of the bristles of friction (1), or of the memory of hysteresis (9)."""
    if kind == 1:
        return v - abs(v) * z / q[1]
    if kind == 9:
        return (v - 0.5 * abs(v) * z - 0.5 * v * abs(z)) / q[1]
    return 0.0


@numba.njit(cache=True)
def _solved(number, states, p, fine, step, per, kind, q, rows):
    """Midpoint steps; returns (rows, 4) states at the samples."""
    x = states.copy()
    out = np.zeros((rows, 4))
    out[0] = x
    z = 0.0
    for k in range(len(fine)):
        t = k * step
        f1 = _force(kind, x[0], x[1], z, q, t)
        a = _rates(number, x, fine[k] - f1, p)
        z1 = z + 0.5 * step * _memory(kind, z, x[1], q)
        w = x + 0.5 * step * a
        f2 = _force(kind, w[0], w[1], z1, q, t + 0.5 * step)
        x = x + step * _rates(number, w, fine[k] - f2, p)
        z = z + step * _memory(kind, z1, w[1], q)
        if (k + 1) % per == 0:
            out[(k + 1) // per] = x
    return out


KINDS = {"coulomb_friction": 1, "quadratic_drag": 2, "hardening_spring": 3, "gravity": 4, "load": 5,
         "unknown_coming_load": 6, "unknown_growing_drag": 7, "unknown_patchy_drag": 8, "hysteresis": 9}  # fmt: skip


@dataclass(frozen=True)
class Case:
    """A record and what is hidden in it."""

    domain: Domain
    names: tuple
    sizes: tuple
    parameters: tuple
    time: np.ndarray
    u: np.ndarray
    y: np.ndarray


def excitation(domain: Domain, rng, n: int) -> np.ndarray:
    """Steps and a few sines, held over the samples; positive for the tanks."""
    u = np.zeros(n)
    at = 0
    while at < n:
        length = int(rng.integers(8, 120))
        u[at : at + length] = rng.uniform(-1.0, 1.0)
        at += length
    t = np.arange(n) * domain.h
    for _ in range(3):
        u += 0.3 * np.sin(2 * np.pi * rng.uniform(0.002, 0.06) / domain.h * t + rng.uniform(0, 6.28))
    return domain.drive * (u + domain.offset)


def _through(name: str, u, fine_step: float, size: float):
    fine = np.repeat(u[:-1], FINE)
    if name == "input_saturation":
        return np.clip(fine, -size, size)
    if name == "input_dead_zone":
        return np.sign(fine) * np.maximum(np.abs(fine) - size, 0.0)
    if name == "input_quantisation":
        return size * np.rint(fine / size)
    if name == "input_delay":
        late = round(size / fine_step)
        return np.concatenate([np.full(late, fine[0]), fine[: len(fine) - late]])
    from scipy.signal import lfilter

    share = -np.expm1(-fine_step / size)
    ends = lfilter([share], [1.0, share - 1.0], fine, zi=[(1.0 - share) * fine[0]])[0]
    return 0.5 * (ends + np.concatenate([fine[:1], ends[:-1]]))


def record(domain: Domain, names: tuple, rng, n: int = 1200, scale: float = 1.0, disturbance: float = 0.0) -> Case:
    """Make a record with effects hidden; ``disturbance``: coloured noise at the input as a share of the drive."""
    p = np.array([v * (1.0 + rng.uniform(-0.05, 0.05)) for v, _ in domain.parameters.values()])
    u = excitation(domain, rng, n)
    plain = simulate(domain, p, np.repeat(u[:-1], FINE), 0, np.zeros(3), n)
    speed = float(np.std(np.gradient(plain[:, 0], domain.h)))
    way, drive = float(np.std(plain[:, 0])), float(np.std(u))
    fine_step = domain.h / FINE
    kind, q, sizes, arriving = 0, np.zeros(3), [], np.repeat(u[:-1], FINE)
    for name in names:
        share = scale * float(np.exp(rng.uniform(np.log(0.05), np.log(0.25))))
        if name == "input_saturation":
            size = float(np.quantile(np.abs(u), 1.0 - 0.6 * share))
        elif name == "input_dead_zone":
            size = 0.3 * share * drive
        elif name in ("input_delay", "input_lag"):
            size = round(20.0 * share * FINE) * fine_step
        elif name == "input_quantisation":
            size = 0.25 * share * drive
        elif name in ("unknown_dropouts", "sensed_input"):
            size = 0.0
        else:
            kind = KINDS[name]
            size = share * drive / {2: speed**2, 3: way**3, 7: 0.15 * speed, 8: 0.3 * speed}.get(kind, 1.0)
            q = np.array([size, 0.0, 0.0])
            q[1] = {1: 0.02 * way, 4: rng.uniform(0, 6.28), 6: 0.4 * n * domain.h, 7: 0.7 * n * domain.h,
                    8: 4.0 / way, 9: 0.6 * way}.get(kind, 0.0)  # fmt: skip
            q[2] = 0.1 * domain.h if kind == 1 else 0.0
        sizes.append(size)
        if name.startswith("input_"):
            arriving = _through(name, u, fine_step, size) if len(arriving) and np.array_equal(
                arriving, np.repeat(u[:-1], FINE)) else arriving  # fmt: skip
        if name == "sensed_input":  # straight lines between rows, which the record's rows are points of
            arriving = np.interp((np.arange((n - 1) * FINE) + 0.5) / FINE, np.arange(n), u)
        if name == "unknown_dropouts":
            arriving = arriving.copy()
            for at in rng.integers(0, n - 10, 12):
                arriving[at * FINE : (at + int(rng.integers(2, 8))) * FINE] = 0.0
    if disturbance:
        from scipy.signal import lfilter

        white = rng.standard_normal(n - 1)
        colour = lfilter([np.sqrt(1 - 0.8**2)], [1.0, -0.8], white)
        arriving = arriving + np.repeat(disturbance * drive * colour, FINE)
    states = simulate(domain, p, arriving, kind, q, n)
    places = {0: (0,), 1: (0, 2), 2: (0,), 3: (0, 1)}[domain.number]
    y = states[:, places] + rng.standard_normal((n, len(places))) * np.array(domain.noise)
    return Case(domain, names, tuple(sizes), tuple(p), np.arange(n) * domain.h, u, y)


def simulate(domain, p, fine, kind, q, n):
    return _solved(domain.number, np.zeros(4), p, fine, domain.h / FINE, FINE, kind, q, n)


def write_record(path: Path, case: Case) -> Path:
    """Write a record as CSV."""
    header = ",".join(["time", case.domain.input[0], *(name for name, _ in case.domain.outputs)])
    table = np.column_stack([case.time, case.u, case.y])
    np.savetxt(path, table, fmt="%.10g", delimiter=",", header=header, comments="")
    return path


@numba.njit(cache=True)
def _coupled(p, u, h, per, gap, soft):
    """Motor and load in midpoint steps; between them a gap, and a spring in series with the shaft's."""
    x, out = np.zeros(4), np.zeros((len(u), 4))
    stiffness = 1.0 / (1.0 / p[3] + soft)
    step = h / per
    for k in range(len(u) - 1):
        for _ in range(per):
            w = x.copy()
            for share in (0.5, 1.0):
                twist = w[0] - w[2]
                t = stiffness * (twist - min(max(twist, -0.5 * gap), 0.5 * gap))
                d = np.array([w[1], (u[k] - t - p[1] * w[1]) / p[0], w[3], (t - p[4] * w[3]) / p[2]])
                w = x + share * step * d
            x = w
        out[k + 1] = x
    return out


def coupled_record(path: Path, rng, n: int, gap: float = 0.0, soft: float = 0.0) -> Path:
    """Write a record of motor and load, coupled with a gap [rad] or a compliance [rad/N.m]."""
    nominal = [v for domain in (MOTOR, LOAD) for v, _ in domain.parameters.values()]
    p = np.array(nominal) * (1.0 + np.array([*rng.uniform(-0.05, 0.05, 3), 0.0, *rng.uniform(-0.05, 0.05, 1)]))
    u = excitation(MOTOR, rng, n)
    x = _coupled(p, u, MOTOR.h, 8 * FINE, gap, soft)
    y = x[:, (0, 2)] + 3e-4 * rng.standard_normal((n, 2))
    np.savetxt(path, np.column_stack([np.arange(n) * MOTOR.h, u, y]), fmt="%.10g", delimiter=",",
               header="time,M,phi_m,phi_l", comments="")  # fmt: skip
    return path


@numba.njit(cache=True)
def _changing(p, u, h, per, rate, slope, warmth):
    """A mass on a spring that changes with time or with a signal, in midpoint steps."""
    x, out = np.zeros(2), np.zeros((len(u), 2))
    step = h / per
    for k in range(len(u) - 1):
        for j in range(per):
            w = x.copy()
            for share in (0.5, 1.0):
                time = k * h + (j + 1.0 - share) * step
                stiffness = p[1] + rate * time + slope * warmth[k]
                d = np.array([w[1], (u[k] - stiffness * w[0] - p[2] * w[1]) / p[0]])
                w = x + share * step * d
            x = w
        out[k + 1] = x
    return out


def changing_record(path: Path, rng, n: int, rate: float = 0.0, slope: float = 0.0) -> Path:
    """Write a record of the mass on a spring, whose stiffness changes; ``T`` is a temperature above 20 degrees."""
    domain = DOMAINS[0]
    p = np.array([v * (1.0 + rng.uniform(-0.05, 0.05)) for v, _ in domain.parameters.values()])
    u = excitation(domain, rng, n)
    warmth = 10.0 * (1.0 - np.exp(-np.arange(n) / (0.3 * n))) + 3.0 * np.sin(np.arange(n) * 9.0 / n)
    x = _changing(p, u, domain.h, FINE, rate, slope, warmth)
    y = x[:, 0] + domain.noise[0] * rng.standard_normal(n)
    np.savetxt(path, np.column_stack([np.arange(n) * domain.h, u, y, 20.0 + warmth]), fmt="%.10g", delimiter=",",
               header="time,F,x,T", comments="")  # fmt: skip
    return path
