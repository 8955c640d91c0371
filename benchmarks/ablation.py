"""What each rule of the diagnosis is worth: grades that would rise without it, of right names and of wrong ones.

    python -m benchmarks.ablation ROWS.jsonl ... [--docs docs/ablation.md]
    python -m benchmarks.ablation AFTER.jsonl ... --before BEFORE.jsonl ...    # of two builds, on the same records

The rows are those that ``benchmarks.diagnosis``, ``calibration``, ``outside_class`` and ``measured`` keep under
``--out``. Rules lower grades and choose nothing, so a row tells what its grades are without each of them. A Markdown
table, written to ``--docs`` where that is given.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from benchmarks.judging import Row
from benchmarks.rows import read_rows
from benchmarks.verdicts import GRADES, NAMED
from orchestrator.diagnosis.selection.grading import GRADE_RULES, GradeRule, highest_grade

HEADING = """# Ablation of the diagnosis's rules

`python -m benchmarks.ablation ROWS.jsonl ... --docs docs/ablation.md` writes this part of the page from the rows that
other benchmarks keep. The sections below say which these are."""
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
        f"For each rule, the table counts the records (of {records}) in which a grade would rise without the rule, and",
        "how many of the names concerned are wrong and right. A rule also lowers right names, because a record may",
        "leave a true effect undecided.",
        "",
        "| rule | statistic | threshold | why | records | wrong names | right names |", 7 * "|---" + "|",
    ]  # fmt: skip
    for count in sorted(counts, key=lambda one: -one.records):
        rule = known[count.name]
        threshold = f"`{rule.setting}`" if rule.setting else ""
        numbers = map(str, (count.records, count.wrong, count.right))
        lines.append("| " + " | ".join((rule.name, rule.statistic, threshold, rule.reason, *numbers)) + " |")
    return "\n".join(lines)


def paired_table(before: Sequence[Row], after: Sequence[Row]) -> str:
    """Return a Markdown table of what two builds say of the records that both were given.

    Args:
        before, after: rows of each build.

    Returns:
        The table: expected effects that are named at least as likely, names by grade that are right or wrong, false
        alarms.
    """
    known = {row.key: row for row in before}
    pairs = [(known[row.key], row) for row in after if row.key in known]

    def cells(count: Callable[[Row], int]) -> str:
        both = [(count(old), count(new)) for old, new in pairs]
        gained, lost = (sum(max(sign * (new - old), 0) for old, new in both) for sign in (1, -1))
        return f"{sum(old for old, _ in both)} | {sum(new for _, new in both)} | {gained} | {lost}"

    lines = [f"| {len(pairs)} records | before | after | more | fewer |", 5 * "|---" + "|"]
    lines.append(f"| effects named | {cells(lambda row: sum(grade in NAMED for grade in row.judgement.found))} |")
    for grade in GRADES:
        for words, verdicts in (("right", ("right",)), ("wrong", ("wrong", "untested"))):
            count = partial(_names, grade=grade, verdicts=verdicts)
            lines.append(f"| *{grade}*, {words} | {cells(count)} |")
    lines.append(f"| false alarms | {cells(lambda row: int(row.is_false_alarm()))} |")
    return "\n".join(lines)


def _names(row: Row, grade: str, verdicts: Sequence[str]) -> int:
    return sum(row.judgement.verdicts[label] in verdicts for label in row.outcome.labels((grade,)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", nargs="+", type=Path)
    parser.add_argument("--docs", type=Path)
    parser.add_argument("--before", nargs="+", type=Path)
    args = parser.parse_args()
    rows = [row for path in args.rows for row in read_rows(path)]
    if args.before:
        print(paired_table([row for path in args.before for row in read_rows(path)], rows))
        return
    counts = [count_rule(rule.name, rows) for rule in GRADE_RULES]
    table = ablation_table(counts, GRADE_RULES, len(rows))
    print(table)
    idle = [count.name for count in counts if count.records * RECORDS < LEAST * len(rows)]
    print(f"\nfewer than {LEAST} in {RECORDS}: {', '.join(idle) or 'none'}")
    if args.docs:
        _, _, rest = args.docs.read_text().partition("\n## ")  # what is said of changes stays
        args.docs.write_text(f"{HEADING}\n\n{table}\n" + (f"\n## {rest}" if rest else ""))


if __name__ == "__main__":
    main()
