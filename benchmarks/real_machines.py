"""League of measured machines: what a diagnosis says of each record of a folder, beside what is published.

    python -m benchmarks.real_machines FOLDER [--known KNOWN.toml] [--out DIR]

``FOLDER`` holds one folder a machine, each with ``model.toml`` and CSV records. ``KNOWN.toml`` says what is known: for
``[machine]`` the ``source``, ``licence``, ``finding`` (text) and ``right``, the labels that must be named, ``allowed``,
those that may be. Without it the table has no judgement. One line a record, the count of
harm, and ``real_machines.json``.
"""

import argparse
import json
import time
import tomllib
from pathlib import Path
from typing import Any

import msgspec

from benchmarks.harm import counted, harmed
from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.diagnosis.proof.other_record import torque_errors
from orchestrator.errors import OrchestratorError
from orchestrator.records.model_file import read_model
from orchestrator.records.record import read_record


def row_of(path: Path, known: dict[str, Any]) -> dict[str, Any]:
    """Return what a diagnosis says of one record."""
    model = read_model(path.parent / "model.toml")
    begun = time.process_time()
    row: dict[str, Any] = {"machine": path.parent.name, "record": path.name}
    row |= {key: known.get(key, "") for key in ("source", "licence", "finding")}
    try:
        record = read_record(path, model.columns)
        found = diagnose(record, model)
    except OrchestratorError as error:
        return row | {"verdict": "refused", "why": str(error), "judged": "refused"}
    labels = [f"{effect.name}@{effect.site}" for effect in found.effects]
    errors = torque_errors(record, found)
    row |= {
        "verdict": found.verdict, "trust": found.trust.level.word, "named": labels,
        "sizes": {label: {n: [e.value, *e.interval] for n, e in effect.parameters.items()}
                  for label, effect in zip(labels, found.effects, strict=True)},
        "misfit": {m.signal: list(m.stages) for m in found.misfit}, "horizons": msgspec.to_builtins(found.horizons),
        "harm": harmed(found), "torque_error": errors, "rate": found.analysis.rate,
        "seconds": time.process_time() - begun,
    }  # fmt: skip
    return row | {"judged": judged(labels, known)}


def judged(labels: list[str], known: dict[str, Any]) -> str:
    """Return "right", "partly" or "wrong" of the labels that were named; "" where nothing is known."""
    if "right" not in known:
        return ""
    right, allowed = set(known["right"]), set(known.get("allowed", ()))
    if set(labels) - right - allowed:
        return "wrong"
    return "right" if right <= set(labels) else "partly"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--known", type=Path)
    parser.add_argument("--out", type=Path, default=Path("results/real_machines"))
    parser.add_argument("--largest", type=int, default=1_000_000, help="bytes of a record at most")
    args = parser.parse_args()
    known = tomllib.loads(args.known.read_text()) if args.known else {}
    args.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for path in sorted(args.folder.glob("*/*.csv")):
        if path.stat().st_size > args.largest:
            continue
        row = row_of(path, known.get(path.parent.name, {}))
        rows.append(row)
        errors = row.get("torque_error", {})
        force = " ".join(f"{name} {100 * value:.1f} %" for name, value in errors.items())
        sizes = {label: {n: round(v[0], 5) for n, v in found.items()} for label, found in row.get("sizes", {}).items()}
        print(row["machine"], row["record"], row["verdict"], row.get("trust", ""), sizes, f"force error {force}",
              row["judged"], f"{row.get('seconds', 0.0):.0f} s", flush=True)  # fmt: skip
        (args.out / "real_machines.json").write_text(json.dumps(rows, indent=1) + "\n")
    print(counted(rows))


if __name__ == "__main__":
    main()
