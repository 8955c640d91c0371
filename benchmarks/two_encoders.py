"""Half-gaps from two encoders without a torque: error and coverage over many simulated servo benches.

::

    python -m benchmarks.two_encoders 40             # gaps of 1 to 20 counts, channels late by -5 to 5 ms
    python -m benchmarks.two_encoders 20 --kind held # one flank loaded throughout: no gap may be seen

The simulator shares no code with the estimator: a motor follows given moves and pushes a load through play. The load
has inertia, Coulomb and viscous friction, a torque from outside that may change, and stiff, lossy teeth, so that it
wanders between the flanks after each impact. Both encoders are noisy and rounded; the load's channel is late.
Seeds from 0 on were looked at while the method was made; ``--first 100000`` starts at seeds that were not.
"""

import argparse
import json
import math
import time
from dataclasses import asdict, dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from orchestrator.errors import OrchestratorError
from orchestrator.estimation.methods import two_encoders
from orchestrator.records.model_file import default_model
from orchestrator.records.record import record_from_columns

Array = NDArray[np.float64]
FINE = 1e-5  # s, step of the simulation


@dataclass(frozen=True)
class Bench:
    """A servo bench and its log.

    Attributes:
        alpha: half-gap [rad], load side.
        count: of the coarser encoder, seen from the load [rad].
        late: of the load's channel [s].
        ratio: motor over load angle.
        rate: rows per second.
        duration: [s].
    """

    alpha: float
    count: float
    late: float
    ratio: float
    rate: float
    duration: float


@njit
def _run(motor, inertia, friction, drag, outside, stiffness, damping, alpha, step, first):
    """Return the load's angle under the motor's (n,), both at the load: semi-implicit Euler, friction that can hold."""
    load = np.empty(motor.size)
    angle, speed = first, 0.0
    for k in range(motor.size):
        load[k] = angle
        drive = (motor[k] - motor[k - 1]) / step if k > 0 else 0.0
        twist = motor[k] - angle
        torque = outside[k]
        over = abs(twist) - alpha
        if over > 0.0:
            side = 1.0 if twist > 0.0 else -1.0
            pushed = stiffness * over + damping * (drive - speed) * side
            torque += side * max(pushed, 0.0)
        speed += step * (torque - drag * speed) / inertia
        hold = step * friction / inertia
        speed = 0.0 if abs(speed) <= hold else speed - hold * (1.0 if speed > 0.0 else -1.0)
        angle += step * speed
    return load


def _moves(rng: np.random.Generator, time_: Array) -> Array:
    """Return the motor's angle at the load [rad]: strokes of random reach and speed with rests, slightly rounded."""
    kind = rng.integers(3)
    if kind == 0:
        lines = rng.uniform(0.1, 1.5, 4)
        wave = sum(np.sin(2.0 * np.pi * f * time_ + rng.uniform(0.0, 6.28)) / f for f in lines)
        return np.asarray(rng.uniform(0.2, 3.0) * wave / np.abs(wave).max())
    here, at, times, angles = 0.0, 0.0, [0.0], [0.0]
    reach, top = rng.uniform(0.2, 6.0), rng.uniform(0.3, 6.0)
    while at < time_[-1] + 1.0:
        there = rng.uniform(-reach, reach)
        speed = top * (rng.uniform(0.2, 1.0) if kind == 1 else rng.choice([0.25, 1.0]))
        at += max(abs(there - here) / speed, 0.02)
        times.append(at)
        angles.append(there)
        at += rng.choice([0.0, 0.2])
        times.append(at)
        angles.append(there)
        here = there
    path = np.interp(time_, times, angles)
    width = round(rng.uniform(0.02, 0.1) / FINE)
    for _ in range(2):
        total = np.cumsum(np.concatenate([np.full(width, path[0]), path]))
        path = (total[width:] - total[:-width]) / width
    return path


def make_bench(seed: int, kind: str = "free") -> tuple[Bench, dict[str, Array]]:
    """Return a bench and the columns of its log, without a torque.

    Args:
        seed: of everything that is random.
        kind: "free", or "held": a torque from outside that is larger than friction and inertia keeps one flank loaded.

    Returns:
        What the bench is, and time [s] and angles [rad], (n,) each.
    """
    rng = np.random.default_rng(seed)
    count = 2.0 * np.pi / float(rng.choice([4096, 10_000, 65_536]))
    motor_count = 2.0 * np.pi / float(rng.choice([4096, 16_384]))
    ratio = float(rng.choice([1.0, 7.3, 30.0, 100.0]))
    alpha = max(count, motor_count / ratio) * float(np.exp(rng.uniform(0.0, math.log(20.0))))
    bench = Bench(
        alpha,
        max(count, motor_count / ratio),
        rng.uniform(-5e-3, 5e-3),
        ratio,
        float(rng.choice([250.0, 500.0, 1000.0])),
        rng.uniform(10.0, 40.0),
    )
    fine = np.asarray(np.arange(round((bench.duration + 0.1) / FINE)) * FINE, dtype=np.float64)
    motor = _moves(rng, fine)
    inertia, friction = rng.uniform(0.002, 0.02), rng.uniform(0.05, 0.5)
    drag = rng.uniform(0.0, 0.05)
    lossy = rng.uniform(0.1, 0.5)  # of critical damping: a bounce keeps 16 to 73 % of its speed
    outside = np.zeros(fine.size)
    if kind == "held":
        acceleration = np.abs(np.diff(motor, 2)).max() / FINE**2
        outside += (1.5 * friction + 1.2 * inertia * acceleration + drag * np.abs(np.diff(motor)).max() / FINE) * 1.5
    elif rng.random() < 0.3:  # a torque from outside that changes its direction
        outside += rng.uniform(1.2, 2.5) * friction * np.sign(np.sin(2.0 * np.pi * fine / rng.uniform(2.0, 5.0)))
    # What winds up cannot be told from a gap without a torque: here it is a thousandth of the gap and less.
    stiffness = (friction + np.abs(outside).max()) / (alpha * rng.uniform(1e-4, 1e-3))
    stiffness = min(stiffness, 0.5 * inertia / FINE**2)  # stable
    damping = 2.0 * lossy * math.sqrt(stiffness * inertia)
    load = _run(motor, inertia, friction, drag, outside, stiffness, damping, alpha, FINE, 0.0)
    rows = np.arange(round(bench.duration * bench.rate)) / bench.rate
    noise = rng.uniform(0.0, 0.5)
    seen_m = ratio * np.interp(rows + 0.02, fine, motor) + rng.uniform(0.0, 1.0)
    seen_l = np.interp(rows + 0.02 - bench.late, fine, load) + rng.uniform(0.0, 1.0)
    columns = {
        "time": rows,
        "theta_m": motor_count * np.round(seen_m / motor_count + 0.3 * rng.standard_normal(rows.size)),
        "theta_l": count * np.round(seen_l / count + noise * rng.standard_normal(rows.size)),
    }
    return bench, columns


def row(seed: int, kind: str) -> dict[str, object]:
    """Return what the estimate of one bench is like beside the truth.

    Args:
        seed: of the bench.
        kind: see ``make_bench``.

    Returns:
        Facts of bench and estimate.
    """
    bench, columns = make_bench(seed, kind)
    begun = time.perf_counter()
    facts: dict[str, object] = {"seed": seed, **asdict(bench), "counts": bench.alpha / bench.count}
    try:
        found = two_encoders.estimate(record_from_columns(columns, f"bench {seed}"), default_model())
    except OrchestratorError as error:
        return facts | {"failed": str(error)}
    low, high = found.interval
    return facts | {
        "seen": bool(found.visible),
        "estimate": found.alpha,
        "error": found.alpha / bench.alpha - 1.0,
        "standard_error": found.standard_error,
        "covered": bool(low <= bench.alpha <= high),
        "late_found": found.diagnostics.get("load_late", {}).get("value"),
        "traversals": found.diagnostics.get("traversals"),
        "message": found.message,
        "seconds": time.perf_counter() - begun,
    }


def main() -> None:
    """Print a line for each bench and the count of all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("count", type=int)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--kind", choices=["free", "held"], default="free")
    parser.add_argument("--json", action="store_true", help="a line of JSON for each bench")
    args = parser.parse_args()
    rows = []
    for seed in range(args.first, args.first + args.count):
        found = row(seed, args.kind)
        rows.append(found)
        if args.json:
            print(json.dumps(found), flush=True)
    seen = [r for r in rows if r.get("seen")]
    print(f"{len(rows)} benches, {len(seen)} with a gap seen, {sum('failed' in r for r in rows)} failed")
    if seen:
        errors = np.abs([float(r["error"]) for r in seen])  # type: ignore[arg-type]
        held = sum(bool(r["covered"]) for r in seen)
        seconds = float(np.median([float(r["seconds"]) for r in seen]))  # type: ignore[arg-type]
        print(f"error: median {np.median(errors):.2%}, nine tenths below {np.quantile(errors, 0.9):.2%}")
        print(f"intervals that hold the truth: {held} of {len(seen)} ({held / len(seen):.1%}); {seconds:.2f} s each")


if __name__ == "__main__":
    main()
