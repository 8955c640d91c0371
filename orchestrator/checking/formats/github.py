"""What a step of GitHub Actions shows: annotations (commands on standard output) and a summary in Markdown."""

from collections import Counter
from collections.abc import Mapping, Sequence

from orchestrator.checking.findings import SEVERITIES
from orchestrator.checking.formats.text import describe_place
from orchestrator.checking.rules import Severity
from orchestrator.checking.verdict import Issue, Verdict, artifact, describe_file
from orchestrator.plain_text import plain_text

MOST_ANNOTATIONS = 10
"""Of each level; GitHub shows no more of a step."""
_MOST_LISTED = 50

_LEVELS: Mapping[Severity, str] = {"error": "error", "warning": "warning", "info": "notice"}


def as_annotations(verdicts: Sequence[Verdict]) -> list[str]:
    """The issues that the baseline does not have as workflow commands, at most ``MOST_ANNOTATIONS`` of each level."""
    lines = []
    seen: Counter[str] = Counter()
    for verdict, issue in _new_issues(verdicts):
        level = _LEVELS[issue.severity]
        seen[level] += 1
        if seen[level] <= MOST_ANNOTATIONS:
            f = issue.finding
            file, title = (_property(plain_text(text)) for text in (describe_file(verdict.fmu, f.line), f.rule))
            place = f",line={f.line},col={f.column}" if f.line else ""
            text = _escape(plain_text(f"{describe_place(f)}: {f.message} -> {f.advice}"))
            lines.append(f"::{level} file={file}{place},title={title}::{text}")
    return lines


def as_summary(verdicts: Sequence[Verdict]) -> str:
    """Write the summary of the step: a row per FMU, then the issues."""
    lines = ["## FMU check", "", "| FMU | result | executed | passed | failed | not run |", "|---|---|---|---|---|---|"]
    for verdict in verdicts:
        counts = Counter(o.outcome for o in verdict.outcomes)
        executed = "yes" if verdict.report.executed else f"no: {verdict.report.not_executed}"
        result = "ok" if verdict.ok else "**failed**"
        numbers = [str(counts[outcome]) for outcome in ("passed", "failed", "not run")]
        lines.append(f"| {' | '.join((_cell(artifact(verdict.fmu)), result, _cell(executed), *numbers))} |")
    issues = _new_issues(verdicts)
    if issues:
        lines += ["", "| FMU | severity | rule | what | advice |", "|---|---|---|---|---|"]
    for verdict, issue in issues[:_MOST_LISTED]:
        f = issue.finding
        cells = (artifact(verdict.fmu), issue.severity, f.rule, f"{describe_place(f)}: {f.message}", f.advice)
        lines.append(f"| {' | '.join(map(_cell, cells))} |")
    if len(issues) > _MOST_LISTED:
        lines += ["", f"{len(issues) - _MOST_LISTED} further findings are in the other reports."]
    return "\n".join(lines) + "\n"


def _new_issues(verdicts: Sequence[Verdict]) -> list[tuple[Verdict, Issue]]:
    """Issues that the baseline does not have, worst first."""
    issues = [(verdict, issue) for verdict in verdicts for issue in verdict.new_issues]
    return sorted(issues, key=lambda pair: SEVERITIES.index(pair[1].severity))


def _escape(text: str) -> str:
    return text.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _escape(text).replace(":", "%3A").replace(",", "%2C")


def _cell(text: str) -> str:
    for character, written in (("&", "&amp;"), ("<", "&lt;"), ("|", "&#124;"), ("`", "&#96;"), ("[", "&#91;")):
        text = text.replace(character, written)
    return plain_text(text)
