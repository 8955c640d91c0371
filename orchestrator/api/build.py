"""The FMUs of this project, built."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from orchestrator.api.shown import Block, Result
from orchestrator.building.build import ROOT, default_directory, ensure_built
from orchestrator.building.launcher import find_toolchain
from orchestrator.building.native_build import ensure_native, native_directory, native_remark
from orchestrator.building.sources import catalogue
from orchestrator.errors import FmuError, OutputError
from orchestrator.shared.results import BuildFound

PLATFORMS = ("here", "all")
VERSIONS = (2, 3)


@dataclass(frozen=True, repr=False)
class BuildResult(Result):
    """FMUs that are up to date; ``result["Drivetrain"]`` is the path of one.

    Attributes:
        paths: path of each FMU by its model's name.
        remark: what this machine cannot give an FMU, or None.
    """

    command: ClassVar[str] = "build"
    paths: Mapping[str, Path]
    remark: str | None = None

    def __getitem__(self, name: str) -> Path:
        return self.paths[name]

    def blocks(self) -> Sequence[Block]:
        """Return a line for each FMU, and the remark."""
        lines = [f"{n:<20}{short_path(p)}  {p.stat().st_size / 1024:.0f} kB" for n, p in self.paths.items()]
        return lines if self.remark is None else [*lines, f"note: {self.remark}"]

    def results(self, place: Path) -> BuildFound:
        return BuildFound(fmus={name: str(path) for name, path in self.paths.items()}, remark=self.remark)


def short_path(path: Path) -> str:
    """Return a path for the reader."""
    try:
        return str(path.resolve().relative_to(ROOT))
    except ValueError:
        return str(path)


def build(
    names: Sequence[str] | None = None,
    *,
    directory: Path | str | None = None,
    force: bool = False,
    native: bool = False,
    platforms: str = "here",
    fmi: int = 2,
    real_outputs: bool = False,
    progress: Callable[[str, float], None] | None = None,
) -> BuildResult:
    """Build the FMUs that are missing or older than what they are made from.

    Args:
        names: which FMUs (default: all).
        directory: where they go (default: ``fmus/`` of the repository, or of the current folder; native ones
            ``fmus/native/``, those of FMI 3.0 ``fmus/fmi3/``).
        force: build also what is up to date.
        native: translate the sources to C and compile them, so that the FMUs need no Python at run time.
        platforms: of native FMUs: that of this machine ("here"), or "all" that the compiler can make.
        fmi: version of FMI, 2 or 3; FMUs of FMI 3.0 are native.
        real_outputs: of native FMUs: make outputs that are no real numbers local variables, for hosts that read every
            output as a real number; they go to ``real/`` within the folder.
        progress: called after each native FMU with what was done, and the share of all.

    Returns:
        The path of each FMU, by name.

    Raises:
        FmuError: a name is unknown, a build fails, a native one lacks a compiler, or ``real_outputs`` is asked of
            others.
        OutputError: ``directory`` is a file.

    Examples:
        >>> oc.build(["Drivetrain"])["Drivetrain"].name
        'Drivetrain.fmu'
    """
    if fmi not in VERSIONS:
        raise FmuError(f"`fmi` must be one of {', '.join(map(str, VERSIONS))}, but is {fmi!r}", "fmi")
    native = native or fmi == 3
    if real_outputs and not native:
        raise FmuError("`real_outputs` must be asked of native FMUs, but is asked of others", "real_outputs")
    usual = native_directory(fmi, real_outputs) if native else default_directory()
    folder = usual if directory is None else Path(directory)
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"`directory` must be a folder, but {folder} is a file", "directory")
    unknown = [name for name in names or () if name not in catalogue()]
    if unknown:
        raise FmuError(f"`names` must be among {', '.join(catalogue())}, but has {unknown[0]!r}", "names")
    if platforms not in PLATFORMS:
        raise FmuError(f"`platforms` must be one of {', '.join(PLATFORMS)}, but is {platforms!r}", "platforms")
    chosen = list(names) if names else None
    if not native:
        paths = ensure_built(chosen, folder, force=force)
        given = {"names": list(paths), "directory": str(folder), "force": force}
        return BuildResult(paths, find_toolchain().remark, arguments=given)
    here = platforms == "here"
    paths = ensure_native(chosen, folder, force=force, here=here, fmi=fmi, real_outputs=real_outputs, progress=progress)
    given = {"names": list(paths), "directory": str(folder), "force": force, "native": True, "platforms": platforms}
    given |= {"fmi": fmi} if fmi != 2 else {}
    given |= {"real_outputs": True} if real_outputs else {}
    return BuildResult(paths, None if here else native_remark(), arguments=given)
