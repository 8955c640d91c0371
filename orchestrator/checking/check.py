"""The check of one FMU: static first, then dynamic, unless the FMU cannot be read or has nothing that runs here."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from orchestrator.checking.archive import ArchiveLimits
from orchestrator.checking.dynamic import check_dynamic, obstacle
from orchestrator.checking.findings import Execution, Finding, FmuFindings, order_findings
from orchestrator.checking.places import locate_findings
from orchestrator.checking.static import StaticResult, check_static
from orchestrator.checking.xml_reading import MAXIMUM_BYTES
from orchestrator.errors import FmuError
from orchestrator.shared.isolation.archives import content_hash
from orchestrator.shared.isolation.limits import Limits
from orchestrator.shared.isolation.walls import support

TOTAL = 120.0
"""Seconds that all that is executed of an FMU may take: ten times what most take."""


@dataclass(frozen=True)
class CheckOptions:
    """How to check.

    Attributes:
        archive, limits: what the archive and the running FMU may use.
        trust: run the FMU without the kernel's walls around it; limits remain.
        probes: names of the dynamic checks to carry out (default: all).
        tell: called with what is done now, and the share of the FMU's checks that are done (0 to 1).
    """

    static: bool = False
    archive: ArchiveLimits = field(default_factory=ArchiveLimits)
    limits: Limits = field(default_factory=lambda: Limits(total=TOTAL))
    trust: bool = False
    probes: tuple[str, ...] = ()
    tell: Callable[[str, float], None] = lambda stage, share: None


def check_fmu(path: Path, options: CheckOptions | None = None) -> FmuFindings:
    """All findings on an FMU, a file or unpacked; nothing of it is executed unless ``executed`` is set."""
    options = options or CheckOptions()
    digest, result = _digest(path), check_static(path, options.archive)
    findings = list(result.findings)
    executions: tuple[Execution, ...] = ()
    reason = "nothing is executed, as was asked" if options.static else _obstacle(result)
    try:
        if not reason:
            assert result.description is not None
            assert result.files is not None
            probed, executions = check_dynamic(
                result.description, result.files, result.references, options.limits, not options.trust, options.probes,
                options.tell,
            )  # fmt: skip
            findings += probed
        elif not options.static and not any(f.severity == "error" for f in findings):
            findings.append(Finding("run.not-executed", "", f"the FMU must be executed, but is not: {reason}"))
        shown = order_findings(findings)
        if result.files is not None and result.description is not None:
            data = result.files.read("modelDescription.xml", MAXIMUM_BYTES)
            shown = locate_findings(shown, data, result.description)
    finally:
        if result.files is not None:
            result.files.close()
    walls = "none (trusted)" if options.trust else support().in_words
    facts = result.facts | digest | ({"walls": walls} if executions else {})
    version = "" if result.description is None else result.description.dialect.version
    return FmuFindings(str(path), shown, version, result.stages, executions, reason, facts)


def _obstacle(result: StaticResult) -> str:
    """Why nothing can be executed; empty when something can. Formal faults are no reason."""
    if result.files is None:
        return "its archive cannot be read"
    if result.description is None:
        return "its modelDescription.xml cannot be read, or is of a version that is not covered"
    return obstacle(result.description, result.files)


def _digest(path: Path) -> dict[str, str]:
    """Return the hash of an FMU's file, for the reader to know which one was checked; none of an unpacked one."""
    if not path.is_file():
        return {}
    try:
        return {"sha256": content_hash(path)}
    except FmuError:  # which is a finding of the archive
        return {}
