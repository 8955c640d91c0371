"""Half-gaps of drives with dry friction that nobody told of: error, coverage and trust of ``estimate``.

::

    python -m benchmarks.frictional_drives 20                    # drives 0 to 19, without the diagnosis
    python -m benchmarks.frictional_drives 20 --first 1000 --diagnose --append rows.jsonl

Loads of 1e-5 to 10 kg.m2, ratios of 1 to 160; parameters 5 % and torque constant 3 % off, dry friction of 0.6 to 5 % of
the torque at neither, motor, load or both, each as often, in common drives and in those whose shaft twists much against
the gap; Stribeck or LuGre, torque held or sampled, 1 to 3 ms late. ``--append FILE`` keeps a JSON line per drive, and a
run goes on after those that are there. Drives below 1000 were looked at.
"""

import argparse
import json
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import orchestrator as oc
from orchestrator.errors import OrchestratorError
from orchestrator.records.record import record_from_columns
from tests.support.frictional_drive import FrictionalDrive, draw_frictional_drive


def measure(drive: FrictionalDrive, diagnose: bool) -> dict:
    """Return what ``estimate`` makes of a drive's record."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "model.toml"
        path.write_text(drive.model_text(), encoding="utf-8")
        model = oc.read_model(path)
    begun = time.process_time()
    row = {
        "gap": drive.gap, "shares": drive.shares, "friction": drive.friction, "held": drive.held, "late": drive.late,
        "rows": len(drive.columns["u"]),
    }  # fmt: skip
    try:
        result = oc.estimate(record_from_columns(drive.columns, "drive"), model, diagnose=diagnose)
    except OrchestratorError as error:
        return row | {"failed": str(error)}
    low, high = result.interval
    return row | {
        "alpha": result.alpha, "se": result.standard_error, "low": low, "high": high, "trust": result.trust.level.word,
        "reasons": list(result.trust.reasons), "method": result.best.method, "seconds": time.process_time() - begun,
    }  # fmt: skip


def site_of(row: dict) -> str:
    """Return where a row's drive has dry friction."""
    motor, load = row["shares"]
    return ("both" if load else "motor") if motor else ("load" if load else "none")


def summarise(rows: list[dict]) -> str:
    """Return errors, coverage and trust of all rows."""
    done = [row for row in rows if "failed" not in row and np.isfinite(row["alpha"])]
    error = np.array([row["alpha"] / row["gap"] - 1.0 for row in done])
    held = np.array([row["low"] <= row["gap"] <= row["high"] for row in done])
    width = np.array([(row["high"] - row["low"]) / row["gap"] for row in done])
    trust = [row["trust"] for row in done]
    text = f"{len(done)} of {len(rows)} drives: median error {100 * np.median(abs(error)):.4f} %, worst "
    text += f"{100 * max(abs(error)):.3f} %; {held.sum()} of {held.size} intervals hold ({100 * held.mean():.1f} %)"
    text += f", {np.sum(~held & (error < 0))} misses too small; median width {100 * np.median(width):.4f} %"
    for level in ("green", "amber", "red"):
        here = np.array([word == level for word in trust])
        text += f"; {level} {here.sum()}, of which hold {np.sum(held & here)}"
    return text + f"; {np.mean([row['seconds'] for row in done]):.1f} s a drive"


def describe_row(number: int, row: dict) -> str:
    """Return one line on a drive."""
    if "failed" in row:
        return f"{number}: {row['failed']}"
    error, se = row["alpha"] / row["gap"] - 1.0, row["se"] / row["gap"]
    held = "holds" if row["low"] <= row["gap"] <= row["high"] else "MISSES"
    shares = " ".join(f"{100 * share:.2f}" for share in row["shares"])
    kind = f"{row['friction']} {'held' if row['held'] else 'sampled'} {1e3 * row['late']:.1f} ms"
    text = f"{number}: gap {row['gap']:.5f}, friction {shares} % {kind}: error {100 * error:+.4f} %, standard error "
    return text + f"{100 * se:.4f} %, {held}, {row['trust']}, {row['seconds']:.1f} s {row['reasons']}"


def main() -> None:
    """Measure drives, print a line for each and the summary."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("count", type=int, nargs="?", default=20)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--diagnose", action="store_true")
    parser.add_argument("--append", type=Path)
    arguments = parser.parse_args()
    rows: list[dict] = []
    if arguments.append and arguments.append.exists():
        rows = [json.loads(line) for line in arguments.append.read_text(encoding="utf-8").splitlines()]
    for number in range(len(rows), arguments.count):
        seed = arguments.first + number
        rows.append(measure(draw_frictional_drive(seed), arguments.diagnose))
        print(describe_row(seed, rows[-1]), flush=True)
        if arguments.append:
            with arguments.append.open("a", encoding="utf-8") as file:
                file.write(json.dumps(rows[-1]) + "\n")
    for site in ("none", "motor", "load", "both"):
        here = [row for row in rows if site_of(row) == site]
        if here:
            print(f"friction at {site}: {summarise(here)}")
    print(summarise(rows))


if __name__ == "__main__":
    main()
