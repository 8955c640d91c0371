"""How often each grade of a name is right, on simulated and on measured records, and how many intervals hold the value.

    python -m benchmarks.calibration [--seed 84000] [--singles 75] [--none 30] [--doubles 30] [--outside 30]
        [--measured FOLDER]

The tables of `benchmarks.diagnosis` (twice: without and with nuisances), `benchmarks.outside_class` and
`benchmarks.measured`, each apart. Rows of an earlier run with the same seed and ``--out`` are used again.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

from benchmarks import diagnosis, measured, outside_class
from benchmarks.judging import Row, grade_table, size_line
from benchmarks.rows import run_tasks
from benchmarks.simulated import Counts, simulated_tasks
from tests.support.hidden_effects import MACHINES, Ways


def calibration_text(title: str, rows: Sequence[Row]) -> str:
    """Return the Markdown of one kind of records: their number, the table of grades, sizes.

    Args:
        title: what records they are.
        rows: of the records.

    Returns:
        The text.
    """
    return "\n".join(("", f"{title}: {len(rows)} records", "", grade_table(rows), "", size_line(rows)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in (("singles", 75), ("none", 30), ("doubles", 30), ("outside", 30)):
        parser.add_argument(f"--{name}", type=int, default=default, metavar="N")
    parser.add_argument("--seed", type=int, default=84_000)
    parser.add_argument("--measured", type=Path, metavar="FOLDER")
    parser.add_argument("--machines", nargs="+", choices=tuple(MACHINES), default=list(MACHINES))
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("results/calibration"))
    args = parser.parse_args()
    plain, spoilt = Counts(args.none, args.singles, args.doubles), Ways(torque_noise=True, shifts=True, gain=True)
    tasks = simulated_tasks(plain, args.seed, Ways(), args.machines)
    tasks += simulated_tasks(plain, args.seed + 500, spoilt, args.machines)
    rows = run_tasks(tasks, diagnosis.diagnose_task, args.out / f"simulated-{args.seed}.jsonl", args.processes)
    outside = outside_class.outside_tasks(args.outside, args.seed)
    others = run_tasks(outside, outside_class.diagnose_task, args.out / f"outside-{args.seed}.jsonl", args.processes)
    texts = [calibration_text("simulated, within the class", rows), calibration_text("outside the class", others)]
    if args.measured:
        lines = args.out / f"measured-{args.measured.name}.jsonl"
        told = run_tasks(measured.measured_tasks(args.measured), measured.diagnose_task, lines, args.processes)
        texts += [calibration_text("measured", told), measured.recall_line(told)]
    print("\n".join(texts))


if __name__ == "__main__":
    main()
