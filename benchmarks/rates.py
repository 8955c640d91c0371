"""One record at several rates: the verdict must be one, and sizes must lie in each other's intervals.

    python -m benchmarks.rates FOLDER/RECORD.csv ... [--out DIR]

Each record (``model.toml`` beside it) is diagnosed at its own rate, at 500, 200 and 100 Hz where those are lower
(torque averaged over the new sample, angles taken at its start), and with rows interpolated to twice its own rate.
One line each, then whether they agree.
"""

import argparse
import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.harm import counted, harmed
from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.records.model_file import Model, read_model
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


def row_of(name: str, record: Record, model: Model) -> dict[str, Any]:
    """Return what a diagnosis says of one version."""
    begun = time.process_time()
    found = diagnose(record, model)
    sizes = {
        f"{effect.name}@{effect.site}": {short: [e.value, *e.interval] for short, e in effect.parameters.items()}
        for effect in found.effects
    }
    return {
        "version": name, "verdict": found.verdict, "trust": found.trust.level.word, "named": list(sizes),
        "sizes": sizes, "nuisances": {n.name: e.value for n in found.nuisances for e in n.parameters.values()},
        "analysed": found.analysis.rate, "harm": harmed(found), "warnings": list(found.warnings),
        "parameters": {n: [v.value, *(v.interval or ())] for n, v in found.parameters.items()},
        "seconds": time.process_time() - begun,
    }  # fmt: skip


def disagreements(rows: list[dict[str, Any]]) -> list[str]:
    """Return in words where versions disagree with the first: verdict, names, or sizes outside both intervals."""
    first, found = rows[0], list[str]()
    for row in rows[1:]:
        if (row["verdict"], row["named"]) != (first["verdict"], first["named"]):
            found.append(f"{row['version']}: {row['verdict']} {row['named']}")
            continue
        for label, sizes in row["sizes"].items():
            for short, (value, low, high) in sizes.items():
                own, least, most = first["sizes"][label][short]
                if not (least <= value <= most or low <= own <= high):
                    found.append(f"{row['version']}: {label} {short} {value:.4g} against {own:.4g}")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("records", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, default=Path("results/rates"))
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    everything: list[dict[str, Any]] = []
    for path in args.records:
        model, rows = read_model(path.parent / "model.toml"), list[dict[str, Any]]()
        for name, record in versions(read_record(path, model.columns)):
            row = {"record": f"{path.parent.name}/{path.name}"} | row_of(name, record, model)
            rows.append(row)
            shown = {label: {n: "{:.4g} [{:.4g}, {:.4g}]".format(*v) for n, v in sizes.items()}
                     for label, sizes in row["sizes"].items()}  # fmt: skip
            print(row["record"], name, f"(analysed at {row['analysed']:.4g} Hz)", row["verdict"], row["trust"], shown,
                  row["nuisances"] or "", f"{row['seconds']:.0f} s", flush=True)  # fmt: skip
        everything += rows
        (args.out / "rates.json").write_text(json.dumps(everything, indent=1) + "\n")
        print(
            "   one answer" if not disagreements(rows) else f"   differ: {'; '.join(disagreements(rows))}", flush=True
        )
    print(counted(everything))


if __name__ == "__main__":
    main()
