"""SARIF 2.1.0, as code scanning of platforms reads it.

Platforms show every result as an alert, those of kind "pass" too. So results are issues alone; rules that passed are
properties of the run, and rules that were not run are notifications of the invocation.
"""

from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import quote

import msgspec

from orchestrator.checking.catalogue import RULES
from orchestrator.checking.findings import FmuFindings
from orchestrator.checking.formats.text import describe_place
from orchestrator.checking.rules import TEXTS, VERSIONS, Rule, Severity
from orchestrator.checking.verdict import Issue, Verdict, artifact, describe_file
from orchestrator.plain_text import plain_text
from orchestrator.shared.version import __version__

SCHEMA = "https://json.schemastore.org/sarif-2.1.0.json"
FINGERPRINT = "fmuCheck/v1"
MOST_RESULTS = 5000
"""GitHub shows as many of a run, and refuses runs with five times as many."""

_LEVELS: Mapping[Severity, str] = {"error": "error", "warning": "warning", "info": "note"}


def as_sarif(verdicts: Sequence[Verdict]) -> str:
    """One run; at most ``MOST_RESULTS`` results, the worst, and a notification where there are more."""
    names = sorted(
        {o.rule for v in verdicts for o in v.outcomes} | {i.finding.rule for v in verdicts for i in v.issues}
    )
    index = {name: number for number, name in enumerate(names)}
    results = [_result(v, issue, index) for v in verdicts for issue in v.issues]
    results.sort(key=lambda result: ("error", "warning", "note").index(result["level"]))
    notes = [_not_run(v.report, o.rule, o.reason) for v in verdicts for o in v.outcomes if o.outcome == "not run"]
    if len(results) > MOST_RESULTS:
        text = f"{len(results) - MOST_RESULTS} further results are left out: platforms take {MOST_RESULTS}"
        notes.append({"level": "warning", "message": {"text": text}})
    passed = {artifact(v.fmu): [o.rule for o in v.outcomes if o.outcome == "passed"] for v in verdicts}
    run = {
        "tool": {
            "driver": {
                "name": "fmu-check",
                "version": __version__,
                "semanticVersion": __version__,
                "rules": [_descriptor(name, RULES[name]) for name in names],
            }
        },
        "columnKind": "unicodeCodePoints",
        "invocations": [{"executionSuccessful": True, "toolExecutionNotifications": notes}],
        "results": results[:MOST_RESULTS],
        "properties": {"passed": passed},
    }
    document = {"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}
    return msgspec.json.format(msgspec.json.encode(document), indent=1).decode() + "\n"


def _descriptor(name: str, rule: Rule) -> dict[str, Any]:
    places = [f"FMI {TEXTS[v]}, section {rule.anchor[v]}" for v in VERSIONS if rule.anchor.get(v)]
    links = {v: rule.link(v) for v in rule.versions if rule.link(v)}
    source = "; ".join(places) or "a rule of fmu-check, not of the standard"
    linked = [f"[FMI {TEXTS[v]}, section {rule.anchor[v]}]({link})" for v, link in links.items()]
    described = {
        "id": name,
        "shortDescription": {"text": _sentence(rule.expects)},
        "fullDescription": {"text": f"{_sentence(rule.expects)} ({source})"},
        "help": {
            "text": f"{_sentence(rule.advice)} Source: {source}.",
            "markdown": f"{_sentence(rule.advice)}\n\nSource: {'; '.join(linked) or source}.",
        },
        "defaultConfiguration": {"level": _LEVELS[rule.severity]},
        "properties": {"tags": ["FMI", rule.stage]},
    }
    newest = [links[v] for v in VERSIONS if v in links]
    return described | ({"helpUri": newest[-1]} if newest else {})


def _result(verdict: Verdict, issue: Issue, index: Mapping[str, int]) -> dict[str, Any]:
    f = issue.finding
    result: dict[str, Any] = {
        "ruleId": f.rule,
        "ruleIndex": index[f.rule],
        "level": _LEVELS[issue.severity],
        "message": {"text": plain_text(f"{f.message} ({describe_place(f)})" if f.path else f.message)},
        "locations": [_location(verdict.report, f.path, f.line, f.column)],
        "partialFingerprints": {FINGERPRINT: issue.fingerprint},
    }
    if issue.known:
        result["suppressions"] = [{"kind": "external", "justification": "in the baseline"}]
    return result


def _location(report: FmuFindings, path: str, line: int = 0, column: int = 0) -> dict[str, Any]:
    """A place: a line of modelDescription.xml, which is a file of its own in an unpacked FMU alone."""
    uri = quote(describe_file(report.fmu, line))
    region = {"startLine": line, "startColumn": column} if line else {"startLine": 1}
    place: dict[str, Any] = {"physicalLocation": {"artifactLocation": {"uri": uri}, "region": region}}
    if path:
        place["logicalLocations"] = [{"fullyQualifiedName": plain_text(path)}]
    return place


def _not_run(report: FmuFindings, rule: str, reason: str) -> dict[str, Any]:
    return {
        "level": "note",
        "descriptor": {"id": rule},
        "message": {"text": plain_text(f"not run: {reason}")},
        "locations": [_location(report, "")],
    }


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:]}" + ("" if text.endswith((".", "…")) else ".")
