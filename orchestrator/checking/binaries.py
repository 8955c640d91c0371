"""The shared libraries of an FMU, looked at without loading them."""

import platform
import posixpath
import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass

from orchestrator.checking.archive import FmuFiles
from orchestrator.checking.description import Description, Interface
from orchestrator.checking.findings import Finding
from orchestrator.checking.rules_model import C_NAME
from orchestrator.checking.xml_reading import xpath

MAXIMUM_BYTES = 512 << 20
SUFFIXES = {
    "win32": ".dll",
    "win64": ".dll",
    "linux32": ".so",
    "linux64": ".so",
    "darwin32": ".dylib",
    "darwin64": ".dylib",
}
# FMI 2.0 has no name for these platforms and lets vendors add some; these are the names of FMI 3.0.
WITHOUT_NAME = ("aarch64-linux", "aarch64-windows", "aarch32-linux", "riscv64-linux")
_LONGEST_NAME = 1 << 16
_FORMAT = {"win": "PE", "lin": "ELF", "dar": "Mach-O"}

_COMMON = (
    "GetTypesPlatform GetVersion SetDebugLogging Instantiate FreeInstance SetupExperiment EnterInitializationMode "
    "ExitInitializationMode Terminate Reset GetReal GetInteger GetBoolean GetString SetReal SetInteger SetBoolean "
    "SetString GetFMUstate SetFMUstate FreeFMUstate SerializedFMUstateSize SerializeFMUstate DeSerializeFMUstate "
    "GetDirectionalDerivative"
)
_COSIMULATION = (
    "SetRealInputDerivatives GetRealOutputDerivatives DoStep CancelStep GetStatus GetRealStatus GetIntegerStatus "
    "GetBooleanStatus GetStringStatus"
)
_MODEL_EXCHANGE = (
    "EnterEventMode NewDiscreteStates EnterContinuousTimeMode CompletedIntegratorStep SetTime SetContinuousStates "
    "GetDerivatives GetEventIndicators GetContinuousStates GetNominalsOfContinuousStates"
)
COSIMULATION_FUNCTIONS = tuple(f"fmi2{n}" for n in f"{_COMMON} {_COSIMULATION}".split())
MODEL_EXCHANGE_FUNCTIONS = tuple(f"fmi2{n}" for n in f"{_COMMON} {_MODEL_EXCHANGE}".split())


@dataclass(frozen=True)
class LibraryHeader:
    """What the header of a shared library says.

    Attributes:
        format: "ELF", "PE", "Mach-O" or "unknown".
        bits: 32 or 64, 0 when unknown.
        machine: "x86", "arm", or another name.
        shared: whether it can be loaded as a library.
        exported, undefined, needed: names, or None when the format does not tell.
    """

    format: str
    bits: int = 0
    machine: str = "unknown"
    shared: bool = True
    exported: frozenset[str] | None = None
    undefined: frozenset[str] | None = None
    needed: tuple[str, ...] | None = None


def here() -> str:
    """Folder of the binaries for this machine, such as "linux64".

    Returns:
        The folder's name.
    """
    system = {"linux": "linux", "win32": "win", "darwin": "darwin"}.get(sys.platform, sys.platform)
    return f"{system}{64 if sys.maxsize > 2**32 else 32}"


def library_name(identifier: str, folder: str) -> str:
    """Path of the shared library inside the FMU.

    Args:
        identifier: the model identifier of the interface.
        folder: of the binaries, such as "linux64".

    Returns:
        The path, with forward slashes.
    """
    return f"binaries/{folder}/{identifier}{SUFFIXES[folder]}"


def check_binaries(d: Description, files: FmuFiles) -> Iterator[Finding]:
    """Findings about binaries, sources and their folders.

    Args:
        d: the model description.
        files: of the FMU.

    Yields:
        Each finding.
    """
    names = set(files.names())
    folders = sorted({n.split("/")[1] for n in names if n.startswith("binaries/") and n.count("/") >= 2})
    for interface in d.interfaces:
        for element, source in interface.sources:
            if posixpath.normpath(f"sources/{source}") not in names:
                message = f"a source file must be in sources/, but `{source}` is not"
                yield Finding("file.source-missing", xpath(element, "name"), message)
    for folder in folders:
        if folder not in SUFFIXES and folder not in WITHOUT_NAME:
            message = f"a folder of binaries must be one of {', '.join(SUFFIXES)}, but is `{folder}`"
            yield Finding("binary.folder", f"binaries/{folder}", message)
    known = [f for f in folders if f in SUFFIXES]
    if not folders and not any(n.startswith("sources/") for n in names):
        yield Finding("binary.none", "binaries", "an FMU must have binaries or sources, but has neither")
    elif here() not in known:
        has = ", ".join(known) or "none (sources only)"
        yield Finding(
            "binary.not-here", "binaries", f"nothing can be run here ({here()}): the FMU has binaries for {has}"
        )
    for interface in d.interfaces:
        for folder in known:
            yield from _check_library(d, interface, folder, files, names)


def _check_library(
    d: Description, interface: Interface, folder: str, files: FmuFiles, names: set[str]
) -> Iterator[Finding]:
    if interface.identifier is None or not C_NAME.fullmatch(interface.identifier):
        return
    path = library_name(interface.identifier, folder)
    if path not in names:
        message = f"the library must be named after modelIdentifier, but there is no {path}"
        yield Finding("binary.missing", f"binaries/{folder}", message)
        return
    data = files.read(path, MAXIMUM_BYTES)
    library = inspect(data)
    unfit = misfit(library, path, folder)
    if unfit is not None:
        yield unfit
        return
    functions = COSIMULATION_FUNCTIONS if interface is d.cosimulation else MODEL_EXCHANGE_FUNCTIONS
    missing = [f for f in functions if not _exports(library, data, f)]
    if missing:
        yield Finding(
            "binary.exports", path, f"the library must export all FMI functions, but lacks {', '.join(missing)}"
        )
    python = sorted(u for u in library.undefined or () if u.startswith(("Py", "_Py")))
    if python and not any("python" in n for n in library.needed or ()):
        message = (
            f"the library uses {python[0]} and {len(python) - 1} more of Python without naming libpython as needed"
        )
        yield Finding("binary.python-symbols", path, message)


def misfit(library: LibraryHeader, path: str, folder: str) -> Finding | None:
    """Why a library cannot be loaded on the platform of its folder, as far as its header tells.

    Args:
        library: its header.
        path, folder: where it is, such as "linux64".

    Returns:
        The finding, or None when it can.
    """
    wanted = _FORMAT[folder[:3]]
    if library.format != wanted or not library.shared:
        found = f"a {library.format} file" if library.shared else "an executable, not a shared library"
        return Finding("binary.format", path, f"the library must be a {wanted} shared library, but is {found}")
    if library.bits != int(folder[-2:]):
        message = f"the library must be {folder[-2:]}-bit, but is {library.bits}-bit"
        return Finding("binary.architecture", path, message)
    if folder == here() and library.machine not in (_this_machine(), "fat"):
        message = f"the library is for {library.machine}, which this {_this_machine()} machine cannot run"
        return Finding("binary.architecture", path, message)
    return None


def _exports(library: LibraryHeader, data: bytes, function: str) -> bool:
    if library.exported is not None:
        return function in library.exported
    return function.encode() + b"\0" in data


def _this_machine() -> str:
    machine = platform.machine().lower()
    return (
        "x86"
        if machine in ("x86_64", "amd64", "i386", "i686", "x86")
        else "arm"
        if machine in ("arm64", "aarch64")
        else machine
    )


def inspect(data: bytes) -> LibraryHeader:
    """Read the header of a shared library; what cannot be read is "unknown".

    Args:
        data: the library's bytes.

    Returns:
        Its format, machine and exported symbols.
    """
    try:
        if data[:4] == b"\x7fELF":
            return _elf(data)
        if data[:2] == b"MZ":
            return _pe(data)
        return _mach(data)
    except (struct.error, IndexError, ValueError, OverflowError):
        return LibraryHeader("unknown")


def _elf(data: bytes) -> LibraryHeader:
    bits = {1: 32, 2: 64}.get(data[4], 0)
    order = "<" if data[5] == 1 else ">"
    kind, machine = struct.unpack_from(order + "HH", data, 16)
    name = {3: "x86", 62: "x86", 40: "arm", 183: "arm"}.get(machine, f"machine {machine}")
    if bits == 64:
        (offset,) = struct.unpack_from(order + "Q", data, 40)
        size, count = struct.unpack_from(order + "HH", data, 58)
    else:
        (offset,) = struct.unpack_from(order + "I", data, 32)
        size, count = struct.unpack_from(order + "HH", data, 46)
    sections = [_elf_section(data, order, bits, offset + i * size) for i in range(count)]
    symbols = next((s for s in sections if s[0] == 11), None)
    dynamic = next((s for s in sections if s[0] == 6), None)
    if symbols is None or dynamic is None:
        return LibraryHeader("ELF", bits, name, kind == 3)
    exported, undefined = _elf_symbols(data, order, bits, symbols, sections[symbols[3]])
    strings = sections[dynamic[3]]
    needed = []
    entry = order + ("qQ" if bits == 64 else "iI")
    for at in range(dynamic[1], dynamic[1] + dynamic[2], struct.calcsize(entry)):
        tag, value = struct.unpack_from(entry, data, at)
        if tag == 1:
            needed.append(_text(data, strings[1] + value))
    return LibraryHeader("ELF", bits, name, kind == 3, frozenset(exported), frozenset(undefined), tuple(needed))


def _elf_section(data: bytes, order: str, bits: int, at: int) -> tuple[int, int, int, int]:
    """Type, offset, size and link of a section header."""
    if bits == 64:
        _, kind, _, _, offset, size, link = struct.unpack_from(order + "IIQQQQI", data, at)
    else:
        _, kind, _, _, offset, size, link = struct.unpack_from(order + "IIIIIII", data, at)
    return kind, offset, size, link


def _elf_symbols(
    data: bytes, order: str, bits: int, table: tuple[int, int, int, int], strings: tuple[int, int, int, int]
) -> tuple[set[str], set[str]]:
    """Names defined and names undefined (weak ones left out) in the dynamic symbol table."""
    exported: set[str] = set()
    undefined: set[str] = set()
    layout = order + ("IBBHQQ" if bits == 64 else "IIIBBH")
    for at in range(table[1], table[1] + table[2], struct.calcsize(layout)):
        fields = struct.unpack_from(layout, data, at)
        info, section = (fields[1], fields[3]) if bits == 64 else (fields[3], fields[5])
        name = _text(data, strings[1] + fields[0])
        if section != 0:
            exported.add(name)
        elif info >> 4 == 1:
            undefined.add(name)
    return exported, undefined


def _text(data: bytes, at: int) -> str:
    """The text that ends with a zero byte; a hostile table must not make this slow."""
    return data[at : data.index(b"\0", at, at + _LONGEST_NAME)].decode() if 0 <= at < len(data) else ""


def _pe(data: bytes) -> LibraryHeader:
    (header,) = struct.unpack_from("<I", data, 0x3C)
    if data[header : header + 4] != b"PE\0\0":
        return LibraryHeader("unknown")
    machine, _, _, _, _, _, flags = struct.unpack_from("<HHIIIHH", data, header + 4)
    bits, name = {0x14C: (32, "x86"), 0x8664: (64, "x86"), 0xAA64: (64, "arm")}.get(machine, (0, f"machine {machine}"))
    return LibraryHeader("PE", bits, name, bool(flags & 0x2000))


def _mach(data: bytes) -> LibraryHeader:
    if data[:4] in (b"\xca\xfe\xba\xbe", b"\xca\xfe\xba\xbf"):
        return LibraryHeader("Mach-O", 64, "fat")
    if data[:4] not in (b"\xcf\xfa\xed\xfe", b"\xce\xfa\xed\xfe"):
        return LibraryHeader("unknown")
    _, cpu, _, kind = struct.unpack_from("<IIII", data, 0)
    name = {7: "x86", 12: "arm"}.get(cpu & 0xFFFFFF, f"cpu {cpu}")
    return LibraryHeader("Mach-O", 64 if cpu & 0x01000000 else 32, name, kind in (6, 8))
