"""What the checks report: one flat list of findings per FMU."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

from orchestrator.checking.rules import RULES, Severity

SEVERITIES: tuple[Severity, ...] = ("error", "warning", "info")
MOST_PER_RULE = 100

Facts = dict[str, str | int | list[str]]
"""What is known about an FMU, by name: model, version, tool, interfaces, number of variables, platforms."""


@dataclass(frozen=True)
class Finding:
    """One violated rule at one place.

    Attributes:
        path: file inside the FMU, and an XPath after a colon where there is one.
        message: what was expected and what was found, one sentence.
        line, column: of that element in modelDescription.xml, from 1; 0 where there is none.
    """

    rule: str
    path: str
    message: str
    line: int = 0
    column: int = 0

    def __post_init__(self) -> None:
        if self.rule not in RULES:
            raise KeyError(f"`rule` must be one of RULES, but is {self.rule!r}")

    @property
    def severity(self) -> Severity:
        """One of "error", "warning" and "info"."""
        return RULES[self.rule].severity

    @property
    def advice(self) -> str:
        return RULES[self.rule].advice


_NOTHING = "the FMU has nothing that it applies to"
Outcome = Literal["passed", "failed", "not run"]


@dataclass(frozen=True)
class RuleOutcome:
    """What became of one rule on one FMU."""

    rule: str
    outcome: Outcome  # "failed" with a finding of the rule, "passed" when its stage was carried out without one
    reason: str = ""  # why it was not run; empty otherwise


@dataclass(frozen=True)
class Execution:
    """How far one interface of an FMU was executed."""

    interface: str  # "CoSimulation", "ModelExchange" or "ScheduledExecution"
    # what was done with the running FMU, "load" and then every probe by name: empty when it was carried out, otherwise
    # why it was not
    stages: Mapping[str, str]

    @property
    def stages_run(self) -> tuple[str, ...]:
        return tuple(stage for stage, reason in self.stages.items() if not reason)


@dataclass(frozen=True)
class FmuFindings:
    """All that was found about one FMU."""

    fmu: str  # path as the user gave it
    findings: tuple[Finding, ...]  # sorted by severity, then in the order found
    version: str = ""  # "2.0" or "3.0"; empty where the check got not so far, or the version is another one
    # the stages that execute nothing, by name: empty when carried out, otherwise why not
    stages: Mapping[str, str] = field(default_factory=dict)
    executions: tuple[Execution, ...] = ()  # one for each interface that was run, or tried
    not_executed: str = ""  # why nothing was executed; empty when something was
    # what is known about the FMU (name, version, platforms, …), for the reader
    facts: Facts = field(default_factory=dict)

    @property
    def executed(self) -> bool:
        return any("load" in execution.stages_run for execution in self.executions)

    @property
    def outcomes(self) -> tuple[RuleOutcome, ...]:
        """What became of each rule of the FMU's version (of every rule while the version is not known)."""
        failed = {f.rule for f in self.findings}
        rules = (name for name, rule in RULES.items() if not self.version or self.version in rule.versions)
        return tuple(self._outcome(name, name in failed) for name in rules)

    def _outcome(self, rule: str, failed: bool) -> RuleOutcome:
        if failed:
            return RuleOutcome(rule, "failed")
        stage = RULES[rule].stage
        reasons = [e.stages[stage] for e in self.executions if stage in e.stages]
        if stage in self.stages:
            reasons.append(self.stages[stage])
        if "" in reasons:
            return RuleOutcome(rule, "passed")
        return RuleOutcome(rule, "not run", reasons[0] if reasons else self.not_executed or _NOTHING)

    def count(self, severity: str) -> int:
        return sum(f.severity == severity for f in self.findings)

    @property
    def ok(self) -> bool:
        return self.count("error") == 0


def list_names(names: Sequence[str], most: int = 12) -> str:
    """Names for a message, not too many of them."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def order_findings(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Errors first, each kept in the order found, equal ones as one, at most ``MOST_PER_RULE`` of one rule."""
    seen: Counter[str] = Counter()
    kept = []
    for finding in _group(findings):
        seen[finding.rule] += 1
        if seen[finding.rule] <= MOST_PER_RULE:
            kept.append(finding)
    for rule, count in seen.items():
        if count > MOST_PER_RULE:
            kept.append(Finding(rule, "", f"and {count - MOST_PER_RULE} more findings of this rule"))
    return tuple(sorted(kept, key=lambda f: SEVERITIES.index(f.severity)))


def _group(findings: Iterable[Finding]) -> Iterator[Finding]:
    """Findings of one rule with the same message as one, at the first place in a file; those of a probe stay apart."""
    places: dict[tuple[str, str, str], dict[str, Finding]] = {}
    for finding in findings:
        probe = finding.path if finding.path.startswith("(") else ""
        places.setdefault((finding.rule, finding.message, probe), {}).setdefault(finding.path, finding)
    for paths in places.values():
        first, *rest = paths.values()
        yield replace(first, message=f"{first.message} (at {len(paths)} places)") if rest else first
