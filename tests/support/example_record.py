"""Makes the records of the examples: ``python -m tests.support.example_record`` writes them anew."""

import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from tests.support.excitations import multisine
from tests.support.independent_plant import make_record, write_csv

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"
FILE = EXAMPLES / "machine.csv"
SERVO = EXAMPLES / "servo.csv"
SHORT = {FILE.name: 1600, "axis.csv": 500, SERVO.name: 2000}  # rows that still show the same effects, in less time
HALF_GAP = 0.0137
FRICTION = 0.8
SERVO_GAP = 0.0035
SERVO_FRICTION = 0.3
TORQUE_CONSTANT = 0.42  # N.m/A
COUNTS = (8192, 131_072)
ZEROS = (1234, -777)  # counts
SHEET = {"J_m": 0.004, "J_l": 1.9, "k": 9000.0, "c": 4.0, "b_m": 0.006, "b_l": 2.0, "i": 20.0, "tau": 0.004}


def example_record() -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Return 20 s of a drivetrain with play and dry friction at the motor, all its parameters off by up to 5 %."""
    return make_record({"alpha": HALF_GAP, "Fc_m": FRICTION}, seed=2027, duration=20.0)


def servo_log() -> str:
    """Return 10 s of a servo drive as it logs them: amperes, counts, zeros that differ; all values off by up to 5 %."""
    rate, rows = 500.0, 5000
    u = multisine(np.random.default_rng(11), rows, 1.0 / rate, 4.0, 12.0)
    effects = {"alpha": SERVO_GAP, "Fc_m": SERVO_FRICTION}
    columns, _ = make_record(effects, 31, rate=rate, noise=(3e-4, 2e-5), counts=COUNTS, u=u, nominal=SHEET)
    amperes = columns["u"] / TORQUE_CONSTANT
    motor, load = (
        np.round(columns[name] * counts / (2.0 * math.pi)) + zero
        for name, counts, zero in zip(("theta_m", "theta_l"), COUNTS, ZEROS, strict=True)
    )
    lines = ["Time [ms];Iq_ref [A];Motor encoder [inc];Load encoder [inc]"]
    table = zip(columns["time"], amperes, motor, load, strict=True)
    lines += [f"{1e3 * time:.0f};{current:.3f};{m:.0f};{l:.0f}" for time, current, m, l in table]
    return "\n".join(lines) + "\n"


def copy_examples(to: Path, whole: bool = False) -> None:
    """Copy the examples of the docs into the folder ``to``: records of full length, or as ``SHORT`` as tests need."""
    shutil.copytree(EXAMPLES, to, dirs_exist_ok=True)
    for name, rows in () if whole else SHORT.items():
        lines = (to / name).read_text(encoding="utf-8").splitlines(keepends=True)
        (to / name).write_text("".join(lines[: rows + 1]), encoding="utf-8")


if __name__ == "__main__":
    write_csv(FILE, example_record()[0])
    SERVO.write_text(servo_log(), encoding="utf-8")
