"""Records of measured machines with references by independent least squares: what is named of what is there.

    python -m benchmarks.measured FOLDER [--only MACHINE ...] [--out DIR]

``FOLDER`` holds one folder a machine, each with CSV records, ``model.toml`` and ``reference.json``: under ``records``,
for each file, ``told`` (name -> ``value``, ``error``, ``gain`` in R2, ``family``), the names ``allowed`` and
``excluded``, and ``r2_parameters`` and ``r2`` (without laws, with them). One line a record with its reference beside
it, then recall, names by grade and sizes.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.judging import Row, Truth, grade_table, judge, seconds_line, size_line
from benchmarks.rows import run_tasks, show_row
from benchmarks.verdicts import NAMED, diagnose_record
from orchestrator.records.model_file import read_model
from orchestrator.records.record import read_record

# Name -> the parameter that a reference's value is of.
SIZE = {
    "coulomb_friction": "torque", "stribeck_friction": "coulomb", "load_torque": "torque", "gravity_load": "amplitude",
    "torque_ripple": "amplitude", "quadratic_drag": "coefficient", "spring_load": "stiffness",
    "directional_friction": "difference", "load_dependent_friction": "coefficient",
    "torque_saturation": "limit", "motor_encoder_eccentricity": "amplitude",
}  # fmt: skip


@dataclass(frozen=True)
class MeasuredTask:
    """One record of a measured machine."""

    folder: str
    name: str

    @property
    def key(self) -> str:
        """Return what tells it from every other record."""
        return f"{Path(self.folder).name}/{self.name}"

    @property
    def reference(self) -> dict[str, Any]:
        """Return what least squares tells of it."""
        records: dict[str, dict[str, Any]] = json.loads((Path(self.folder) / "reference.json").read_text())["records"]
        return records[self.name]


def measured_tasks(folder: Path, only: Sequence[str] = ()) -> list[MeasuredTask]:
    """Return the records of a folder that have a reference.

    Args:
        folder: of machines.
        only: names of machines; empty: all.

    Returns:
        The tasks.
    """
    return [
        MeasuredTask(str(path.parent), name)
        for path in sorted(folder.glob("*/reference.json"))
        if not only or path.parent.name in only
        for name in json.loads(path.read_text())["records"]
    ]


def truth_of(reference: dict[str, Any]) -> Truth:
    """Return what is true of a record as far as its reference tells.

    Args:
        reference: of the record.

    Returns:
        The truth.
    """
    told = reference["told"]
    expected = tuple((name, *entry["family"]) for name, entry in told.items())
    sizes = {name: {SIZE[name]: (entry["value"], entry["error"])} for name, entry in told.items() if name in SIZE}
    tested = (*told, *reference["allowed"], *reference["excluded"])
    return Truth(expected, tuple(reference["allowed"]), sizes, tested)


def diagnose_task(task: MeasuredTask, settings: Any = None) -> Row:
    """Return what a diagnosis says of one record, and what of that is right.

    Args:
        task: the record.
        settings: of the diagnosis; None: the default.

    Returns:
        The row.
    """
    reference, model = task.reference, read_model(Path(task.folder) / "model.toml")
    outcome = diagnose_record(read_record(Path(task.folder) / task.name, model.columns), model, settings)
    return Row(
        task.key, "measured", Path(task.folder).name, outcome, judge(outcome, truth_of(reference)), describe(reference)
    )


def describe(reference: dict[str, Any]) -> str:
    """Return a reference in words.

    Args:
        reference: of a record.

    Returns:
        The line.
    """
    laws = [
        f"{name} {e['value']:.4g} +- {2.0 * e['error']:.2g} ({e['gain']:.2f})" for name, e in reference["told"].items()
    ]
    return f"[{', '.join(laws) or 'nothing'}; R2 {reference['r2_parameters']:.3f} to {reference['r2']:.3f}]"


def show_measured(row: Row) -> str:
    """Return one line of a record: what is named, with sizes, and the reference.

    Args:
        row: of the record.

    Returns:
        The line.
    """
    sizes = [
        f"{label} {name} {one.value:.4g} ({one.low:.4g} to {one.high:.4g})"
        for label, effect in row.outcome.names.items()
        for name, one in effect.values.items()
        if name == SIZE.get(label.partition("@")[0])
    ]
    return f"{show_row(row)}; {', '.join(sizes)}"


def recall_line(rows: Sequence[Row]) -> str:
    """Return in words how many of the laws that least squares tells are named.

    Args:
        rows: of measured records.

    Returns:
        The line.
    """
    grades = [grade for row in rows for grade in row.judgement.found]
    named, possible = sum(grade in NAMED for grade in grades), sum(bool(grade) for grade in grades)
    share = f" ({100.0 * named / len(grades):.0f} %)" if grades else ""
    empty = [row for row in rows if not row.judgement.found]
    return (
        f"recall: {named} of {len(grades)}{share} named likely or certain, {possible} with possible; "
        f"without a name {sum(not row.outcome.labels() for row in empty)} of {len(empty)} that have nothing to name; "
        f"refused {sum(bool(row.outcome.refused) for row in rows)} of {len(rows)}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", default=(), metavar="MACHINE")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("results/measured"))
    args = parser.parse_args()
    tasks = measured_tasks(args.folder, args.only)
    rows = run_tasks(tasks, diagnose_task, args.out / f"rows-{args.folder.name}.jsonl", args.processes, show_measured)
    if rows:
        print(recall_line(rows), grade_table(rows), size_line(rows), seconds_line(rows), sep="\n")


if __name__ == "__main__":
    main()
