"""The check of one FMU: static first, then, if that found no error, dynamic."""

from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.checking.archive import ArchiveLimits
from orchestrator.checking.dynamic import can_run, check_dynamic
from orchestrator.checking.findings import Execution, FmuFindings, has_errors, ordered
from orchestrator.checking.static import StaticResult, check_static
from orchestrator.shared.isolation.limits import Limits
from orchestrator.shared.isolation.walls import support


@dataclass(frozen=True)
class CheckOptions:
    """How to check.

    Attributes:
        static: execute nothing.
        archive, limits: what the archive and the running FMU may use.
        trust: run the FMU without the kernel's walls around it; limits remain.
    """

    static: bool = False
    archive: ArchiveLimits = field(default_factory=ArchiveLimits)
    limits: Limits = field(default_factory=Limits)
    trust: bool = False


def check_fmu(path: Path, options: CheckOptions | None = None) -> FmuFindings:
    """Check an FMU file or an unpacked FMU.

    Args:
        path: an existing file or folder.
        options: default limits when None.

    Returns:
        All findings; nothing of the FMU has been executed unless ``executed`` is set.
    """
    options = options or CheckOptions()
    result = check_static(path, options.archive)
    findings = list(result.findings)
    executions: tuple[Execution, ...] = ()
    reason = _not_run(options, result)
    try:
        if not reason:
            assert result.description is not None
            assert result.files is not None
            probed, execution = check_dynamic(
                result.description, result.files, result.references, options.limits, not options.trust
            )
            findings += probed
            executions = (execution,)
    finally:
        if result.files is not None:
            result.files.close()
    facts = result.facts | ({"walls": _walls(options.trust)} if executions else {})
    version = "2.0" if result.description is not None else ""
    return FmuFindings(str(path), ordered(findings), version, result.stages, executions, reason, facts)


def _not_run(options: CheckOptions, result: StaticResult) -> str:
    """Why nothing is executed; empty when something is."""
    if options.static:
        return "nothing is executed, as was asked"
    if has_errors(result.findings):
        return "there are errors in what is read"
    if result.description is None or result.files is None:
        return "the version of FMI is not covered"
    if not can_run(result.description, result.files):
        return "there is no co-simulation library for this machine"
    return ""


def _walls(trust: bool) -> str:
    """What the FMU was kept from by the kernel, for the reader."""
    if trust:
        return "none (trusted)"
    return support().in_words
