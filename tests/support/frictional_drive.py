"""Records of drives with dry friction, by a simulator that shares no code or formulation with the library.

Small fixed Runge-Kutta steps over the angles of both bodies; friction of LuGre's bristles (Canudas de Wit et al., IEEE
Trans. Automatic Control 40(3), 1995) or of a smooth Stribeck curve; teeth whose damping sets in with depth or at once;
a torque that is held between rows or goes on between them, and acts late.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numba import njit

from tests.support.excitations import multisine
from tests.support.sized_drive import Drive, draw_drive

BAND = 6.0  # Hz, up to which the torque moves the machine
STEPS = 40  # Runge-Kutta steps in a sample
SITES = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])  # whether motor and load have dry friction
LINEAR = ("J_m", "J_l", "k", "c", "b_m", "b_l", "i", "tau")


@dataclass(frozen=True)
class FrictionalDrive:
    """A drive, its record and what a model file would say of it.

    Attributes:
        nominal: parameters of the model file.
        linear: those of the machine, up to 5 % off.
        gap: half-gap at the load [rad].
        shares: dry friction of motor and load over the rms of the drive's torque there.
        friction: "lugre" or "stribeck".
        held: whether the torque is held from row to row.
        late: by what the torque acts later than its rows say [s].
        torque: rms of the drive's torque [N.m].
        gain: torque of the drive over what the record says.
        columns: time, u, theta_m and theta_l of the record.
    """

    nominal: Mapping[str, float]
    linear: Mapping[str, float]
    gap: float
    shares: tuple[float, float]
    friction: str
    held: bool
    late: float
    torque: float
    gain: float
    columns: Mapping[str, np.ndarray]

    def model_text(self) -> str:
        """Return the model file: every parameter but the ratio known to 5 %."""
        lines = ['fmu = "Drivetrain"']
        for name, value in self.nominal.items():
            lines += [f"[parameters.{name}]", f"value = {value!r}"]
            lines += [] if name == "i" else ["relative_uncertainty = 0.05"]
        return "\n".join(lines) + "\n"


@njit(cache=True)
def _dry(lugre, z, w, h, level, extra, slow, bend, inertia):
    """Return bristle and mean torque of dry friction over ``h`` at the speed ``w``."""
    if level <= 0.0:
        return 0.0, 0.0
    reach = level + extra * np.exp(-((w / slow) ** 2))
    if not lugre:
        return 0.0, reach * np.tanh(w / (0.05 * slow))
    sigma = level / bend
    settled = reach / sigma * np.sign(w)
    new = settled + (z - settled) * np.exp(-sigma * abs(w) * h / reach)
    damper = 0.6 * np.sqrt(sigma * inertia)
    return new, sigma * 0.5 * (z + new) + damper * (new - z) / h


@njit(cache=True)
def _rates(x, p, gap, depth, asked, fm, fl):
    J_m, J_l, k, c, b_m, b_l, ratio, tau = p
    twist, rate = x[0] / ratio - x[2], x[1] / ratio - x[3]
    shaft = 0.0
    if abs(twist) > gap:
        over = twist - np.sign(twist) * gap
        share = min(abs(over) / depth, 1.0) if depth > 0.0 else 1.0
        shaft = k * over + share * c * rate
        if depth > 0.0 and shaft * over < 0.0:
            shaft = 0.0
    return np.array([
        x[1], (x[4] - b_m * x[1] - fm - shaft / ratio) / J_m,
        x[3], (shaft - b_l * x[3] - fl) / J_l, (asked - x[4]) / tau,
    ])  # fmt: skip


@njit(cache=True)
def _simulate(p, gap, depth, lugre, dry, torque, step, steps):
    """Return the states (n, 5) under a torque (n * steps,) that is given for each Runge-Kutta step."""
    n = torque.size // steps
    h = step / steps
    x, z = np.zeros(5), np.zeros(2)
    states = np.empty((n, 5))
    for row in range(n):
        states[row] = x
        for m in range(steps):
            asked = torque[row * steps + m]
            z[0], fm = _dry(lugre, z[0], x[1], h, dry[0, 0], dry[0, 1], dry[0, 2], dry[0, 3], p[0])
            z[1], fl = _dry(lugre, z[1], x[3], h, dry[1, 0], dry[1, 1], dry[1, 2], dry[1, 3], p[1])
            k1 = _rates(x, p, gap, depth, asked, fm, fl)
            k2 = _rates(x + 0.5 * h * k1, p, gap, depth, asked, fm, fl)
            k3 = _rates(x + 0.5 * h * k2, p, gap, depth, asked, fm, fl)
            k4 = _rates(x + h * k3, p, gap, depth, asked, fm, fl)
            x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
    return states


def _twist(drive: Drive) -> float:
    """Return the shaft's twist under the rms of the drive's torque, over the half-gap."""
    return drive.torque * drive.linear["i"] / (drive.linear["k"] * drive.gap)


def draw_frictional_drive(seed: int, least: float = 0.006, most: float = 0.05) -> FrictionalDrive:
    """Return a drive of :func:`draw_drive`'s sizes with dry friction of a share ``least`` to ``most`` of its torque.

    Any 32 drives in a row have each site (none, motor, load, both) as often, in drives as they come and in those whose
    shaft twists much against the gap, with either kind of friction, under a torque that is held or sampled.
    """
    site, soft, lugre, held = seed % 4, seed // 4 % 2, seed // 8 % 2 == 1, seed // 16 % 2 == 1
    drive = max((draw_drive(seed + 1_000_000 * n) for n in range(8 if soft else 1)), key=_twist)
    rng = np.random.default_rng([seed, 61])
    linear = {name: drive.linear[name] * (1.0 if name == "i" else 1.0 + 0.05 * rng.uniform(-1, 1)) for name in LINEAR}
    shares = rng.uniform(least, most, 2) * SITES[site]
    sharp = rng.random() < 0.5
    late, gain = float(rng.uniform(1e-3, 3e-3)), float(1.0 + 0.03 * rng.uniform(-1, 1))
    step, rows = 1.0 / drive.rate, round(drive.seconds * drive.rate)
    # A request on a fine grid: held in steps of a sample or not, late either way.
    u = multisine(rng, rows, step, 1.0, BAND)
    u *= drive.torque / float(np.std(u))
    ratio, k = linear["i"], linear["k"]
    if held:
        u = np.array([float(f"{value:.6g}") for value in u])
        fine = np.repeat(u, STEPS)
    else:
        from scipy.interpolate import CubicSpline

        fine = CubicSpline(np.arange(rows), u)(np.minimum((np.arange(rows * STEPS) + 0.5) / STEPS, rows - 1))
    shift = round(late / step * STEPS)
    fine = np.concatenate([np.zeros(shift), fine])[: fine.size]
    speed = drive.acceleration / (2.0 * np.pi * 2.0)  # rms, about
    dry = np.zeros((2, 4))
    for body, (share, unit) in enumerate(zip(shares, (drive.torque, drive.torque * ratio), strict=True)):
        level = share * unit
        fast = speed * (ratio if body == 0 else 1.0)
        dry[body] = level, level * float(rng.uniform(0.0, 0.5)), 0.03 * fast, 2e-4 * fast
    depth = 0.0 if sharp else 0.15 * drive.torque * ratio / k
    p = np.array([linear[name] for name in LINEAR])
    states = _simulate(p, drive.gap, depth, lugre, dry, gain * fine, step, STEPS)
    unit = 2.0 * np.pi / (4.0 * np.array(drive.counts))
    seen = states[:, [0, 2]] + 0.3 * unit * rng.standard_normal((rows, 2)) + rng.uniform(-1, 1, 2) * 0.5 * drive.gap
    seen = np.round(seen / unit) * unit
    columns = {"time": np.arange(rows) * step, "u": u, "theta_m": seen[:, 0].copy(), "theta_l": seen[:, 1].copy()}
    return FrictionalDrive(
        dict(drive.linear), linear, drive.gap, (float(shares[0]), float(shares[1])),
        "lugre" if lugre else "stribeck", held, late, drive.torque, gain, columns,
    )  # fmt: skip
