"""What the checks report: one flat list of findings per FMU."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from orchestrator.checking.rules import RULES, Severity

SEVERITIES: tuple[Severity, ...] = ("error", "warning", "info")
MOST_PER_RULE = 100

Facts = dict[str, str | int | list[str]]
"""What is known about an FMU, by name: model, version, tool, interfaces, number of variables, platforms."""


@dataclass(frozen=True)
class Finding:
    """One violated rule at one place.

    Attributes:
        rule: key of ``RULES``.
        path: file inside the FMU, and an XPath after a colon where there is one.
        message: what was expected and what was found, one sentence.
    """

    rule: str
    path: str
    message: str

    def __post_init__(self) -> None:
        if self.rule not in RULES:
            raise KeyError(f"`rule` must be one of RULES, but is {self.rule!r}")

    @property
    def severity(self) -> Severity:
        """One of "error", "warning" and "info"."""
        return RULES[self.rule].severity

    @property
    def advice(self) -> str:
        """What to do about it."""
        return RULES[self.rule].advice


@dataclass(frozen=True)
class FmuFindings:
    """All that was found about one FMU.

    Attributes:
        fmu: path as the user gave it.
        findings: sorted by severity, then in the order found.
        executed: whether the FMU's binary was run.
        facts: what is known about the FMU (name, version, platforms, …), for the reader.
    """

    fmu: str
    findings: tuple[Finding, ...]
    executed: bool = False
    facts: Facts = field(default_factory=dict)

    def count(self, severity: str) -> int:
        """Number of findings of one severity.

        Args:
            severity: one of ``SEVERITIES``.

        Returns:
            Their number.
        """
        return sum(f.severity == severity for f in self.findings)

    @property
    def ok(self) -> bool:
        """No finding of severity "error"."""
        return self.count("error") == 0


def ordered(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Errors first, each kept in the order found, repeats removed, at most ``MOST_PER_RULE`` of one rule.

    Args:
        findings: in any order.

    Returns:
        The findings that a report shows.
    """
    seen: Counter[str] = Counter()
    kept = []
    for finding in dict.fromkeys(findings):
        seen[finding.rule] += 1
        if seen[finding.rule] <= MOST_PER_RULE:
            kept.append(finding)
    for rule, count in seen.items():
        if count > MOST_PER_RULE:
            kept.append(Finding(rule, "", f"and {count - MOST_PER_RULE} more findings of this rule"))
    return tuple(sorted(kept, key=lambda f: SEVERITIES.index(f.severity)))


def has_errors(findings: Iterable[Finding]) -> bool:
    """Whether any finding is an error.

    Args:
        findings: in any order.

    Returns:
        True when one is.
    """
    return any(f.severity == "error" for f in findings)
