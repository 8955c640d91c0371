"""One look at the rows: false alarms on clean logs, and how many logs with one fault are named or refused.

    python -m benchmarks.log_rows [--clean 200] [--faults 120]

Logs are of the independent simulator, with effects, excitations, rates, lengths and encoders drawn at random.
"""

import argparse
import re
from collections import Counter
from collections.abc import Callable

import numpy as np

from orchestrator.errors import RecordError
from orchestrator.records.record import record_from_columns
from tests.support.independent_plant import make_record

Columns = dict[str, np.ndarray]
EFFECTS: tuple[dict[str, float], ...] = (
    {}, {"alpha": 0.01}, {"alpha": 0.03, "Fc_m": 1.0}, {"Fc_l": 8.0, "Fs_l": 3.0}, {"ecc": 0.002, "alpha": 0.005},
    {"kspeed": 0.2}, {"grav": 20.0, "alpha": 0.01}, {"rip": 2.0, "alpha": 0.002}, {"T0": 10.0}, {"knock": 20.0},
    {"late_Fc": 3.0}, {"alpha": 0.01, "sat": 150.0}, {"jvar": 0.3, "alpha": 0.01}, {"stop": 0.5, "alpha": 0.01},
    {"alpha": 0.005, "alpha_end": 0.02},
)  # fmt: skip


def clean_log(rng: np.random.Generator) -> tuple[Columns, str]:
    """Return a log as a good logger writes it, and what is in it."""
    effects = EFFECTS[rng.integers(len(EFFECTS))]
    excitation = str(rng.choice(["multisine", "levels", "closed_loop"]))
    rate, duration = float(rng.choice([100.0, 200.0, 500.0])), float(rng.choice([8.0, 20.0]))
    counts = [None, (10_000, 20_000), (4096, 4096), (2000, 65_536)][rng.integers(4)]
    columns, _ = make_record(
        effects, int(rng.integers(1 << 30)), duration, rate, excitation=excitation, counts=counts, substeps=30
    )
    if rng.random() < 0.3:  # as a logger of single precision or of few digits has it
        columns = {name: np.round(values, 6) for name, values in columns.items()}
    return columns, f"{effects} {excitation} {rate:g} Hz {duration:g} s {counts}"


def _failed(rng: np.random.Generator, c: Columns, name: str, value: Callable[[np.ndarray], float]) -> Columns:
    values, size = c[name].copy(), c["time"].size
    for row in rng.choice(np.arange(20, size - 20, 30), int(rng.integers(1, 5)), replace=False):
        values[row : row + int(rng.integers(1, 4))] = value(values)
    return c | {name: values}


def _spike(rng: np.random.Generator, c: Columns) -> Columns:
    name = str(rng.choice(["theta_m", "theta_l"]))
    return _failed(rng, c, name, lambda v: float(v[rng.integers(v.size)] + rng.choice([-1, 1]) * np.ptp(v)))


def _placeholder(rng: np.random.Generator, c: Columns) -> Columns:
    name, far = str(rng.choice(["theta_m", "theta_l"])), float(rng.choice([-1.0, 0.0]))
    moved = c | {name: c[name] + 2.0 * np.ptp(c[name]) + 1.0}  # as an encoder that does not begin at zero
    return _failed(rng, moved, name, lambda v: far)


def _clock(rng: np.random.Generator, c: Columns) -> Columns:
    time, step = c["time"].copy(), c["time"][1]
    speed = np.abs(np.gradient(c["theta_m"]))
    row = int(rng.choice(np.flatnonzero(speed[20:-20] > np.median(speed)))) + 20
    time[row:] += float(rng.choice([-3600.0, -1.0, -24e-3, 24e-3, 0.5, 3600.0])) + rng.uniform(-0.3, 0.3) * step
    return c | {"time": time}


def _stale(c: Columns, names: tuple[str, ...], every: int) -> Columns:
    rows = np.arange(c["time"].size) // every * every
    return c | {name: c[name][rows] for name in names}


def _repeats(rng: np.random.Generator, c: Columns) -> Columns:
    return _stale(c, ("theta_m", "theta_l"), int(rng.integers(2, 6)))


def _load_repeats(rng: np.random.Generator, c: Columns) -> Columns:
    return _stale(c, ("theta_l",), int(rng.integers(2, 6)))


def _drift(rng: np.random.Generator, c: Columns) -> Columns:
    share = float(rng.choice([-1.0, 1.0]) * rng.uniform(80e-6, 400e-6))
    t = c["time"]
    return c | {"theta_l": np.interp(t * (1.0 + share), t, c["theta_l"])}


FAULTS = {
    "spikes": (_spike, "readings? that failed"),
    "0 or -1": (_placeholder, "readings? that failed"),
    "clock set": (_clock, "the clock was set"),
    "both repeat": (_repeats, "each reading of `theta_m` and `theta_l` stands"),
    "load repeats": (_load_repeats, "each reading of `theta_l` stands"),
    "drift": (_drift, "logged by a clock"),
}


def what_is_said(columns: Columns) -> str:
    """Return what the look at the rows says of a log, or the refusal; empty: nothing."""
    try:
        return " ".join(record_from_columns(columns, "log").doubts)
    except RecordError as error:
        return str(error)


def main() -> None:
    """Print both counts, and each log that is not as it should be."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--clean", type=int, default=200)
    parser.add_argument("--faults", type=int, default=120)
    args = parser.parse_args()
    rng, alarms = np.random.default_rng(20261128), 0
    for number in range(args.clean):
        columns, what = clean_log(rng)
        if said := what_is_said(columns):
            alarms += 1
            print(f"false alarm on {number}, {what}: {said}", flush=True)
    print(f"clean logs: {alarms} false alarms of {args.clean}", flush=True)
    caught: Counter[str] = Counter()
    for number in range(args.faults):
        name = [*FAULTS][number % len(FAULTS)]
        make, wanted = FAULTS[name]
        columns, what = clean_log(rng)
        said = what_is_said(make(rng, columns))
        caught[name] += bool(re.search(wanted, said))
        if not re.search(wanted, said):
            print(f"{name} not named on {number}, {what}: {said or 'nothing'}", flush=True)
    each = args.faults // len(FAULTS)
    for name in FAULTS:
        print(f"{name}: {caught[name]} of {each} named")


if __name__ == "__main__":
    main()
