"""Findings as text, JSON and JUnit XML."""

from collections.abc import Iterable, Sequence
from xml.sax.saxutils import escape, quoteattr

from orchestrator.checking.findings import SEVERITIES, FmuFindings
from orchestrator.shared.results import CheckedFmu, CheckFound, FindingFound

# XML 1.0 cannot hold these, not even escaped; names in a hostile archive can.
_FORBIDDEN = dict.fromkeys((*range(9), 11, 12, *range(14, 32), *range(0xD800, 0xE000), 0xFFFE, 0xFFFF), "?")


def summary(report: FmuFindings) -> str:
    """The line of one FMU.

    Args:
        report: of one FMU.

    Returns:
        One line.
    """
    how = f" ({_extent(report)})"
    if not report.findings:
        return f"{report.fmu}: no findings{how}"
    counts = [f"{report.count(s)} {s}{'s' * (report.count(s) > 1)}" for s in SEVERITIES if report.count(s)]
    return f"{report.fmu}: {', '.join(counts)}{how}"


def _extent(report: FmuFindings) -> str:
    """How far the FMU was executed, in a few words."""
    if not report.executed:
        return "not executed"
    runs = (f"{e.interface}: {len(e.carried_out)} of {len(e.stages)} stages" for e in report.executions)
    return f"executed, {', '.join(runs)}"


def as_lines(report: FmuFindings) -> list[str]:
    """The report for a terminal: the summary, then three lines for each finding.

    Args:
        report: of one FMU.

    Returns:
        The lines, without control characters.
    """
    lines = [summary(report)]
    for f in report.findings:
        lines += [f"  {f.severity:7} {f.rule}  {f.path}", f"          {f.message}", f"          -> {f.advice}"]
    return [" ".join(line.translate(_FORBIDDEN).splitlines()) for line in lines]


def as_results(reports: Sequence[FmuFindings]) -> CheckFound:
    """The results for a JSON document and for the page.

    Args:
        reports: one per FMU.

    Returns:
        What was found.
    """
    return CheckFound(
        ok=all(r.ok for r in reports),
        counts={s: sum(r.count(s) for r in reports) for s in SEVERITIES},
        fmus=[_checked(r) for r in reports],
    )


def _checked(report: FmuFindings) -> CheckedFmu:
    counts: dict[str, int] = {s: report.count(s) for s in SEVERITIES}
    findings = [FindingFound(f.severity, f.rule, f.path, f.message, f.advice) for f in report.findings]
    return CheckedFmu(report.fmu, report.ok, report.executed, counts, dict(report.facts), findings)


def as_junit(reports: Sequence[FmuFindings]) -> str:
    """JUnit XML: a suite per FMU, a case per finding; errors fail, the others are skipped, so that a CI shows them.

    Args:
        reports: one per FMU.

    Returns:
        The document.
    """
    suites = [_suite(r) for r in reports]
    return '<?xml version="1.0" encoding="UTF-8"?>\n<testsuites>\n' + "\n".join(suites) + "\n</testsuites>\n"


def _suite(report: FmuFindings) -> str:
    cases = list(_cases(report))
    failures = report.count("error")
    skipped = len(report.findings) - failures
    counts = f'tests="{len(cases)}" failures="{failures}" errors="0" skipped="{skipped}"'
    head = f"<testsuite name={_attribute(report.fmu)} {counts}>"
    return "\n".join([head, *cases, "</testsuite>"])


def _cases(report: FmuFindings) -> Iterable[str]:
    if not report.findings:
        yield f'<testcase classname={_attribute(report.fmu)} name="no findings"/>'
    for f in report.findings:
        tag = "failure" if f.severity == "error" else "skipped"
        kind = f" type={_attribute(f.severity)}" if tag == "failure" else ""
        body = escape(f"{f.path}\n{f.advice}".translate(_FORBIDDEN)) if tag == "failure" else ""
        yield (
            f"<testcase classname={_attribute(report.fmu)} name={_attribute(f'{f.rule} {f.path}')}>"
            f"<{tag}{kind} message={_attribute(f.message)}>{body}</{tag}></testcase>"
        )


def _attribute(text: str) -> str:
    return quoteattr(text.translate(_FORBIDDEN))
