"""Makes the record that the tutorial measures: ``python -m tests.support.example_record`` writes it anew."""

import shutil
from pathlib import Path
from typing import Any

import numpy as np

from tests.support.independent_plant import make_record, write_csv

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"
FILE = EXAMPLES / "machine.csv"
SHORT = {FILE.name: 8.0, "axis.csv": 2.5}  # s of the records that still show the same effects, in a third of the time
HALF_GAP = 0.0137
FRICTION = 0.8


def example_record() -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Return 20 s of a drivetrain with play and dry friction at the motor, all its parameters off by up to 5 %."""
    return make_record({"alpha": HALF_GAP, "Fc_m": FRICTION}, seed=2027, duration=20.0)


def copy_examples(to: Path, whole: bool = False) -> None:
    """Copy the examples of the docs into the folder ``to``: records of full length, or as ``SHORT`` as tests need."""
    shutil.copytree(EXAMPLES, to, dirs_exist_ok=True)
    for name, seconds in () if whole else SHORT.items():
        head, *rows = (to / name).read_text(encoding="utf-8").splitlines(keepends=True)
        kept = [row for row in rows if float(row.split(",")[0]) < seconds]
        (to / name).write_text(head + "".join(kept), encoding="utf-8")


if __name__ == "__main__":
    write_csv(FILE, example_record()[0])
