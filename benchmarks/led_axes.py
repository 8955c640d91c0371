"""Single axes that a controller leads: right, missed and wrong names by what is hidden.

    python -m benchmarks.led_axes --records 80 --seed 0 [--only "by hand"] [--wrong-inertia]

A controller hides from predictions what acts on an axis, and its torque is measured with noise. Records are of the
independent simulation in ``tests/support/led_axis.py``. One line a record, in two processes, the counts at the end.
"""

import argparse
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.judging import Row, Truth, grade_table, judge, seconds_line, size_line
from benchmarks.measured import SIZE
from benchmarks.rows import run_tasks
from benchmarks.verdicts import diagnose_record
from orchestrator.records.model_file import Model, read_model
from tests.support.led_axis import FURTHER, HIDDEN, LedAxis, led_axis

MODEL = """fmu = "ServoAxis"
[parameters.J]
value = {0!r}
relative_uncertainty = 0.6
[parameters.b]
value = {1!r}
relative_uncertainty = 0.9
"""
RELATIVES = {"coulomb_friction": ("stribeck_friction",)}  # the one contains the other

FACTORS = (1.0 / 12.0, 1.0 / 6.0, 6.0, 12.0)
ALLOWED = ("outside_torque",)  # beside a limit that it reached once


@dataclass(frozen=True)
class LedTask:
    """One axis that is led."""

    seed: int
    hidden: str = ""  # goes round with the seed
    wrong_inertia: bool = False

    @property
    def key(self) -> str:
        """Return what tells it from every other record."""
        return f"led:{self.seed}" + (f":{self.hidden}" if self.hidden else "") + self.wrong_inertia * ":J"


def diagnose_task(task: LedTask, settings: Any = None) -> Row:
    """Return what a diagnosis says of one record, and what of that is right.

    Args:
        task: the record.
        settings: of the diagnosis; None: the default.

    Returns:
        The row.
    """
    case = led_axis(task.seed, task.hidden)
    if task.wrong_inertia:
        factor = float(np.random.default_rng([task.seed, 5]).choice(FACTORS))
        case = replace(case, stated=(factor * case.truth["J"], case.stated[1]))
    outcome = diagnose_record(case.record, model_of(case), settings)
    expected = tuple((name, *RELATIVES.get(name, ())) for name in sorted(case.right))
    sizes = {name: {SIZE[name]: (case.truth[name], 0.0)} for name in case.right if case.truth.get(name)}
    return Row(task.key, "led", case.hidden, outcome, judge(outcome, Truth(expected, ALLOWED, sizes)), case.hidden)


def model_of(case: LedAxis) -> Model:
    """Return the model that a data sheet states.

    Args:
        case: the axis.

    Returns:
        The model.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "axis.toml"
        path.write_text(MODEL.format(*case.stated), encoding="utf-8")
        return read_model(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--records", type=int, default=80)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("results/led_axes"))
    parser.add_argument("--only", choices=(*HIDDEN, *FURTHER), default="")
    parser.add_argument("--wrong-inertia", action="store_true", help="that a model file states, 6 or 12 times off")
    args = parser.parse_args()
    tasks = [LedTask(seed, args.only, args.wrong_inertia) for seed in range(args.seed, args.seed + args.records)]
    rows = run_tasks(tasks, diagnose_task, args.out / f"rows-{args.seed}.jsonl", args.processes)
    for kind in dict.fromkeys(row.kind for row in rows):
        chosen = [row for row in rows if row.kind == kind]
        right, wrong = sum(row.is_right() for row in chosen), sum(bool(row.wrong()) for row in chosen)
        print(f"{kind:>22}: {len(chosen)} records, {right} right, {wrong} with a wrong name")
    if rows:
        print(grade_table(rows), size_line(rows), seconds_line(rows), sep="\n")


if __name__ == "__main__":
    main()
