"""The headers of shared libraries (ELF, PE, Mach-O), read without loading them."""

import struct
from dataclasses import dataclass

_LONGEST_NAME = 1 << 16


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


def inspect(data: bytes) -> LibraryHeader:
    """Read the header of a shared library; what cannot be read is "unknown"."""
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
