"""JUnit XML: a suite per FMU, a case per rule of the FMU's version of the standard."""

from collections.abc import Sequence

from lxml import etree

from orchestrator.checking.findings import RuleOutcome
from orchestrator.checking.formats.text import FORBIDDEN, describe_place
from orchestrator.checking.verdict import Issue, Verdict


def as_junit(verdicts: Sequence[Verdict]) -> str:
    """Write a case for each rule: failed when an issue fails, skipped when the rule was not run, else passed.

    A case that passes although the rule has issues (mild ones, or known ones) has them as its output.
    """
    suites = [_suite(v) for v in verdicts]
    root = etree.Element("testsuites", name="fmu-check", **_counts([c for suite in suites for c in suite]))
    root.extend(suites)
    etree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + etree.tostring(root, encoding="unicode") + "\n"


def _suite(verdict: Verdict) -> etree._Element:
    cases = [_case(verdict, o, [i for i in verdict.issues if i.finding.rule == o.rule]) for o in verdict.outcomes]
    suite = etree.Element("testsuite", name=_text(verdict.fmu), **_counts(cases))
    suite.extend(cases)
    return suite


def _counts(cases: Sequence[etree._Element]) -> dict[str, str]:
    failures = sum(case.find("failure") is not None for case in cases)
    skipped = sum(case.find("skipped") is not None for case in cases)
    return {"tests": str(len(cases)), "failures": str(failures), "errors": "0", "skipped": str(skipped)}


def _case(verdict: Verdict, outcome: RuleOutcome, issues: list[Issue]) -> etree._Element:
    case = etree.Element("testcase", classname=_text(verdict.fmu), name=outcome.rule)
    failing = [issue for issue in issues if verdict.fails(issue)]
    if failing:
        first = failing[0]
        kind, message = first.severity, _text(first.finding.message)
        failure = etree.SubElement(case, "failure", type=kind, message=message)
        failure.text = _case_text(issues)
    elif issues:
        etree.SubElement(case, "system-out").text = _case_text(issues)
    elif outcome.outcome == "not run":
        etree.SubElement(case, "skipped", message=_text(outcome.reason))
    return case


def _case_text(issues: Sequence[Issue]) -> str:
    lines = []
    for issue in issues:
        f = issue.finding
        known = " (known)" if issue.known else ""
        lines.append(f"{issue.severity}{known}: {describe_place(f)}\n{f.message}\n-> {f.advice}")
    return _text("\n".join(lines))


def _text(text: str) -> str:
    return text.translate(FORBIDDEN)
