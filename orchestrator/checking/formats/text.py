"""Verdicts as lines for a terminal, and as the results of a JSON document."""

from collections.abc import Sequence

from orchestrator.checking.findings import SEVERITIES, Execution, Finding, FmuFindings, list_names
from orchestrator.checking.rules import RULES, TEXTS, Severity
from orchestrator.checking.verdict import Issue, Verdict, without_particulars
from orchestrator.plain_text import plain_text
from orchestrator.shared.results import CheckedFmu, CheckFound, FindingFound, RuleFound

# XML 1.0 cannot hold these, not even escaped; names in a hostile archive can.
FORBIDDEN = dict.fromkeys((*range(9), 11, 12, *range(14, 32), *range(0xD800, 0xE000), 0xFFFE, 0xFFFF), "?")

_MOST_PLACES = 5


def summary(verdict: Verdict) -> str:
    """The line of one FMU: how many issues of which severity, what the baseline has, and what was executed."""
    counts = [f"{verdict.count(s)} {s}{'s' * (verdict.count(s) > 1)}" for s in SEVERITIES if verdict.count(s)]
    known = sum(issue.known for issue in verdict.issues)
    if known:
        counts.append(f"{known} known")
    return f"{verdict.fmu}: {', '.join(counts) or 'no findings'} ({_extent(verdict.report)})"


def _extent(report: FmuFindings) -> str:
    """How far the FMU was executed, in a few words."""
    if not report.executed:
        return f"not executed: {report.not_executed}" if report.not_executed else "not executed"
    return f"executed, {', '.join(map(_run_text, report.executions))}"


def _run_text(execution: Execution) -> str:
    """How many stages of an interface ran, and the names of the others."""
    left = [stage for stage, reason in execution.stages.items() if reason]
    text = f"{execution.interface}: {len(execution.stages_run)} of {len(execution.stages)} stages"
    return f"{text}, not {list_names(left, _MOST_PLACES)}" if left else text


def as_lines(verdict: Verdict) -> list[str]:
    """The verdict for a terminal: the summary, then each new issue; the same fault at many places is one of them."""
    groups: dict[tuple[Severity, str, str], list[Finding]] = {}
    for issue in verdict.new_issues:
        f = issue.finding
        groups.setdefault((issue.severity, f.rule, without_particulars(f.message)), []).append(f)
    lines = [summary(verdict)]
    for (severity, rule, _), (first, *rest) in groups.items():
        lines += [f"  {severity:7} {rule}  {describe_place(first)}", f"          {first.message}"]
        if rest:
            places = list_names([describe_place(f) or f.message for f in rest], _MOST_PLACES)
            lines.append(f"          the same at {places}")
        lines.append(f"          -> {first.advice} ({describe_source(rule, verdict.report.version)})")
    return [plain_text(line) for line in lines]


def describe_place(finding: Finding) -> str:
    """Where a finding stands: its path, and line and column where they are known."""
    if not finding.line:
        return finding.path
    known = finding.path.startswith("modelDescription.xml")
    place = f"line {finding.line}, column {finding.column}"
    return f"{finding.path} ({place})" if known else f"{finding.path} (modelDescription.xml, {place})"


def describe_source(rule: str, version: str) -> str:
    """The section of the standard that a rule comes from, or that it is none of the standard's."""
    sections = [f"FMI {TEXTS[v]}, section {s}" for v, s in RULES[rule].anchor.items() if s and version in ("", v)]
    return "; ".join(sections) or "no rule of the standard"


def as_results(verdicts: Sequence[Verdict]) -> CheckFound:
    """The results for a JSON document and for the page."""
    return CheckFound(
        ok=all(v.ok for v in verdicts),
        counts={severity: sum(v.count(severity) for v in verdicts) for severity in SEVERITIES},
        fmus=[_fmu_result(v) for v in verdicts],
    )


def _fmu_result(verdict: Verdict) -> CheckedFmu:
    report = verdict.report
    findings = [_describe_finding(issue) for issue in verdict.issues]
    return CheckedFmu(
        verdict.fmu,
        verdict.ok,
        report.executed,
        {severity: verdict.count(severity) for severity in SEVERITIES},
        dict(report.facts),
        findings,
        report.not_executed,
        [RuleFound(o.rule, o.outcome, o.reason) for o in verdict.outcomes],
    )


def _describe_finding(issue: Issue) -> FindingFound:
    f = issue.finding
    return FindingFound(
        issue.severity, f.rule, f.path, f.message, f.advice, issue.fingerprint, issue.known, f.line, f.column
    )
