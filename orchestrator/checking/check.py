"""The check of one FMU: static first, then, if that found no error, dynamic."""

from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.checking.archive import ArchiveLimits
from orchestrator.checking.dynamic import can_run, check_dynamic
from orchestrator.checking.findings import FmuFindings, has_errors, ordered
from orchestrator.checking.static import check_static
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
    executed = False
    d, files = result.description, result.files
    try:
        if not options.static and d is not None and files is not None and not has_errors(findings):
            executed = can_run(d, files)
            if executed:
                findings += check_dynamic(d, files, result.references, options.limits, not options.trust)
    finally:
        if files is not None:
            files.close()
    facts = result.facts | ({"walls": _walls(options.trust)} if executed else {})
    return FmuFindings(str(path), ordered(findings), executed, facts)


def _walls(trust: bool) -> str:
    """What the FMU was kept from by the kernel, for the reader."""
    if trust:
        return "none (trusted)"
    return support().in_words
