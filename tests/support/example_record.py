"""Makes the record that the tutorial measures: ``python -m tests.support.example_record`` writes it anew."""

from pathlib import Path
from typing import Any

import numpy as np

from tests.support.independent_plant import make_record, write_csv

FILE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "machine.csv"
HALF_GAP = 0.0137
FRICTION = 0.8


def example_record() -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Return 20 s of a drivetrain with play and dry friction at the motor, all its parameters off by up to 5 %."""
    return make_record({"alpha": HALF_GAP, "Fc_m": FRICTION}, seed=2027, duration=20.0)


if __name__ == "__main__":
    write_csv(FILE, example_record()[0])
