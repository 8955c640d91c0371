"""The shared libraries of an FMU, looked at without loading them, and its sources."""

import platform
import posixpath
import re
import sys
from collections.abc import Collection, Iterator
from dataclasses import dataclass

from orchestrator.checking.archive import FmuFiles
from orchestrator.checking.description import Description, Interface
from orchestrator.checking.findings import Finding, list_names
from orchestrator.checking.library_headers import LibraryHeader, inspect
from orchestrator.checking.rules import Version, declare
from orchestrator.checking.rules_model import C_NAME
from orchestrator.checking.tables.functions import FUNCTIONS
from orchestrator.checking.xml_reading import xpath

declare("""
[files]
file.source-missing | W | 2.3 | - | source files named are in sources/ | add the file, or remove it from SourceFiles
[binaries]
binary.none | E | 2.3 | 2.5.1 | there are binaries or sources | export for a platform
binary.not-here | W | * | * | there is a binary for this machine | export for this platform, or check on another one
binary.folder | W | 2.3 | 2.5.1.4.1 | folders of binaries have the names of the standard | rename the folder
binary.missing | E | 2.3 | 2.5.1.4 | the library is named after modelIdentifier | rename the library or the modelIdentifier
binary.format | E | 2.3 | 2.5.1.4 | the library has the platform's format | put the right file into the folder
binary.architecture | E | 2.3 | 2.5.1.4 | the library has the platform's architecture | put the right file into the folder
binary.exports | E | 2.1.1 | 2.2.1 | all functions are exported | define the functions (they may return an error) and export them
binary.python-symbols | W | * | * | a library that uses Python names libpython as needed | link against libpython, or it loads in Python programs only
""")  # noqa: E501

MAXIMUM_BYTES = 512 << 20
_SUFFIXES = {"ELF": ".so", "PE": ".dll", "Mach-O": ".dylib"}


@dataclass(frozen=True)
class BinaryPlatform:
    """What the libraries in a folder of binaries are for; an empty machine is any."""

    format: str
    bits: int
    machine: str = ""

    @property
    def suffix(self) -> str:
        """Of the file names of its libraries."""
        return _SUFFIXES[self.format]


_SYSTEMS = {"windows": "PE", "linux": "ELF", "darwin": "Mach-O"}
_MACHINES = {"x86": (32, "x86"), "x86_64": (64, "x86"), "aarch32": (32, "arm"), "aarch64": (64, "arm")}
_TUPLES = {
    f"{arch}-{system}": BinaryPlatform(form, *machine)
    for arch, machine in _MACHINES.items()
    for system, form in _SYSTEMS.items()
}
_SHORT = {"win": "PE", "linux": "ELF", "darwin": "Mach-O"}
PLATFORMS: dict[Version, dict[str, BinaryPlatform]] = {
    "2.0": {f"{system}{bits}": BinaryPlatform(form, bits) for system, form in _SHORT.items() for bits in (32, 64)},
    "3.0": _TUPLES,
}
# FMI 2.0 has no name for these platforms and lets vendors add some; these are the names of FMI 3.0.
WITHOUT_NAME = ("aarch64-linux", "aarch64-windows", "aarch32-linux", "riscv64-linux")
# Architectures of FMI 3.0 without a check of their own; a static library may name the toolchain, too.
_OTHERS = re.compile(rf"({'|'.join(_MACHINES)}|riscv32|riscv64|ppc32|ppc64)-({'|'.join(_SYSTEMS)})(-[a-z][a-z0-9_]*)?")


def here(version: Version = "2.0") -> str:
    """Folder of the binaries for this machine, such as "linux64" or "x86_64-linux"."""
    bits = 64 if sys.maxsize > 2**32 else 32
    if version == "2.0":
        return f"{'win' if sys.platform == 'win32' else sys.platform}{bits}"
    arch = next((a for a, m in _MACHINES.items() if m == (bits, _this_machine())), _this_machine())
    return f"{arch}-{'windows' if sys.platform == 'win32' else sys.platform}"


def library_name(identifier: str, folder: str, version: Version = "2.0") -> str:
    """Path of the shared library inside the FMU. Return the path, with forward slashes."""
    described = PLATFORMS[version].get(folder)
    return f"binaries/{folder}/{identifier}{described.suffix if described else ''}"


def loadable(d: Description, interface: Interface, names: Collection[str]) -> str:
    """The library of an interface for this machine."""
    version = d.dialect.version
    folder = here(version)
    path = library_name(interface.identifier or "", folder, version)
    if path in names:
        return path
    suffix = PLATFORMS[version][folder].suffix if folder in PLATFORMS[version] else ""
    others = [n for n in names if suffix and posixpath.dirname(n) == f"binaries/{folder}" and n.endswith(suffix)]
    return others[0] if len(others) == 1 else ""


def check_binaries(d: Description, files: FmuFiles) -> Iterator[Finding]:
    """Findings about binaries, sources and their folders."""
    version = d.dialect.version
    names = set(files.names())
    folders = sorted({n.split("/")[1] for n in names if n.startswith("binaries/") and n.count("/") >= 2})
    for interface in d.interfaces:
        absent = [(e, s) for e, s in interface.sources if posixpath.normpath(f"sources/{s}") not in names]
        if absent:
            message = f"source files must be in sources/, but are not: {list_names([f'`{s}`' for _, s in absent])}"
            yield Finding("file.source-missing", xpath(absent[0][0], "name"), message)
    known = [f for f in folders if f in PLATFORMS[version]]
    others = [f for f in folders if (f in WITHOUT_NAME if version == "2.0" else _OTHERS.fullmatch(f))]
    for folder in folders:
        if folder not in known and folder not in others:
            message = f"a folder of binaries must be one of {', '.join(PLATFORMS[version])}, but is `{folder}`"
            yield Finding("binary.folder", f"binaries/{folder}", message)
    if not known and not others and (folders or not any(n.startswith("sources/") for n in names)):
        has = "binaries for no platform that FMI names" if folders else "neither"
        yield Finding("binary.none", "binaries", f"an FMU must have binaries or sources, but has {has}")
    elif here(version) not in known:
        has = ", ".join(known) or ("none (sources only)" if not folders else "none that is known")
        message = f"nothing can be run here ({here(version)}): the FMU has binaries for {has}"
        yield Finding("binary.not-here", "binaries", message)
    for interface in d.interfaces:
        for folder in known:
            yield from _check_library(d, interface, folder, files, names)


def _check_library(
    d: Description, interface: Interface, folder: str, files: FmuFiles, names: set[str]
) -> Iterator[Finding]:
    if interface.identifier is None or not C_NAME.fullmatch(interface.identifier):
        return
    path = library_name(interface.identifier, folder, d.dialect.version)
    if path not in names:
        if d.dialect.version == "3.0" and _static_only(folder, names):
            return
        message = f"the library must be named after modelIdentifier, but there is no {path}"
        yield Finding("binary.missing", f"binaries/{folder}", message)
        return
    data = files.read(path, MAXIMUM_BYTES)
    library = inspect(data)
    unfit = misfit(library, path, PLATFORMS[d.dialect.version][folder], folder == here(d.dialect.version))
    if unfit is not None:
        yield unfit
        return
    missing = [f for f in FUNCTIONS[d.dialect.version].export_names(interface.kind) if not _exports(library, data, f)]
    if missing:
        message = f"the library must export all FMI functions, but lacks {list_names(missing)}"
        yield Finding("binary.exports", path, message)
    python = sorted(u for u in library.undefined or () if u.startswith(("Py", "_Py")))
    if python and not any("python" in n for n in library.needed or ()):
        message = f"the library uses {python[0]} and {len(python) - 1} more of Python"
        message += " without naming libpython as needed"
        yield Finding("binary.python-symbols", path, message)


def _static_only(folder: str, names: set[str]) -> bool:
    inside = [n for n in names if n.startswith(f"binaries/{folder}/")]
    return any(n.endswith((".a", ".lib")) for n in inside) and not any(
        n.endswith(tuple(_SUFFIXES.values())) for n in inside
    )


def misfit(library: LibraryHeader, path: str, wanted: BinaryPlatform, native: bool) -> Finding | None:
    """Why a library cannot be loaded on a platform, as far as its header tells; None when it can."""
    if library.format != wanted.format or not library.shared:
        found = f"a {library.format} file" if library.shared else "an executable, not a shared library"
        return Finding("binary.format", path, f"the library must be a {wanted.format} shared library, but is {found}")
    if library.machine == "fat":
        return None
    if library.bits != wanted.bits:
        message = f"the library must be {wanted.bits}-bit, but is {library.bits}-bit"
        return Finding("binary.architecture", path, message)
    machine = wanted.machine or (_this_machine() if native else "")
    if machine and library.machine != machine:
        message = f"the library must be for {machine}, but is for {library.machine}"
        return Finding("binary.architecture", path, message)
    return None


def _exports(library: LibraryHeader, data: bytes, function: str) -> bool:
    if library.exported is not None:
        return function in library.exported
    return function.encode() + b"\0" in data


def _this_machine() -> str:
    names = dict.fromkeys(("x86_64", "amd64", "i386", "i686"), "x86") | dict.fromkeys(("arm64", "aarch64"), "arm")
    machine = platform.machine().lower()
    return names.get(machine, machine)
