"""Records of machines outside the class of the models: nothing sure may be said of them.

    python -m benchmarks.outside_class [--records 60] [--seed 1] [--only KIND] [--out DIR]

Six kinds, each with two encoders (``Drivetrain``) and one (``ServoAxis``): a displacement that is prescribed, two
resonances more than the model has, electrical dynamics, a broken channel, channels of different machines, someone who
pushes. One line a record, in two processes, then what was named under which grade by kind. ``NEAR`` holds names that
are not wrong: relatives of what is there. An interrupted run goes on where it stopped.
"""

import argparse
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from benchmarks.judging import Row, Truth, grade_table, judge, seconds_line
from benchmarks.rows import run_tasks
from benchmarks.verdicts import GRADES, diagnose_record
from orchestrator.records.model_file import Model, read_model
from orchestrator.records.record import record_from_columns

Array = NDArray[np.float64]
Random = np.random.Generator
FINER = 10  # steps of the simulation in a sample
SECONDS = 10.0  # of a record
NEAR: dict[str, tuple[str, ...]] = {
    "resonances": ("extra_resonance@load",),
    "electrical": ("drive_filter@actuator", "input_delay@actuator"),
}


@dataclass(frozen=True)
class Machine:
    """A chain of bodies: inertias, viscous friction, links (body, body, stiffness, damping, ratio before) and drive.

    ``lag`` [s] is that of the torque; ``back`` [N.m.s/rad] the torque that speed takes inside of it; ``filter`` the
    angular frequency and damping ratio of what stands before it.
    """

    inertias: tuple[float, ...]
    friction: tuple[float, ...]
    links: tuple[tuple[int, int, float, float, float], ...] = ()
    lag: float = 2e-3
    back: float = 0.0
    filter: tuple[float, float] | None = None
    rate: float = 200.0
    stated: tuple[str, ...] = ()

    def angles(self, u: Array, pushed: Array) -> Array:
        """Return the angles (n, bodies) for torques ``u`` (n,), held, and ``pushed`` (n,) on the last body."""
        size = len(self.inertias)
        A, B = np.zeros((2 * size + 3,) * 2), np.zeros((2 * size + 3, 2))
        torque, voltage, rate = 2 * size, 2 * size + 1, 2 * size + 2
        A[:size, size : 2 * size] = np.eye(size)
        for n, (inertia, friction) in enumerate(zip(self.inertias, self.friction, strict=True)):
            A[size + n, size + n] -= friction / inertia
        for a, b, stiffness, damping, ratio in self.links:
            row = np.zeros(2 * size + 3)
            row[[a, b, size + a, size + b]] = stiffness / ratio, -stiffness, damping / ratio, -damping
            A[size + a] -= row / ratio / self.inertias[a]
            A[size + b] += row / self.inertias[b]
        A[size, torque] += 1.0 / self.inertias[0]
        A[torque, [torque, voltage, size]] = -1.0 / self.lag, 1.0 / self.lag, -self.back / self.lag
        natural, ratio = self.filter or (1.0 / 1e-4, 1.0)
        A[voltage, rate] = 1.0
        A[rate, [voltage, rate]] = -(natural**2), -2.0 * ratio * natural
        B[rate, 0], B[2 * size - 1, 1] = natural**2, 1.0 / self.inertias[-1]
        step = 1.0 / (self.rate * FINER)
        inputs = np.repeat(np.column_stack([u, pushed]), FINER, axis=0)
        system = (*signal.cont2discrete((A, B, np.eye(len(A)), np.zeros_like(B)), step)[:4], step)
        _, states, _ = signal.dlsim(system, inputs)
        return np.asarray(states[::FINER, :size])


def bench(rng: Random) -> Machine:
    """Return motor and load behind a gear, two encoders."""
    v = np.exp(rng.normal(0.0, 0.3, 6))
    k = 300.0 * v[2]
    return Machine((0.02 * v[0], 0.4 * v[1]), (0.05 * v[3], 0.2 * v[4]), ((0, 1, k, 1e-3 * k, 5.0),), 5e-3 * v[5],
                   stated=("J_m", "J_l", "k", "c", "b_m", "b_l", "tau"))  # fmt: skip


def axis(rng: Random) -> Machine:
    """Return a motor alone, one encoder."""
    v = np.exp(rng.normal(0.0, 0.3, 2))
    return Machine((0.01 * v[0],), (0.02 * v[1],), rate=500.0, stated=("J", "b"))


def model_of(machine: Machine, spread: float) -> Model:
    """Return the model file of a machine, each value known to ``spread``."""
    two = len(machine.stated) > 2
    values: dict[str, float] = {}
    if two:
        values = {"J_m": machine.inertias[0], "J_l": machine.inertias[1], "k": machine.links[0][2],
                  "c": machine.links[0][3], "b_m": machine.friction[0], "b_l": machine.friction[1],
                  "tau": machine.lag, "i": machine.links[0][4]}  # fmt: skip
    else:
        values = {"J": machine.inertias[0], "b": machine.friction[0], "tau": machine.lag}
    lines = [f'fmu = "{"Drivetrain" if two else "ServoAxis"}"']
    for name, value in values.items():
        lines += [f"[parameters.{name}]", f"value = {value:.6g}"]
        lines += [f"relative_uncertainty = {spread}"] if name in machine.stated else []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "model.toml"
        path.write_text("\n".join(lines) + "\n")
        return read_model(path)


def request(rng: Random, machine: Machine, seconds: float) -> Array:
    """Return a torque: filtered noise, steps, or both."""
    n = round(seconds * machine.rate)
    top = rng.uniform(4.0, 10.0)
    noise = signal.sosfilt(
        signal.butter(2, [0.2, top], "bandpass", fs=machine.rate, output="sos"), rng.standard_normal(n)
    )
    steps = np.repeat(rng.uniform(-1.0, 1.0, n), round(0.4 * machine.rate))[:n]
    steps = steps - signal.sosfilt(signal.butter(1, 0.3, fs=machine.rate, output="sos"), steps)
    share = rng.choice([0.0, 0.5, 1.0])
    return np.asarray((1.0 - share) * noise / noise.std() + share * steps / steps.std())


def smooth(rng: Random, machine: Machine, n: int, top: float) -> Array:
    """Return smooth noise (n,) of rms 1 below ``top`` [Hz]."""
    values = signal.sosfilt(signal.butter(2, top, fs=machine.rate, output="sos"), rng.standard_normal(n))
    return np.asarray(values / values.std())


@dataclass(frozen=True)
class Log:
    """What a log has: torque (n,) and angles (n, encoders), without noise."""

    u: Array
    angles: Array


def plain(rng: Random, machine: Machine, seconds: float = SECONDS) -> Log:
    """Return the log of the machine as it is."""
    u = request(rng, machine, seconds)
    return Log(u, machine.angles(u, np.zeros_like(u))[:, : 2 if len(machine.stated) > 2 else 1])


def displacement(rng: Random, machine: Machine) -> tuple[Log, float]:
    """The motor's angle is prescribed: a stiff position loop, or a stepper, makes it follow what is logged as ``u``."""
    u = request(rng, machine, SECONDS)
    loop = signal.butter(2, rng.uniform(8.0, 25.0), fs=machine.rate, output="sos")
    motor = rng.uniform(0.2, 2.0) * np.asarray(signal.sosfilt(loop, u))
    if len(machine.stated) == 2:
        return Log(u, motor[:, None]), 0.3
    (_, _, k, c, ratio), J, b = machine.links[0], machine.inertias[1], machine.friction[1]
    load = signal.lfilter(*signal.bilinear([c, k], [J, c + b, k], machine.rate), motor / ratio)
    return Log(u, np.column_stack([motor, load])), 0.3


def resonances(rng: Random, machine: Machine) -> tuple[Log, float]:
    """Two flexible parts more hang on the last body."""
    last, inertias, links = len(machine.inertias) - 1, list(machine.inertias), list(machine.links)
    for hertz in (rng.uniform(1.5, 4.0), rng.uniform(6.0, 12.0)):
        share, natural = rng.uniform(0.1, 0.4), 2.0 * np.pi * hertz
        inertias.append(share * machine.inertias[-1])
        k = inertias[-1] * natural**2
        links.append((last, len(inertias) - 1, k, 2.0 * 0.03 * k / natural, 1.0))
    friction = (*machine.friction, 0.0, 0.0)
    flexible = Machine(tuple(inertias), friction, tuple(links), machine.lag, rate=machine.rate, stated=machine.stated)
    return plain(rng, flexible), 0.1


def electrical(rng: Random, machine: Machine) -> tuple[Log, float]:
    """``u`` is a voltage, in torques at standstill, behind an LC filter, an inductance and the back-EMF."""
    back = machine.friction[0] * rng.uniform(3.0, 15.0)
    filtered = (2.0 * np.pi * rng.uniform(5.0, 15.0), rng.uniform(0.05, 0.2))
    return plain(
        rng,
        Machine(machine.inertias, machine.friction, machine.links, rng.uniform(0.02, 0.08), back, filtered,
                machine.rate, machine.stated),
    ), 0.3  # fmt: skip


def broken(rng: Random, machine: Machine) -> tuple[Log, float]:
    """A channel sticks, slips, is cut off, is torn by bursts, wraps; or the log of the torque drops out."""
    log = plain(rng, machine)
    u, angles, n = log.u.copy(), log.angles.copy(), log.u.size
    which = int(rng.integers(angles.shape[1]))
    angle, reach = angles[:, which], float(np.ptp(angles[:, which]))
    stretches = [slice(int(a), int(a + rng.uniform(0.05, 0.5) * machine.rate)) for a in np.sort(rng.integers(0, n, 12))]
    match str(rng.choice(["sticks", "slips", "cut off", "bursts", "wraps", "drops out"])):
        case "sticks":
            for rows in stretches:
                angle[rows] = angle[rows.start]
        case "slips":
            for rows in stretches:
                angle[rows.start :] += rng.choice([-1.0, 1.0]) * rng.uniform(0.01, 0.05) * reach
        case "cut off":
            angle[:] = np.clip(angle, *np.quantile(angle, [0.15, 0.85]))
        case "bursts":
            for rows in stretches:
                angle[rows] += 0.01 * reach * rng.standard_normal(angle[rows].size)
        case "wraps":
            angle[:] = np.mod(angle, 0.4 * reach)
        case _:
            for rows in stretches:
                u[rows] = 0.0
    return Log(u, angles), 0.1


def exchanged(rng: Random, machine: Machine) -> tuple[Log, float]:
    """One channel, or the torque, is that of another machine that moves at the same time."""
    own = plain(rng, machine)
    another = (bench if len(machine.stated) > 2 else axis)(rng)
    related = rng.random() < 0.5  # driven by the same request
    other = Log(own.u, another.angles(own.u, 0.0 * own.u)[:, : own.angles.shape[1]]) if related else plain(rng, another)
    if own.angles.shape[1] == 2 and rng.random() < 0.5:
        other = other if not related else plain(rng, another)
        return Log(own.u, np.column_stack([own.angles[:, 0], other.angles[:, 1]])), 0.1
    return Log(own.u[::-1].copy() if related else own.u, other.angles), 0.1


def by_hand(rng: Random, machine: Machine) -> tuple[Log, float]:
    """Someone pushes the last body, at times, as hard as the drive does."""
    u = request(rng, machine, SECONDS)
    ratio = machine.links[0][4] if machine.links else 1.0
    push = smooth(rng, machine, u.size, rng.uniform(0.5, 3.0))
    at_times = smooth(rng, machine, u.size, 0.3) > rng.uniform(-0.5, 0.5)
    hands = rng.uniform(0.2, 1.0) * ratio * push * smooth_edges(at_times.astype(float), machine)
    return Log(u, machine.angles(u, hands)[:, : 2 if len(machine.stated) > 2 else 1]), 0.1


def smooth_edges(values: Array, machine: Machine) -> Array:
    """Return values (n,) that change within a tenth of a second."""
    return np.asarray(signal.sosfilt(signal.butter(1, 3.0, fs=machine.rate, output="sos"), values))


KINDS: dict[str, Callable[[Random, Machine], tuple[Log, float]]] = {
    "displacement": displacement, "resonances": resonances, "electrical": electrical, "broken": broken,
    "exchanged": exchanged, "by_hand": by_hand,
}  # fmt: skip


@dataclass(frozen=True)
class OutsideTask:
    """One record of a machine outside the class, with two encoders or one."""

    kind: str
    seed: int
    two: bool

    @property
    def key(self) -> str:
        """Return what tells it from every other record."""
        return f"{self.kind}:{self.seed}:{'two' if self.two else 'one'}"


def outside_tasks(records: int, seed: int) -> list[OutsideTask]:
    """Return the records: kinds take turns, then seeds and numbers of encoders.

    Args:
        records: how many.
        seed: first one.

    Returns:
        The tasks.
    """
    kinds = len(KINDS)
    return [OutsideTask(list(KINDS)[n % kinds], seed + n // kinds, (n // kinds) % 2 == 0) for n in range(records)]


def diagnose_task(task: OutsideTask, settings: Any = None) -> Row:
    """Return what a diagnosis says of one record.

    Args:
        task: the record.
        settings: of the diagnosis; None: the default.

    Returns:
        The row.
    """
    rng = np.random.default_rng([task.seed, sorted(KINDS).index(task.kind), task.two])
    machine = (bench if task.two else axis)(rng)
    log, spread = KINDS[task.kind](rng, machine)
    noisy = log.angles + rng.standard_normal(log.angles.shape) * 2e-4 * np.ptp(log.angles, axis=0)
    columns = {"time": np.arange(log.u.size) / machine.rate, "u": log.u, "theta_m": noisy[:, 0]}
    columns |= {"theta_l": noisy[:, 1]} if task.two else {}
    outcome = diagnose_record(
        record_from_columns(columns, f"{task.kind}-{task.seed}"), model_of(machine, spread), settings
    )
    return Row(task.key, "outside", task.kind, outcome, judge(outcome, Truth(allowed=NEAR.get(task.kind, ()))))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--records", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", choices=tuple(KINDS))
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("results/outside_class"))
    args = parser.parse_args()
    tasks = [task for task in outside_tasks(args.records, args.seed) if args.only in (None, task.kind)]
    rows = run_tasks(tasks, diagnose_task, args.out / f"rows-{args.seed}.jsonl", args.processes)
    for kind in dict.fromkeys(row.kind for row in rows):
        chosen = [row for row in rows if row.kind == kind]
        wrong = ", ".join(f"{sum(bool(row.wrong((grade,))) for row in chosen)} {grade}" for grade in GRADES)
        refused = sum(bool(row.outcome.refused) for row in chosen)
        print(f"{kind:>13}: {len(chosen)} records, {refused} refused, with a wrong name: {wrong}")
    if rows:
        print(grade_table(rows), seconds_line(rows), sep="\n")


if __name__ == "__main__":
    main()
