"""Random damage to a good FMU: to its bytes, to the fields of its ZIP structures, and to its files."""

import copy
import io
import random
import re
import zipfile
from pathlib import Path

from lxml import etree

from tests.support import ball3
from tests.support.c_fmu import LIBRARY, REFERENCE, fmu_files, write_fmu

_TEXTS = ("modelDescription.xml", f"{REFERENCE}/fmi-ls-manifest.xml", f"{REFERENCE}/MassSpring_out.csv")
_TEXTS_3 = (ball3.XML, ball3.TERMINALS, ball3.BUILD, ball3.MANIFEST, f"{ball3.REFERENCE}/Ball_out.csv")
_ODD = (
    "", " ", "-1", "0", "1e400", "NaN", "INF", "-INF", "99999999999999999999", "4294967296", "true", "x" * 5000, "\t",
    "é", "\U0001f600", "../..", "&amp;", "1 2 3", "fixed", "constant", "input", "independent", "Real", "der(x)", "2.0",
    "1e-320", "0x10", "1_000", "１２", "'", "%s%n", "{0}",
)  # fmt: skip
_SIGNATURES = (b"PK\x01\x02", b"PK\x03\x04", b"PK\x05\x06")


def _flip(rng: random.Random, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8, 64))):
        changed[rng.randrange(len(changed))] = rng.randrange(256)
    return bytes(changed)


def _cut(rng: random.Random, data: bytes) -> bytes:
    a, b = sorted(rng.randrange(len(data) + 1) for _ in range(2))
    return rng.choice((data[:a], data[a:], data[:a] + data[b:], data[:b] + data[a:]))


def _field(rng: random.Random, data: bytes) -> bytes:
    """Damage within 50 bytes of a ZIP signature, where the fields are."""
    places = [m.start() for s in _SIGNATURES for m in re.finditer(re.escape(s), data)]
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = min(rng.choice(places) + rng.randrange(50), len(changed) - 4)
        width = rng.choice((1, 2, 4))
        changed[at : at + width] = rng.choice((bytes(width), b"\xff" * width, rng.randbytes(width)))
    return bytes(changed)


def damaged_tree(rng: random.Random, data: bytes) -> bytes:
    """Well-formed XML with odd values, missing, repeated or moved attributes and elements."""
    root = etree.fromstring(data)
    for _ in range(rng.choice((1, 1, 1, 2, 5))):
        element = rng.choice(list(root.iter("*")))
        other = rng.choice(list(root.iter("*")))
        kind = rng.randrange(7)
        if kind < 4 and element.attrib:
            key = rng.choice(list(element.attrib))
            donor = rng.choice(list(other.attrib.values()) or [""])
            element.set(key, rng.choice((rng.choice(_ODD), donor)))
        elif kind == 4 and element.attrib:
            del element.attrib[rng.choice(list(element.attrib))]
        elif element is not root and kind == 5:
            element.getparent().remove(element)
        elif element is not root and other not in element.iter():
            other.append(copy.deepcopy(element))
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8")


def _table(rng: random.Random, data: bytes) -> bytes:
    """A CSV with odd, missing or repeated cells."""
    rows = [line.split(",") for line in data.decode().splitlines()]
    for _ in range(rng.choice((1, 1, 5))):
        row = rng.choice(rows[:1] * 20 + rows)
        at = rng.randrange(len(row)) if row else 0
        row[at : at + rng.randrange(2)] = [rng.choice(_ODD)] * rng.randrange(3)
    return "\n".join(",".join(row) for row in rows).encode()


def damaged(rng: random.Random, path: Path, version: str = "2.0") -> bool:
    """Write a damaged FMU to ``path``; whether its library is untouched, so that it may be run."""
    if version == "2.0":
        files, texts, library = fmu_files(), _TEXTS, LIBRARY
    else:
        interface = rng.choice(list(ball3.INTERFACES))
        files, texts, library = ball3.ball_files("", interface), _TEXTS_3, ball3.LIBRARY
    kind = rng.randrange(10)
    if kind < 5:
        name = rng.choice(texts[:1] * 4 + texts[1:])
        files[name] = (_table if name.endswith(".csv") else damaged_tree)(rng, files[name])
        write_fmu(path, files)
        return True
    if kind == 5:
        name = rng.choice(texts)
        files[name] = rng.choice((_flip, _cut))(rng, files[name])
        write_fmu(path, files)
        return True
    if kind == 6:
        files[library] = rng.choice((_flip, _cut))(rng, files[library])
        write_fmu(path, files)
        return False
    write_fmu(path, files)
    path.write_bytes(rng.choice((_flip, _cut, _field, _field))(rng, path.read_bytes()))
    return _same_library(path, library, files[library])


def _same_library(path: Path, name: str, library: bytes) -> bool:
    try:
        with zipfile.ZipFile(io.BytesIO(path.read_bytes())) as archive:
            return archive.read(name) == library
    except Exception:
        return False
