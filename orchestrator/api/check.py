"""FMI compliance of FMUs."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from orchestrator.api.shown import Block, Result
from orchestrator.checking.check import CheckOptions, check_fmu
from orchestrator.checking.findings import Finding, FmuFindings
from orchestrator.checking.writing import as_junit, as_lines, as_results
from orchestrator.errors import FmuError
from orchestrator.shared.isolation.archives import ArchiveLimits
from orchestrator.shared.isolation.limits import MEBIBYTE, Limits
from orchestrator.shared.results import CheckFound


@dataclass(frozen=True, repr=False)
class CheckResult(Result):
    """The findings on one FMU or several.

    Attributes:
        reports: one for each FMU.
        arguments: what was asked for.
    """

    command: ClassVar[str] = "check"
    reports: tuple[FmuFindings, ...]
    arguments: Mapping[str, Any] = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        """Whether no FMU has a finding of severity "error"."""
        return all(report.ok for report in self.reports)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings, FMU after FMU, errors first."""
        return tuple(finding for report in self.reports for finding in report.findings)

    def blocks(self) -> Sequence[Block]:
        """Return the lines of each FMU."""
        return [line for report in self.reports for line in as_lines(report)]

    def junit(self) -> str:
        """Write the findings as JUnit XML.

        Returns:
            The XML text: a suite per FMU, a case per finding.
        """
        return as_junit(self.reports)

    def results(self, place: Path | None = None) -> CheckFound:
        """Return what ``check.json`` says."""
        return as_results(self.reports)


def check(
    fmus: Path | str | Iterable[Path | str],
    *,
    static: bool = False,
    trust: bool = False,
    time_limit: float = Limits().time,
    memory_limit: float = Limits().memory / MEBIBYTE,
    size_limit: float = ArchiveLimits().total / MEBIBYTE,
    progress: Callable[[FmuFindings], None] = lambda report: None,
) -> CheckResult:
    """Check FMUs for compliance with FMI; an FMU is run in a process of its own.

    Args:
        fmus: an FMU, an unpacked FMU or a folder with FMUs, or several of these.
        static: execute nothing.
        trust: run FMUs without the kernel's walls around them; limits remain.
        time_limit: wall time that one call may take [s].
        memory_limit: memory that the running FMU may take [MiB].
        size_limit: size that the unpacked FMU may have [MiB].
        progress: called with the report of each FMU as it is ready.

    Returns:
        All findings; ``ok`` when none is an error.

    Raises:
        FmuError: a path does not exist, or a folder has no FMU.

    Example:
        >>> assert oc.check("other.fmu").ok
    """
    paths = find_fmus([fmus] if isinstance(fmus, (str, Path)) else list(fmus))
    options = CheckOptions(
        static=static,
        trust=trust,
        archive=ArchiveLimits(total=int(size_limit * MEBIBYTE)),
        limits=Limits(time=time_limit, memory=int(memory_limit * MEBIBYTE)),
    )
    given = {
        "fmus": [str(p) for p in paths],
        "static": static,
        "trust": trust,
        "time_limit": time_limit,
        "memory_limit": memory_limit,
        "size_limit": size_limit,
    }
    reports = []
    for path in paths:
        reports.append(check_fmu(path, options))
        progress(reports[-1])
    return CheckResult(tuple(reports), given)


def find_fmus(paths: Sequence[Path | str]) -> list[Path]:
    """Return the FMUs that paths mean: files, unpacked FMUs, and the ``*.fmu`` of folders.

    Args:
        paths: files and folders.

    Returns:
        Each FMU once, in their order.

    Raises:
        FmuError: a path does not exist, or a folder has no FMU.
    """
    found: list[Path] = []
    for path in map(Path, paths):
        if path.is_dir() and not (path / "modelDescription.xml").exists():
            inside = sorted(p for p in path.iterdir() if p.suffix.lower() == ".fmu")
            if not inside:
                raise FmuError(f"a folder must have *.fmu files or a modelDescription.xml, but {path} has neither")
            found += inside
        elif path.is_file() or path.is_dir():
            found.append(path)
        else:
            raise FmuError(f"an FMU must be an existing file or folder, but {path} is not")
    return list(dict.fromkeys(found))
