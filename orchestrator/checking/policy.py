"""``fmu-check.toml``: which rules a project selects, how bad it takes them, and when the check fails.

The file holds, all of it optional::

    select = ["*"]                    # rules, or groups of them such as "variable.*"
    ignore = ["misuse.guid"]
    fail-on = "error"                 # "error", "warning", "info": the least severity that fails
    baseline = "fmu-baseline.json"    # known findings, which do not fail; relative to this file

    [severity]
    "files.written" = "error"

    [[fmu]]                           # further rules for the FMUs whose path or name fits
    fmu = "legacy/*.fmu"
    ignore = ["model.date"]
"""

import fnmatch
from collections.abc import Iterable
from pathlib import Path

import msgspec

from orchestrator.checking.catalogue import RULES
from orchestrator.checking.rules import Severity
from orchestrator.errors import InputError, ScenarioError
from orchestrator.shared.toml_files import read_toml

FILE_NAME = "fmu-check.toml"
_MOST_BYTES = 1 << 20


class FmuPolicy(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What holds for the FMUs that fit a pattern, beside what holds for all.

    Attributes:
        fmu: of their paths or names, with `*` and `?`.
        select, ignore, severity: as those of ``Policy``; what is selected here is so although all others ignore it.
    """

    fmu: str
    select: tuple[str, ...] = ()
    ignore: tuple[str, ...] = ()
    severity: dict[str, Severity] = {}

    def fits(self, fmu: str) -> bool:
        path = Path(fmu).as_posix()
        return fnmatch.fnmatchcase(path, self.fmu) or fnmatch.fnmatchcase(Path(fmu).name, self.fmu)


class Policy(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, rename="kebab"):
    """What a project makes of findings.

    Attributes:
        select, ignore: names or patterns of rules; a rule counts when it is selected and not ignored.
        severity: of rules, by name or pattern, in place of their own.
        fail_on: the least severity with which a finding fails the check.
        baseline: file of known findings; empty for none.
        fmu: what holds for single FMUs.
    """

    select: tuple[str, ...] = ("*",)
    ignore: tuple[str, ...] = ()
    severity: dict[str, Severity] = {}
    fail_on: Severity = "error"
    baseline: str = ""
    fmu: tuple[FmuPolicy, ...] = ()

    def severities(self, fmu: str) -> dict[str, Severity]:
        """Return the rules that count for an FMU, each with its severity."""
        special = [entry for entry in self.fmu if entry.fits(fmu)]
        selected = _match_rules(self.select) - _match_rules(self.ignore)
        for entry in special:
            selected = (selected | _match_rules(entry.select)) - _match_rules(entry.ignore)
        severities = {name: rule.severity for name, rule in RULES.items() if name in selected}
        for table in (self.severity, *(entry.severity for entry in special)):
            for pattern, severity in table.items():
                severities |= dict.fromkeys(_match_rules([pattern]) & severities.keys(), severity)
        return severities


def read_policy(path: Path) -> Policy:
    """Read a file of a policy."""
    try:
        policy = msgspec.convert(read_toml(path, _MOST_BYTES), type=Policy)
    except (msgspec.ValidationError, ScenarioError) as error:
        raise InputError(f"the policy {path} must be a valid policy file, but is not: {error}") from None
    for place, pattern in _patterns(policy):
        if not _match_rules([pattern]):
            raise InputError(f"{path}: `{place}` must name a rule or a group such as `archive.*`, but is {pattern!r}")
    if policy.baseline:
        policy = msgspec.structs.replace(policy, baseline=str(path.parent / policy.baseline))
    return policy


def _patterns(policy: Policy) -> Iterable[tuple[str, str]]:
    """Every name of a rule in the policy, with the key that it stands under."""
    for prefix, entry in (("", policy), *((f"fmu[{n}].", entry) for n, entry in enumerate(policy.fmu))):
        for key in ("select", "ignore", "severity"):
            yield from ((prefix + key, pattern) for pattern in getattr(entry, key))


def _match_rules(patterns: Iterable[str]) -> set[str]:
    return {name for pattern in patterns for name in fnmatch.filter(RULES, pattern)}
