"""Verdicts as lines for a terminal, and as the results of a JSON document."""

from collections.abc import Sequence

from orchestrator.checking.findings import SEVERITIES, FmuFindings
from orchestrator.checking.verdict import Verdict
from orchestrator.plain_text import plain_text
from orchestrator.shared.results import CheckedFmu, CheckFound, FindingFound, RuleFound

# XML 1.0 cannot hold these, not even escaped; names in a hostile archive can.
FORBIDDEN = dict.fromkeys((*range(9), 11, 12, *range(14, 32), *range(0xD800, 0xE000), 0xFFFE, 0xFFFF), "?")


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
    runs = (f"{e.interface}: {len(e.stages_run)} of {len(e.stages)} stages" for e in report.executions)
    return f"executed, {', '.join(runs)}"


def as_lines(verdict: Verdict) -> list[str]:
    """The verdict for a terminal: the summary, then three lines for each issue that the baseline does not have."""
    lines = [summary(verdict)]
    for issue in verdict.issues:
        if not issue.known:
            f = issue.finding
            lines += [f"  {issue.severity:7} {f.rule}  {f.path}", f"          {f.message}", f"          -> {f.advice}"]
    return [plain_text(line) for line in lines]


def as_results(verdicts: Sequence[Verdict]) -> CheckFound:
    """The results for a JSON document and for the page."""
    return CheckFound(
        ok=all(v.ok for v in verdicts),
        counts={severity: sum(v.count(severity) for v in verdicts) for severity in SEVERITIES},
        fmus=[_fmu_result(v) for v in verdicts],
    )


def _fmu_result(verdict: Verdict) -> CheckedFmu:
    report = verdict.report
    findings = [
        FindingFound(
            i.severity, i.finding.rule, i.finding.path, i.finding.message, i.finding.advice, i.fingerprint, i.known
        )
        for i in verdict.issues
    ]
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
