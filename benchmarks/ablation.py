"""What each rule of the diagnosis is worth: grades that would rise without it, of right names and of wrong ones.

    python -m benchmarks.ablation ROWS.jsonl ... [--docs docs/ablation.md]

The rows are those that ``benchmarks.diagnosis``, ``calibration``, ``outside_class`` and ``measured`` keep under
``--out``. Rules lower grades and choose nothing, so a row tells what its grades are without each of them. A Markdown
table, written to ``--docs`` where that is given.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.judging import Row
from benchmarks.rows import read_rows
from orchestrator.diagnosis.selection.grading import GRADE_RULES, GradeRule, highest_grade

HEADING = """# Ablation of the diagnosis's rules

`python -m benchmarks.ablation ROWS.jsonl ... --docs docs/ablation.md` writes this page from the rows of other
benchmarks. The records are those of [measurements](measurements.md#diagnosis), simulated and measured."""
LEAST = 2  # outcomes that a rule must change in RECORDS
RECORDS = 730


@dataclass(frozen=True)
class RuleCount:
    """What changes without a rule.

    Attributes:
        name: of the rule.
        records: in which a grade would rise.
        wrong: wrong names whose grade would rise: the rule does good.
        right: right names whose grade would rise: the rule does harm.
    """

    name: str
    records: int
    wrong: int
    right: int


def count_rule(name: str, rows: Sequence[Row]) -> RuleCount:
    """Return what changes without a rule.

    Args:
        name: of the rule.
        rows: of records.

    Returns:
        The counts.
    """
    risen = [(row, label) for row in rows for label in row.outcome.names if _rises(row, label, name)]
    verdicts = [row.judgement.verdicts[label] for row, label in risen]
    wrong = sum(verdict in ("wrong", "untested") for verdict in verdicts)
    return RuleCount(name, len({row.key for row, _ in risen}), wrong, verdicts.count("right"))


def _rises(row: Row, label: str, rule: str) -> bool:
    effect = row.outcome.names[label]
    return highest_grade([name for name in effect.lowered_by if name != rule]) > highest_grade(effect.lowered_by)


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
        f"Of {records} records: those in which a grade would rise without the rule, and how many wrong and right names",
        "these are. A rule lowers right names too: what a record leaves open is not certain, though it may be true.",
        "",
        "| rule | statistic | threshold | why | records | wrong names | right names |", 7 * "|---" + "|",
    ]  # fmt: skip
    for count in sorted(counts, key=lambda one: -one.records):
        rule = known[count.name]
        threshold = f"`{rule.setting}`" if rule.setting else ""
        numbers = map(str, (count.records, count.wrong, count.right))
        lines.append("| " + " | ".join((rule.name, rule.statistic, threshold, rule.reason, *numbers)) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", nargs="+", type=Path)
    parser.add_argument("--docs", type=Path)
    args = parser.parse_args()
    rows = [row for path in args.rows for row in read_rows(path)]
    counts = [count_rule(rule.name, rows) for rule in GRADE_RULES]
    table = ablation_table(counts, GRADE_RULES, len(rows))
    print(table)
    idle = [count.name for count in counts if count.records * RECORDS < LEAST * len(rows)]
    print(f"\nfewer than {LEAST} in {RECORDS}: {', '.join(idle) or 'none'}")
    if args.docs:
        args.docs.write_text(f"{HEADING}\n\n{table}\n")


if __name__ == "__main__":
    main()
