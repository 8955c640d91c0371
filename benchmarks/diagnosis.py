"""Diagnosis of records of the independent simulator: what is right by group and grade, what was taken for what.

    python -m benchmarks.diagnosis --singles 200 --none 100 --doubles 40 --unknown 50 --seed 80000
    python -m benchmarks.diagnosis --singles 200 --none 100 --doubles 40 --torque-noise --shifts --gain --seed 81000
    python -m benchmarks.diagnosis --one-encoder 60 --seed 82000    # a gap behind the motor's encoder alone
    python -m benchmarks.diagnosis --off-centre 8 --seed 84000    # an encoder that is mounted off its centre
    python -m benchmarks.diagnosis --singles 40 --logger zeros --out OTHER    # then benchmarks.ablation --before

One line a record as it goes, in two processes; the figures at the end, and ``figures.json``. Three machines take turns.
An interrupted run goes on where it stopped (``--out`` keeps its lines). Seeds below 70000 were used in development.
"""

import argparse
import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.judging import Row, grade_table, judge, seconds_line, size_line
from benchmarks.rows import run_tasks
from benchmarks.simulated import RELATIVES, Counts, SimulatedTask, model_of, simulated_tasks, truth_of
from benchmarks.verdicts import GRADES, NAMED, diagnose_record
from tests.support.hidden_effects import MACHINES, Ways


def diagnose_task(task: SimulatedTask, settings: Any = None) -> Row:
    """Return what a diagnosis says of one record, and what of that is right.

    Args:
        task: the record.
        settings: of the diagnosis; None: the default.

    Returns:
        The row.
    """
    case = task.make()
    outcome = diagnose_record(case.record, model_of(case), settings)
    hidden = ", ".join(f"{name} {value:.3g}" for name, value in case.truth["effects"].items())
    kind = "+".join(task.kinds) or "none"
    return Row(task.key, task.group, kind, outcome, judge(outcome, truth_of(case)), hidden)


def group_figures(group: str, rows: Sequence[Row]) -> dict[str, Any]:
    """Return the counts of one group of records.

    Args:
        group: its name.
        rows: of its records.

    Returns:
        Counts by name.
    """
    figures: dict[str, Any] = {"records": len(rows), "refused": sum(bool(row.outcome.refused) for row in rows)}
    if group == "none":
        figures["false_alarms"] = sum(row.is_false_alarm() for row in rows)
    if group not in ("none", "unknown"):
        figures["right"] = sum(row.is_right() for row in rows)
        figures["all_found"] = sum(all(grade in NAMED for grade in row.judgement.found) for row in rows)
        figures["all_found_or_possible"] = sum(all(row.judgement.found) for row in rows)
    figures |= {f"wrong_{grade}": sum(bool(row.wrong((grade,))) for row in rows) for grade in GRADES}
    return figures


def print_figures(rows: Sequence[Row]) -> dict[str, Any]:
    """Print the matrix of families, the counts by group, the table of grades, sizes and time; return the counts.

    Args:
        rows: of all records.

    Returns:
        Group -> counts.
    """
    print("\nhidden -> named (relatives together)")
    matrix = Counter((row.kind, _relatives(row)) for row in rows if row.group != "double")
    for kind in dict.fromkeys(kind for kind, _ in matrix):
        said = ", ".join(f"{count} {names}" for (hidden, names), count in sorted(matrix.items()) if hidden == kind)
        print(f"{kind:>22}: {said}")
    figures = {}
    for group in dict.fromkeys(row.group for row in rows):
        figures[group] = group_figures(group, [row for row in rows if row.group == group])
        print(group, figures[group])
    print(grade_table(rows), size_line(rows), seconds_line(rows), sep="\n")
    return figures


def _relatives(row: Row) -> str:
    return " + ".join(sorted({RELATIVES.get(label, label) for label in row.outcome.labels()})) or "no name"


def add_ways(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of nuisances, machines, seed and processes.

    Args:
        parser: of a benchmark.
    """
    parser.add_argument("--seed", type=int, default=80_000)
    parser.add_argument("--torque-noise", action="store_true", help="coloured torque noise on half of the records")
    parser.add_argument("--shifts", action="store_true", help="signals late by up to two samples on half of them")
    parser.add_argument("--gain", action="store_true", help="a torque that is up to 10 %% off on half of them")
    parser.add_argument("--machines", nargs="+", choices=tuple(MACHINES), default=list(MACHINES))
    parser.add_argument("--processes", type=int, default=2)


def ways_of(args: argparse.Namespace) -> Ways:
    """Return the nuisances that were asked for.

    Args:
        args: of ``add_ways``.

    Returns:
        The ways.
    """
    return Ways(torque_noise=args.torque_noise, shifts=args.shifts, gain=args.gain)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("singles", "none", "doubles", "unknown", "one-encoder", "off-centre"):
        parser.add_argument(f"--{name}", type=int, default=0, metavar="N")
    add_ways(parser)
    parser.add_argument("--logger", choices=("zeros", "stamps"), default="", help="another zero, or stamps of a PC")
    parser.add_argument("--out", type=Path, default=Path("results/bench_diagnosis"))
    args = parser.parse_args()
    counts = Counts(args.none, args.singles, args.doubles, args.unknown, args.one_encoder, args.off_centre)
    tasks = simulated_tasks(counts, args.seed, ways_of(args), args.machines, args.logger)
    rows = run_tasks(tasks, diagnose_task, args.out / f"rows-{args.seed}.jsonl", args.processes)
    if rows:
        (args.out / "figures.json").write_text(json.dumps(print_figures(rows), indent=1) + "\n")


if __name__ == "__main__":
    main()
