"""Records of the plants of five domains, with effects hidden around them.

A sample is solved in ``FINE`` midpoint steps; friction is LuGre, series effects are streamed from step to step, so
that records in closed loop can be made. Nothing is shared with the library.
"""

from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np

from benchmarks.any_fmu_plants import INPUTS, INSIDE, OUTPUTS, PORTS, SPEEDS, Plant, rates

FINE = 40


@numba.njit(cache=True)
def force(kind, x, v, z, q, t):
    """Return the effort against the motion, and the rate of the bristles of friction."""
    if kind == 0 or kind == 1:
        level = q[0]
        if kind == 1:
            level = q[0] + (q[1] - q[0]) * np.exp(-((v / q[2]) ** 2))
        rate = v - abs(v) * z / q[3]
        return level * (z / q[3] + q[4] * rate), rate
    if kind == 2:
        return q[0] * v * abs(v), 0.0
    if kind == 3:
        return q[0] * v, 0.0
    if kind == 4:
        return q[0] * x, 0.0
    if kind == 5:
        return q[0] * x**3, 0.0
    if kind == 6:
        return q[0] * np.sin(x) + q[0] * q[1] * np.cos(x), 0.0
    if kind == 7:
        return q[0] * np.sin(q[1] * x + q[2]), 0.0
    if kind == 8:
        return q[0], 0.0
    if kind == 9:
        return q[0] * abs(v), 0.0
    if kind == 10:
        return (q[0] if t > q[1] else 0.0), 0.0
    if kind == 11:
        return q[0] * v * (t / q[1]) ** 3, 0.0
    if kind == 12:
        return (q[0] * v if np.sin(x * q[1]) > 0.3 else 0.0), 0.0
    return q[0] * v / (1.0 + ((x - q[1]) / q[2]) ** 2), 0.0


@numba.njit(cache=True)
def arrives(kind, u, size, held, buffer, at, step, drop):
    """Return what arrives of ``u`` behind an effect in series, one fine step later; ``held`` is its memory."""
    if kind == 0:
        return u * (1.0 + size)
    if kind == 1:
        return u + size
    if kind == 2:
        buffer[at % len(buffer)] = u
        late = at - int(np.rint(size / step))
        return buffer[late % len(buffer)] if late >= 0 else buffer[0]
    if kind == 3:
        gap = held[0] - u
        held[0] = u + gap * np.exp(-step / size)
        return u + gap * size / step * (1.0 - np.exp(-step / size))
    if kind == 4:
        return min(max(u, -size), size)
    if kind == 5:
        return np.sign(u) * max(abs(u) - size, 0.0)
    if kind == 6:
        before, most = held[0], size * step
        held[0] += min(max(u - before, -most), most)
        way = held[0] - before  # it takes abs(way) / most of the step, and the rest of it stays there
        return held[0] - 0.5 * way * abs(way) / most
    if kind == 7:
        return size * np.rint(u / size)
    return 0.0 if drop else u


@numba.njit(cache=True)
def solved(number, p, start, given, loop, h, fine, series, size, port, q, place, speed, inside, added, noise,
           sensed, drops):  # fmt: skip
    """Return inputs (n, inputs), states (n, 4), and the state ``sensed`` between the samples too (n * fine).

    In closed loop the first input follows the noisy first output.
    """
    n = len(given)
    u, out, between = given.copy(), np.zeros((n, 4)), np.zeros(n * fine)
    x, z, step = start.copy(), 0.0, h / fine
    held, buffer = np.zeros(1), np.zeros(64 * fine)
    turn = -1.0 if number == 11 else 1.0  # the input pushes against the position
    before, now = 0.0, np.zeros(given.shape[1])
    for k in range(n):
        out[k] = x
        if len(loop):
            y = x[sensed] + noise[k]
            rate = (y - before) / h if k else 0.0
            u[k, 0] = turn * (loop[0] * (given[k, 0] - y) - loop[1] * rate)
            before = y
        if k == 0:
            held[0] = u[0, 0]
        now[:] = u[k]
        for j in range(fine):
            t = k * h + j * step
            between[k * fine + j] = x[sensed]
            now[0] = u[k, 0]
            if series >= 0:
                now[0] = arrives(series, u[k, 0], size, held, buffer, k * fine + j, step, drops[k])
            now[0] += added[k]
            v = x[speed] if speed >= 0 else 0.0
            f, rate1 = force(port, x[place], v, z, q, t) if port >= 0 else (0.0, 0.0)
            w = x + 0.5 * step * rates(number, x, now, -f, p, inside)
            v = w[speed] if speed >= 0 else 0.0
            g, rate2 = force(port, w[place], v, z + 0.5 * step * rate1, q, t + 0.5 * step) if port >= 0 else (0.0, 0.0)
            x = x + step * rates(number, w, now, -g, p, inside)
            z += step * rate2
    return u, out, between


@dataclass(frozen=True)
class Case:
    """A record and what is hidden in it; ``ratio``: what the effects change, over the noise; ``told``: the smallest of
    what each changes beyond what parameters and the other's size can take up."""

    plant: Plant
    names: tuple[str, ...]
    sizes: tuple[float, ...]
    parameters: tuple[float, ...]
    closed: bool
    ratio: float
    told: float
    time: np.ndarray
    u: np.ndarray
    y: np.ndarray

    def write(self, path: Path) -> Path:
        """Write the record as CSV."""
        header = ",".join(["time", *(i[0] for i in self.plant.inputs), *(o[0] for o in self.plant.outputs)])
        table = np.column_stack([self.time, self.u, self.y])
        np.savetxt(path, table, fmt="%.10g", delimiter=",", header=header, comments="")
        return path


def excitation(drive: float, offset: float, h: float, rng, n: int) -> np.ndarray:
    """Return steps and a few sines, held over the samples."""
    u = np.zeros(n)
    at = 0
    while at < n:
        length = int(rng.integers(8, 120))
        u[at : at + length] = rng.uniform(-1.0, 1.0)
        at += length
    t = np.arange(n) * h
    for _ in range(3):
        u += 0.3 * np.sin(2 * np.pi * rng.uniform(0.002, 0.06) / h * t + rng.uniform(0, 6.28))
    return drive * (u + offset) if offset == 0.0 else drive * np.maximum(u + offset, 0.0)


class Maker:
    """Makes one record: a plant with true parameters and a drive, and effects of chosen sizes."""

    def __init__(self, plant: Plant, rng, n: int, closed: bool, disturbance: float) -> None:
        from scipy.signal import lfilter

        self.plant, self.rng, self.n, self.closed = plant, rng, n, closed
        nominal = np.array(list(plant.parameters.values()))
        self.p = nominal * (1.0 + rng.uniform(-0.05, 0.05, len(nominal)))
        self.given = np.column_stack([excitation(d, o, plant.h, rng, n) for _, d, o in plant.inputs])
        for k, (_, drive, offset) in enumerate(plant.inputs):
            if drive == 0.0:
                self.given[:, k] = offset
        self.loop = np.zeros(0)
        self.sigma = np.array([s for _, _, s in plant.outputs])
        self.noise = rng.standard_normal((n, len(self.sigma))) * self.sigma
        self.places = [place for _, place, _ in plant.outputs]
        self.drops = np.zeros(n, dtype=np.bool_)
        for at in rng.integers(0, n - 10, 12):
            self.drops[at : at + int(rng.integers(2, 8))] = True
        self.added = np.zeros(n)
        plain = self.run((), ())[1]
        if closed:
            self.loop = np.array(plant.loop)
            wish = lfilter([0.1], [1.0, -0.9], self.given[:, 0])
            free = plant.loop[0] if plant.number in (4, 11) else 0.0
            way = np.std(self.given[:, 0]) / free if free else np.std(plain[:, 0])
            self.given[:, 0] = 2.0 * way * wish / np.std(wish)
        used, self.plain = self.run((), ())
        self.drive = float(np.std(used[:, 0]))
        self.command = used[:, 0]
        speed = SPEEDS.get(plant.number, -1)
        place = plant.port[3]
        self.way = float(np.std(self.plain[:, place]))
        self.span = float(np.max(np.abs(self.plain[:, place] - np.mean(self.plain[:, place]))))
        self.speed = float(np.std(self.plain[:, speed])) if speed >= 0 else 1.0
        if disturbance:
            white = rng.standard_normal(n)
            self.added = disturbance * self.drive * lfilter([np.sqrt(1 - 0.8**2)], [1.0, -0.8], white)
        self.shape = rng.uniform(0.0, 1.0, 4)

    def law(self, name: str, size: float) -> tuple[int, np.ndarray]:
        """Return number and parameters of the law at the port for a size (an effort)."""
        q, s = np.zeros(5), self.shape
        q[0] = size
        q[3], q[4] = (0.003 + 0.04 * s[0]) * self.way, 0.1 * self.plant.h
        if name == "stribeck_friction":
            q[1], q[2] = size * (1.4 + s[1]), (0.1 + 0.3 * s[2]) * self.speed
        elif name == "quadratic_drag":
            q[0] = size / self.speed**2
        elif name in ("viscous_drag", "directional_friction", "unknown_growing_drag", "unknown_patchy_drag",
                      "unknown_sticking_spot"):  # fmt: skip
            q[0] = size / self.speed
            q[1], q[2] = {"unknown_growing_drag": (0.7 * self.n * self.plant.h, 0.0),
                          "unknown_patchy_drag": (4.0 / self.way, 0.0),
                          "unknown_sticking_spot": (0.7 * self.way, 0.15 * self.way)}.get(name, (0.0, 0.0))  # fmt: skip
        elif name == "spring":
            q[0] = size / self.way
        elif name == "hardening_spring":
            q[0] = size / self.way**3
        elif name == "gravity":
            q[1] = 2.0 * s[1] - 1.0
        elif name == "ripple":
            q[1], q[2] = (3.0 + 6.0 * s[1]) / self.span, 6.28 * s[2]
        elif name == "unknown_coming_load":
            q[1] = (0.3 + 0.4 * s[1]) * self.n * self.plant.h
        return PORTS.index(name), q

    def series(self, name: str, share: float) -> float:
        """Return the size of an effect in series for a share of the drive."""
        top, h = float(np.max(np.abs(self.command))), self.plant.h
        if name == "input_saturation":
            return top * (1.0 - min(share, 0.8))
        if name in ("input_dead_zone", "input_quantisation"):
            return share * self.drive
        if name in ("input_delay", "input_lag"):
            size = 8.0 * share * h
            return max(round(size * FINE / h), 1) * h / FINE if name == "input_delay" else size
        if name == "input_rate_limit":
            return 0.1 * self.drive / h / max(share, 1e-3)
        return share if name == "input_gain" else share * self.drive

    def run(self, names: tuple[str, ...], shares: tuple[float, ...], p=None, noisy: bool = False):
        """Return inputs and outputs without measurement noise (``noisy``: it goes round the loop)."""
        plant, (series, size), (port, q), inside = self.plant, (-1, 0.0), (-1, np.zeros(5)), 0.0
        for name, share in zip(names, shares, strict=True):
            if name in INPUTS:
                series, size = INPUTS.index(name), self.series(name, share)
            elif name in PORTS:
                port, q = self.law(name, share * self.drive)
            elif name == INSIDE:
                inside = share * {1: 0.05, 3: 0.5, 6: 1.0, 7: 0.2}[plant.number]
        noise = self.noise[:, 0] if noisy else np.zeros(self.n)
        u, x, between = solved(
            plant.number, self.p if p is None else p, np.array(plant.start), self.given, self.loop, plant.h, FINE,
            series, size, port, q, plant.port[3], SPEEDS.get(plant.number, -1), inside,
            self.added if noisy else np.zeros(self.n), noise, self.places[0], self.drops,
        )  # fmt: skip
        y = x[:, self.places]
        for name, share in zip(names, shares, strict=True):
            if name in OUTPUTS:
                y = self.behind(name, x, between, share)
        return u, (x if not names and not noisy and p is None else y)

    def behind(self, name: str, x: np.ndarray, between: np.ndarray, share: float) -> np.ndarray:
        """Return outputs, the first behind an effect in series; ``between``: its state in every fine step."""
        y, step = x[:, self.places], self.plant.h / FINE
        found = y.copy()
        if name == "output_delay":
            time = step * np.arange(len(between))
            found[:, 0] = np.interp(time - self.size(name, share), time, between)[::FINE]
        elif name == "output_lag":
            late, decay = between.copy(), np.exp(-step / self.size(name, share))
            for k in range(1, len(late)):
                middle = 0.5 * (between[k - 1] + between[k])
                late[k] = middle + (late[k - 1] - middle) * decay
            found[:, 0] = late[::FINE]
        else:
            found[:, 0] = y[:, 0] * (1.0 + share) if name == "output_gain" else y[:, 0] + share * self.sigma[0]
        return found

    def size(self, name: str, share: float) -> float:
        """Return the size as the bank counts it."""
        if name in INPUTS:
            return self.series(name, share) if name != "unknown_dropouts" else 0.0
        if name in PORTS:
            return float(self.law(name, share * self.drive)[1][0])
        if name == "output_quantisation":
            return share * self.sigma[0]
        return share * {"output_delay": 4.0 * self.plant.h, "output_lag": 8.0 * self.plant.h}.get(name, 1.0)

    def share_for(self, names: tuple[str, ...], at: int, shares: list[float], wanted: float) -> float:
        """Return the share at which effect ``at`` changes an output by ``wanted`` times its noise, at most 0.6."""
        low, high = 1e-5, 0.6
        one = (names[at],)
        base = self.run((), ())[1][:, self.places]

        def ratio(share: float) -> float:
            y = self.run(one, (share,))[1]
            return float(np.max(np.sqrt(np.mean((y - base) ** 2, axis=0)) / self.sigma))

        if ratio(high) < wanted:
            return high
        for _ in range(14):
            middle = np.sqrt(low * high)
            low, high = (low, middle) if ratio(middle) > wanted else (middle, high)
        return float(high)

    def case(self, names: tuple[str, ...], low: float, high: float) -> Case:
        """Return the record with effects of ``low`` to ``high`` times the noise."""
        shares: list[float] = []
        for at, _ in enumerate(names):
            wanted = float(np.exp(self.rng.uniform(np.log(low), np.log(high))))
            shares.append(self.share_for(names, at, shares, wanted))
        given = tuple(shares)
        base = self.run((), ())[1][:, self.places]
        bare = self.run(names, given)[1] if names else base
        change = (bare - base) / self.sigma
        columns = []
        for k in range(len(self.p)):
            p = self.p.copy()
            p[k] *= 1.001
            columns.append(((self.run((), (), p)[1] - base) / self.sigma).ravel())
        J = np.column_stack(columns)
        tolds = [self.unexplained_change(given_one, J) for given_one in self.alone(names, given, base)]
        u, y = self.run(names, given, noisy=True)
        if not (np.all(np.isfinite(u)) and np.all(np.isfinite(y))):  # the loop does not bear these sizes
            return self.case(names, low, high)
        if not names:
            y = y if y.shape[1] == len(self.places) else y[:, self.places]
        ratio = float(np.max(np.sqrt(np.mean(change**2, axis=0))))
        sizes = tuple(self.size(n, s) for n, s in zip(names, given, strict=True))
        time = np.arange(self.n) * self.plant.h
        told = min(tolds, default=0.0)
        return Case(self.plant, names, sizes, tuple(self.p), self.closed, ratio, told, time, u, y + self.noise)

    def alone(self, names: tuple[str, ...], shares: tuple[float, ...], base: np.ndarray) -> list[np.ndarray]:
        """Return what all effects change, and in further columns what the others do without each of them."""
        whole = (self.run(names, shares)[1] - base) / self.sigma if names else np.zeros_like(base)
        found = []
        for at in range(len(names)):
            rest = tuple(n for k, n in enumerate(names) if k != at)
            left = tuple(share for k, share in enumerate(shares) if k != at)
            without = [(self.run(rest, left)[1] - base) / self.sigma] if rest else []
            found.append(np.stack([whole, *without], axis=2))
        return found

    @staticmethod
    def unexplained_change(changes: np.ndarray, J: np.ndarray) -> float:
        """Return what an effect changes beyond what parameters and the size of the others take up, over the noise."""
        change = changes[:, :, 0] - np.sum(changes[:, :, 1:], axis=2)
        known = np.column_stack([J, *(changes[:, :, k].ravel() for k in range(1, changes.shape[2]))])
        left = change.ravel() - known @ np.linalg.lstsq(known, change.ravel(), rcond=None)[0]
        return float(np.sqrt(np.mean(left**2) * change.shape[1]))
