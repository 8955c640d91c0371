"""FMI compliance of FMUs."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from orchestrator.api.shown import Block, Result
from orchestrator.checking.batch import check_fmus, find_fmus, policy_of
from orchestrator.checking.check import TOTAL, CheckOptions
from orchestrator.checking.findings import Finding, FmuFindings
from orchestrator.checking.formats.code_quality import as_code_quality
from orchestrator.checking.formats.junit import as_junit
from orchestrator.checking.formats.sarif import as_sarif
from orchestrator.checking.formats.text import as_lines, as_results
from orchestrator.checking.policy import Policy
from orchestrator.checking.verdict import Verdict
from orchestrator.shared.isolation.archives import ArchiveLimits
from orchestrator.shared.isolation.limits import MEBIBYTE, Limits
from orchestrator.shared.results import CheckFound


@dataclass(frozen=True, repr=False)
class CheckResult(Result):
    """The findings on one FMU or several.

    Attributes:
        verdicts: one for each FMU.
    """

    command: ClassVar[str] = "check"
    verdicts: tuple[Verdict, ...]

    @property
    def ok(self) -> bool:
        """Whether no FMU has a finding that fails: an error, where the policy says nothing else."""
        return all(verdict.ok for verdict in self.verdicts)

    @property
    def reports(self) -> tuple[FmuFindings, ...]:
        """What the checks found, before the policy: one for each FMU."""
        return tuple(verdict.report for verdict in self.verdicts)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The findings of the rules that count, FMU after FMU, errors first."""
        return tuple(issue.finding for verdict in self.verdicts for issue in verdict.issues)

    def blocks(self) -> Sequence[Block]:
        return [line for verdict in self.verdicts for line in as_lines(verdict)]

    def junit(self) -> str:
        """Write the verdicts as JUnit XML.

        Returns:
            The XML text: a suite per FMU, a case per rule.
        """
        return as_junit(self.verdicts)

    def sarif(self) -> str:
        """Write the verdicts as SARIF 2.1.0.

        Returns:
            Text in SARIF 2.1.0 with one run.
        """
        return as_sarif(self.verdicts)

    def code_quality(self) -> str:
        """Write the findings as GitLab's Code Quality report.

        Returns:
            Text of a GitLab code quality report, a JSON array.
        """
        return as_code_quality(self.verdicts)

    def results(self, place: Path | None = None) -> CheckFound:
        return as_results(self.verdicts)


def check(
    fmus: Path | str | Iterable[Path | str],
    *,
    static: bool = False,
    trust: bool = False,
    policy: Policy | Path | str | None = None,
    time_limit: float = Limits().time,
    total_limit: float = TOTAL,
    memory_limit: float = Limits().memory / MEBIBYTE,
    size_limit: float = ArchiveLimits().total / MEBIBYTE,
    progress: Callable[[Verdict], None] = lambda verdict: None,
    tell: Callable[[str, float], None] = lambda stage, share: None,
) -> CheckResult:
    """Check FMUs for compliance with FMI; an FMU is run in a process of its own.

    Args:
        fmus: an FMU, an unpacked FMU or a folder with FMUs, or several of these.
        static: check the files alone, without calling the FMU.
        trust: run FMUs without the kernel's walls around them; limits remain.
        policy: which rules count, and how much: a file such as ``fmu-check.toml`` (default: all rules, as they are).
        time_limit: wall time that one call may take [s].
        total_limit: time limit of all calls of an FMU [s]; the result names skipped probes.
        memory_limit: memory that the running FMU may take [MiB].
        size_limit: size that the unpacked FMU may have [MiB].
        progress: called with the verdict on each FMU as it is ready.
        tell: called with what is done now, and the share of the present FMU's checks that are done (0 to 1).

    Returns:
        All findings; ``ok`` when none is an error.

    Raises:
        FmuError: a path does not exist, or a folder has no FMU.
        InputError: the policy or its baseline is wrong.

    Examples:
        >>> assert oc.check("other.fmu").ok
    """
    paths = find_fmus([fmus] if isinstance(fmus, (str, Path)) else list(fmus))
    options = CheckOptions(
        static=static,
        trust=trust,
        archive=ArchiveLimits(total=int(size_limit * MEBIBYTE)),
        limits=Limits(time=time_limit, memory=int(memory_limit * MEBIBYTE), total=total_limit),
        tell=tell,
    )
    given = {
        "fmus": [str(p) for p in paths],
        "static": static,
        "trust": trust,
        "policy": policy if policy is None or isinstance(policy, Policy) else str(policy),
        "time_limit": time_limit,
        "total_limit": total_limit,
        "memory_limit": memory_limit,
        "size_limit": size_limit,
    }
    rules = policy if isinstance(policy, Policy) else policy_of(policy)
    return CheckResult(tuple(check_fmus(paths, options, rules, progress)), arguments=given)
