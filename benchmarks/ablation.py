"""What each rule of the diagnosis is worth: fresh records with every rule, and with each one off.

    python -m benchmarks.ablation [--singles 50] [--none 20] [--doubles 20] [--unknown 15] [--outside 12] [--seed 85000]
        [--rules NAME ...] [--measured FOLDER] [--docs docs/ablation.md]

Paired: for each rule, how many records change their outcome without it (names at their grades), how many of these are
better with the rule and how many worse, by the sum over names of what a right or a wrong one of its grade counts. A
Markdown table, written to ``--docs`` where that is given. Rows of an earlier run with the same seed and ``--out`` are
used again.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks import diagnosis, measured, outside_class
from benchmarks.diagnosis import add_ways, ways_of
from benchmarks.judging import Row
from benchmarks.rows import Task, run_tasks
from benchmarks.simulated import Counts, simulated_tasks
from orchestrator.diagnosis.selection.grading import GRADE_RULES, GradeRule
from orchestrator.diagnosis.settings import DiagnosisSettings

# What a name counts: a right one of more the surer it is, a wrong one against the diagnosis.
WORTH = {"certain": 3.0, "likely": 2.0, "possible": 1.0}
COST = 3.0  # of a wrong name against a right one of the same grade
LEAST = 2  # outcomes that a rule must change in RECORDS
RECORDS = 730


@dataclass(frozen=True)
class AblatedTask:
    """A record of another benchmark, diagnosed without one rule ("": with all)."""

    task: Any
    module: str
    rule: str

    @property
    def key(self) -> str:
        """Return what tells it from every other record and rule."""
        return f"{self.rule}|{self.task.key}"


@dataclass(frozen=True)
class RuleCount:
    """What changes without a rule: outcomes, those that were better with it, those that were worse."""

    name: str
    changed: int
    better: int
    worse: int


def diagnose_task(ablated: AblatedTask) -> Row:
    """Return the row of a record that is diagnosed without one rule.

    Args:
        ablated: record and rule.

    Returns:
        The row, under the ablated key.
    """
    module = {"diagnosis": diagnosis, "outside_class": outside_class, "measured": measured}[ablated.module]
    settings = DiagnosisSettings(disabled=(ablated.rule,)) if ablated.rule else None
    row: Row = module.diagnose_task(ablated.task, settings)
    return Row(ablated.key, row.group, row.kind, row.outcome, row.judgement, row.hidden)


def worth(row: Row) -> float:
    """Return what an outcome is worth: right names by their grade, wrong ones against it.

    Args:
        row: of a record.

    Returns:
        The sum over its names.
    """
    total = sum(WORTH.get(grade, 0.0) for grade in row.judgement.found)
    return total - COST * sum(WORTH[row.outcome.names[label].grade] for label in row.wrong(tuple(WORTH)))


def count_rule(name: str, whole: Sequence[Row], without: Sequence[Row]) -> RuleCount:
    """Return the paired counts of a rule.

    Args:
        name: of the rule.
        whole: rows with every rule.
        without: rows of the same records without this one.

    Returns:
        The counts.
    """
    pairs = [(a, b) for a, b in zip(whole, without, strict=True) if _names(a) != _names(b)]
    better = sum(worth(a) > worth(b) for a, b in pairs)
    return RuleCount(name, len(pairs), better, sum(worth(a) < worth(b) for a, b in pairs))


def _names(row: Row) -> dict[str, str]:
    return {label: effect.grade for label, effect in row.outcome.names.items()}


def ablation_table(counts: Sequence[RuleCount], rules: Sequence[GradeRule], records: int) -> str:
    """Return a Markdown table of the rules, those that change most first.

    Args:
        counts: of each rule.
        rules: rows of the diagnosis's table.
        records: of each count.

    Returns:
        The table.
    """
    known = {rule.name: rule for rule in rules}
    lines = [
        f"Of {records} records, without each rule: outcomes that change, better with the rule, worse with it.", "",
        "| rule | statistic | threshold | why | changed | better | worse |", 7 * "|---" + "|",
    ]  # fmt: skip
    for count in sorted(counts, key=lambda one: -one.changed):
        rule = known[count.name]
        threshold = f"`{rule.setting}`" if rule.setting else ""
        texts = (rule.name, rule.statistic, threshold, rule.reason)
        lines.append("| " + " | ".join((*texts, str(count.changed), str(count.better), str(count.worse))) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, default in (("singles", 50), ("none", 20), ("doubles", 20), ("unknown", 15), ("outside", 12)):
        parser.add_argument(f"--{name}", type=int, default=default, metavar="N")
    add_ways(parser)
    parser.add_argument("--rules", nargs="+", choices=[rule.name for rule in GRADE_RULES], metavar="NAME")
    parser.add_argument("--measured", type=Path, metavar="FOLDER")
    parser.add_argument("--docs", type=Path)
    parser.add_argument("--out", type=Path, default=Path("results/ablation"))
    args = parser.parse_args()
    counts = Counts(args.none, args.singles, args.doubles, args.unknown)
    records: list[tuple[Task, str]] = [
        (t, "diagnosis") for t in simulated_tasks(counts, args.seed, ways_of(args), args.machines)
    ]
    records += [(task, "outside_class") for task in outside_class.outside_tasks(args.outside, args.seed)]
    if args.measured:
        records += [(task, "measured") for task in measured.measured_tasks(args.measured)]
    chosen = args.rules or [rule.name for rule in GRADE_RULES]
    lines = args.out / f"rows-{args.seed}.jsonl"
    tasks = [AblatedTask(*record, rule) for rule in ("", *chosen) for record in records]
    rows = run_tasks(tasks, diagnose_task, lines, args.processes)
    whole, size = rows[: len(records)], len(records)
    found = [count_rule(rule, whole, rows[n * size : (n + 1) * size]) for n, rule in enumerate(chosen, 1)]
    table = ablation_table(found, GRADE_RULES, len(records))
    print(table)
    idle = [count.name for count in found if count.changed * RECORDS < LEAST * len(records)]
    print(f"\nchange fewer than {LEAST} in {RECORDS}: {', '.join(idle) or 'none'}")
    if args.docs:
        args.docs.write_text(f"# Ablation of the diagnosis's rules\n\n{table}\n")


if __name__ == "__main__":
    main()
