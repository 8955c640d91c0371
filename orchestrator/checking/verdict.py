"""The verdict on an FMU: its findings as the project's policy rates them, and what became of each rule."""

import hashlib
import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import msgspec

from orchestrator.checking.findings import SEVERITIES, Finding, FmuFindings, RuleOutcome
from orchestrator.checking.policy import Policy
from orchestrator.checking.rules import Severity
from orchestrator.errors import InputError

_QUOTED = re.compile(r"(`[^`]*`)")
_NUMBER = re.compile(r"[-+]?\d+(\.\d+)?([eE][-+]?\d+)?")
_TEXT = re.compile(r'"[^"]*"')
_MOST_BYTES = 64 << 20


@dataclass(frozen=True)
class Issue:
    """A finding as the policy rates it."""

    finding: Finding
    severity: Severity  # of its rule, by the policy
    fingerprint: str  # 32 hexadecimal digits that stay the same while the finding does, on every machine
    known: bool = False  # whether the baseline has it


@dataclass(frozen=True)
class Verdict:
    """What is made of one FMU."""

    report: FmuFindings  # what the checks found
    issues: tuple[Issue, ...]  # the findings of the rules that count, worst first
    outcomes: tuple[RuleOutcome, ...]  # of all rules of the FMU's version; a rule that does not count is not run
    fail_on: Severity = "error"  # the least severity with which an issue fails

    @property
    def fmu(self) -> str:
        return self.report.fmu

    @property
    def ok(self) -> bool:
        """No issue fails."""
        return not any(self.fails(issue) for issue in self.issues)

    @property
    def new_issues(self) -> list[Issue]:
        """Those that the baseline does not have."""
        return [issue for issue in self.issues if not issue.known]

    def fails(self, issue: Issue) -> bool:
        """Whether an issue fails the check: bad enough, and not known."""
        return not issue.known and SEVERITIES.index(issue.severity) <= SEVERITIES.index(self.fail_on)

    def count(self, severity: str) -> int:
        """Number of issues of one severity that the baseline does not have."""
        return sum(issue.severity == severity for issue in self.new_issues)


def judge(report: FmuFindings, policy: Policy, baseline: frozenset[str] = frozenset()) -> Verdict:
    """Rate the findings on one FMU."""
    severities = policy.severities(report.fmu)
    issues = []
    seen: Counter[str] = Counter()
    for finding in report.findings:
        if finding.rule in severities:
            content = _content(report.fmu, finding)
            seen[content] += 1
            fingerprint = hashlib.sha256(f"{content}\n{seen[content]}".encode()).hexdigest()[:32]
            issues.append(Issue(finding, severities[finding.rule], fingerprint, fingerprint in baseline))
    issues.sort(key=lambda issue: SEVERITIES.index(issue.severity))
    outcomes = tuple(
        o if o.rule in severities else RuleOutcome(o.rule, "not run", "the policy ignores it") for o in report.outcomes
    )
    return Verdict(report, tuple(issues), outcomes, policy.fail_on)


def _content(fmu: str, finding: Finding) -> str:
    """What makes a finding this one: not its position among others, and no measured number."""
    parts = _QUOTED.split(finding.message)
    message = "".join(part if part.startswith("`") else _NUMBER.sub("#", part) for part in parts)
    path = re.sub(r"\[\d+\]", "", finding.path)
    return "\n".join((artifact(fmu), finding.rule, path, message))


def without_particulars(message: str) -> str:
    """A message without names and numbers: what findings of the same fault at several places share."""
    return _NUMBER.sub("#", _QUOTED.sub("`...`", _TEXT.sub('"..."', message)))


def artifact(fmu: str) -> str:
    """Return the path of an FMU as platforms want it: relative to the working directory where it is below that."""
    path = Path(fmu)
    if path.is_absolute() and path.is_relative_to(Path.cwd()):
        path = path.relative_to(Path.cwd())
    return path.as_posix()


def describe_file(fmu: str, line: int) -> str:
    """Return the file that a platform shows: of an unpacked FMU the description, where a line of it is meant."""
    return f"{artifact(fmu)}/modelDescription.xml" if line and Path(fmu).is_dir() else artifact(fmu)


class _Known(msgspec.Struct, frozen=True):
    """An entry of a baseline; only the fingerprint is compared, the rest is for who reads the file."""

    fingerprint: str
    fmu: str = ""
    rule: str = ""
    message: str = ""


def read_baseline(path: Path) -> frozenset[str]:
    """Read the fingerprints of known findings."""
    try:
        with path.open("rb") as stream:
            data = stream.read(_MOST_BYTES + 1)
        if len(data) > _MOST_BYTES:
            raise InputError(f"the baseline {path} must have at most {_MOST_BYTES} bytes, but has more")
        entries = msgspec.json.decode(data, type=dict[str, list[_Known]])
    except OSError as error:
        raise InputError(f"the baseline {path} must be readable, but is not: {error.strerror}") from None
    except (msgspec.MsgspecError, RecursionError) as error:
        raise InputError(f"the baseline {path} must be a list of known findings, but is not: {error}") from None
    if "known" not in entries:
        raise InputError(f"the baseline {path} must have the list `known`, but has none")
    return frozenset(entry.fingerprint for entry in entries["known"])


def baseline_of(verdicts: Iterable[Verdict]) -> str:
    """Return all issues as known ones: a JSON document for ``read_baseline``."""
    known = [
        _Known(issue.fingerprint, artifact(verdict.fmu), issue.finding.rule, issue.finding.message)
        for verdict in verdicts
        for issue in verdict.issues
    ]
    data = msgspec.json.format(msgspec.json.encode({"known": known}), indent=1)
    return data.decode() + "\n"
