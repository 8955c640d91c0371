"""One record at several rates: names must be the same, and sizes must lie in each other's intervals.

    python -m benchmarks.rates FOLDER/RECORD.csv ...

Each record (``model.toml`` beside it) is diagnosed at its own rate, at 500, 200 and 100 Hz where those are lower
(torque averaged over the new sample, angles taken at its start), and with rows interpolated to twice its own rate.
One line each, then whether they agree.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.verdicts import Outcome, diagnose_record
from orchestrator.records.model_file import read_model
from orchestrator.records.record import Record, read_record

RATES = (500.0, 200.0, 100.0)


def thinned(record: Record, factor: int) -> Record:
    """Return a record with one row for ``factor``."""
    size = record.size // factor
    rows = slice(0, size * factor, factor)
    load = None if record.theta_l is None else record.theta_l[rows]
    torque = record.u[: size * factor].reshape(size, factor).mean(axis=1)
    return replace(record, time=record.time[rows], u=torque, theta_m=record.theta_m[rows], theta_l=load, further={})


def doubled(record: Record) -> Record:
    """Return a record with a row interpolated between any two."""
    time_ = np.linspace(record.time[0], record.time[-1], 2 * record.size - 1)

    def between(values: Any) -> Any:
        return None if values is None else np.interp(time_, record.time, values)

    return replace(record, time=time_, u=between(record.u), theta_m=between(record.theta_m),
                   theta_l=between(record.theta_l), further={})  # fmt: skip


def versions(record: Record) -> Iterator[tuple[str, Record]]:
    """Yield name and record of each version."""
    own = 1.0 / record.step
    yield f"{own:.4g} Hz, its own", record
    for rate in RATES:
        factor = round(own / rate)
        if factor > 1 and abs(own / factor / rate - 1.0) < 0.02:
            yield f"{rate:g} Hz", thinned(record, factor)
    yield f"{2.0 * own:.4g} Hz, interpolated", doubled(record)


def disagreements(outcomes: Sequence[tuple[str, Outcome]]) -> list[str]:
    """Return in words where versions disagree with the first: names, or sizes outside both intervals.

    Args:
        outcomes: version and what was said of it, the record's own rate first.

    Returns:
        The differences.
    """
    first, found = outcomes[0][1], list[str]()
    for version, outcome in outcomes[1:]:
        if set(outcome.labels()) != set(first.labels()):
            found.append(f"{version}: {', '.join(outcome.labels()) or 'no name'}")
            continue
        for label in first.labels():
            for name, own in first.names[label].values.items():
                other = outcome.names[label].values[name]
                if not (own.low <= other.value <= own.high or other.low <= own.value <= other.high):
                    found.append(f"{version}: {label} {name} {other.value:.4g} against {own.value:.4g}")
    return found


def describe(outcome: Outcome) -> str:
    """Return in words what was said of a version.

    Args:
        outcome: of the version.

    Returns:
        The line.
    """
    names = []
    for label, effect in outcome.names.items():
        values = (f"{name} {v.value:.4g} ({v.low:.4g} to {v.high:.4g})" for name, v in effect.values.items())
        names.append(f"{label} ({effect.grade}): {', '.join(values)}")
    return outcome.refused or "; ".join(names) or "no name"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("records", type=Path, nargs="+")
    args = parser.parse_args()
    for path in args.records:
        model, outcomes = read_model(path.parent / "model.toml"), list[tuple[str, Outcome]]()
        for name, record in versions(read_record(path, model.columns)):
            outcomes.append((name, diagnose_record(record, model)))
            said = outcomes[-1][1]
            print(f"{path.parent.name}/{path.name} at {name}: {describe(said)}, {said.seconds:.0f} s", flush=True)
        found = disagreements(outcomes)
        print("   one answer" if not found else f"   differ: {'; '.join(found)}", flush=True)


if __name__ == "__main__":
    main()
