"""Code Quality JSON, as GitLab reads it."""

from collections.abc import Mapping, Sequence

import msgspec

from orchestrator.checking.rules import Severity
from orchestrator.checking.verdict import Verdict, describe_file
from orchestrator.plain_text import plain_text

_SEVERITIES: Mapping[Severity, str] = {"error": "major", "warning": "minor", "info": "info"}


def as_code_quality(verdicts: Sequence[Verdict]) -> str:
    """Write the issues that the baseline does not have."""
    issues = [
        {
            "description": plain_text(f"{issue.finding.message} ({issue.finding.path})"),
            "check_name": issue.finding.rule,
            "fingerprint": issue.fingerprint,
            "severity": _SEVERITIES[issue.severity],
            "location": {
                "path": describe_file(verdict.fmu, issue.finding.line),
                "lines": {"begin": issue.finding.line or 1},
            },
        }
        for verdict in verdicts
        for issue in verdict.new_issues
    ]
    return msgspec.json.format(msgspec.json.encode(issues), indent=1).decode() + "\n"
