"""Mutations of files inside the FMU: modelDescription.xml, manifest, documentation, libraries."""

import struct
from collections.abc import Callable

from orchestrator.checking.tables.functions import FUNCTIONS
from tests.support.c_fmu import LIBRARY, REFERENCE

Files = dict[str, bytes]
XML = "modelDescription.xml"
MANIFEST = f"{REFERENCE}/fmi-ls-manifest.xml"
RESULT = f"{REFERENCE}/MassSpring_out.csv"


def replacing(old: str, new: str, file: str = XML) -> Callable[[Files], None]:
    """A change that replaces the one occurrence of ``old``."""

    def change(files: Files) -> None:
        text = files[file].decode()
        assert text.count(old) == 1, f"{old!r} must occur once, but occurs {text.count(old)} times"
        files[file] = text.replace(old, new).encode()

    return change


_LAUGHS = '<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]><fmiModelDescription fmiVersion="2.0"'
_OUTPUT_V = '<Unknown index="6" dependencies=""/>'
_FORCE = 'name="force" valueReference="0" causality="input"'
_ENERGY = 'valueReference="8" causality="output" variability="continuous" initial="calculated"'
_STIFFNESS = 'name="stiffness" valueReference="1" causality="parameter" variability="fixed"'

# name, rule, old text, new text
REPLACEMENTS: list[tuple[str, str, str, str]] = [
    ("doctype", "xml.doctype", '<fmiModelDescription fmiVersion="2.0"', _LAUGHS),
    ("external entity", "xml.doctype", '<fmiModelDescription fmiVersion="2.0"',
     '<!DOCTYPE x SYSTEM "file:///etc/passwd"><fmiModelDescription fmiVersion="2.0"'),
    ("not closed", "xml.malformed", "</ModelStructure>", ""),
    ("encoding", "xml.encoding", 'encoding="UTF-8"', 'encoding="ISO-8859-1"'),
    ("unknown attribute", "schema.invalid", 'modelName="MassSpring"', 'modelName="MassSpring" colour="red"'),
    ("unknown causality", "schema.invalid", _FORCE, _FORCE.replace("input", "entrance")),
    ("no guid", "schema.invalid", ' guid="{7d1c6f0a-94e5-4a53-b1ce-0d6c3f4f8a11}"', ""),
    ("start no number", "schema.invalid", 'start="40"', 'start="forty"'),
    ("version 2.5", "model.fmi-version", 'fmiVersion="2.0"', 'fmiVersion="2.5"'),
    ("empty guid", "model.guid", "{7d1c6f0a-94e5-4a53-b1ce-0d6c3f4f8a11}", ""),
    ("date without Z", "model.date", "2024-01-01T00:00:00Z", "2024-01-01T00:00:00"),
    ("date with offset", "model.date", "2024-01-01T00:00:00Z", "2024-01-01T00:00:00.5+01:00"),
    ("identifier", "model.identifier", 'modelIdentifier="MassSpring"', 'modelIdentifier="Mass-Spring"'),
    ("serialise only", "model.capability", 'canGetAndSetFMUstate="true"', 'canGetAndSetFMUstate="false"'),
    ("log category twice", "model.log-category", '<Category name="logStatusError"/>',
     '<Category name="logStatusError"/><Category name="logStatusError"/>'),
    ("stop before start", "model.experiment", 'stopTime="0.5"', 'stopTime="-2"'),
    ("step negative", "model.experiment", 'stepSize="0.01"', 'stepSize="-0.01"'),
    ("stop at infinity", "model.experiment", 'stopTime="0.5"', 'stopTime="INF"'),
    ("tolerance zero", "model.experiment", 'tolerance="1e-6"', 'tolerance="0"'),
    ("type name is a variable", "type.name", '<SimpleType name="Position">',
     '<SimpleType name="mass"><Real/></SimpleType><SimpleType name="Position">'),
    ("type unit", "type.unit", 'quantity="Position" unit="m"', 'quantity="Position" unit="metre"'),
    ("type bounds", "type.bounds", 'min="-10" max="10"', 'min="10" max="-10"'),
    ("enumeration item twice", "type.enumeration", '<Item name="automatic" value="3"/>',
     '<Item name="automatic" value="2"/>'),
    ("unit twice", "unit.name", '<Unit name="s"><BaseUnit s="1"/></Unit>',
     '<Unit name="s"><BaseUnit s="1"/></Unit><Unit name="s"><BaseUnit s="1"/></Unit>'),
    ("unit factor", "unit.factor", 'factor="1000"', 'factor="0"'),
    ("display unit the wrong way round", "unit.conversion", 'factor="1000"', 'factor="0.001"'),
    ("unit exponents", "unit.exponents", '<BaseUnit kg="1" m="2" s="-2"/>', '<BaseUnit kg="1" m="2" s="-3"/>'),
    ("name twice", "variable.name-duplicate", 'name="damping"', 'name="stiffness"'),
    ("name not structured", "variable.name-structured", 'name="stiffness"', 'name="spring stiffness"'),
    ("name with a line feed", "variable.name-structured", 'name="stiffness"', 'name="spring&#10;stiffness"'),
    ("continuous parameter", "variable.causality-variability", _STIFFNESS, _STIFFNESS.replace("fixed", "continuous")),
    ("calculated parameter", "variable.initial", 'variability="fixed" initial="exact" description="the mass"',
     'variability="fixed" initial="approx" description="the mass"'),
    ("continuous Integer", "variable.continuous-not-real",
     'name="steps" valueReference="0" causality="output" variability="discrete"',
     'name="steps" valueReference="0" causality="output" variability="continuous"'),
    ("two independent", "variable.independent", 'name="position.copy" valueReference="4" causality="local" '
     'variability="continuous" initial="calculated"\n        description="alias of x"><Real declaredType="Position"/>',
     'name="time2" valueReference="9" causality="independent" variability="continuous"><Real unit="s"/>'),
    ("no start", "variable.start-missing", '<Real unit="N/m" start="40" min="0"/>', '<Real unit="N/m" min="0"/>'),
    ("input without start", "variable.start-missing", 'start="0" min="-1000"', 'min="-1000"'),
    ("start of a calculated output", "variable.start-forbidden", '<Real unit="J" min="0"/>',
     '<Real unit="J" min="0" start="1"/>'),
    ("start below min", "variable.start-range", 'start="40" min="0"', 'start="-40" min="0"'),
    ("start no item", "variable.start-range", 'declaredType="Mode" start="2"', 'declaredType="Mode" start="7"'),
    ("min above max", "variable.bounds", 'min="-1000" max="1000"', 'min="1000" max="-1000"'),
    ("wider than its type", "variable.bounds-exceed-type", 'declaredType="Position" start="0.1"',
     'declaredType="Position" start="0.1" max="20"'),
    ("nominal zero", "variable.nominal", 'nominal="10"', 'nominal="0"'),
    ("start infinite", "variable.not-finite", 'start="40" min="0"', 'start="INF" min="0"'),
    ("no such type", "variable.declared-type", 'declaredType="Mode"', 'declaredType="Modus"'),
    ("type of another kind", "variable.declared-type", 'declaredType="Mode"', 'declaredType="Position"'),
    ("no such unit", "variable.unit", 'unit="N/m" start', 'unit="N/mm" start'),
    ("no such display unit", "variable.display-unit", 'unit="J" min="0"', 'unit="J" displayUnit="kWh" min="0"'),
    ("display unit alone", "variable.display-unit", '<Real unit="s"/>', '<Real displayUnit="s"/>'),
    ("derivative of nothing", "variable.derivative", 'unit="m/s2" derivative="6"', 'unit="m/s2" derivative="60"'),
    ("reinit", "variable.reinit", 'unit="m/s" start="0"', 'unit="m/s" start="0" reinit="true"'),
    ("multiple set", "variable.multiple-set", _FORCE, f'{_FORCE} canHandleMultipleSetPerTimeInstant="true"'),
    ("two settable aliases", "variable.alias-settable", 'name="damping" valueReference="2"',
     'name="damping" valueReference="3"'),
    ("alias in another unit", "variable.alias-unit", 'description="alias of x"><Real declaredType="Position"/>',
     'description="alias of x"><Real/>'),
    ("alias that is constant", "variable.alias-constant",
     'valueReference="4" causality="local" variability="continuous" initial="calculated"\n        '
     'description="alias of x"><Real declaredType="Position"/>',
     'valueReference="4" causality="local" variability="constant"><Real declaredType="Position" start="0.1"/>'),
    ("alias of another variability", "variable.alias-variability",
     'causality="local" variability="continuous" initial="calculated"\n        description="alias of x"',
     'causality="local" variability="discrete" initial="calculated"\n        description="alias of x"'),
    ("index out of range", "structure.index", _OUTPUT_V, '<Unknown index="66" dependencies=""/>'),
    ("output not listed", "structure.outputs", f"      {_OUTPUT_V}\n", ""),
    ("local listed as output", "structure.outputs", _OUTPUT_V, f'{_OUTPUT_V}<Unknown index="7"/>'),
    ("not a derivative", "structure.derivatives", 'unit="m/s2" derivative="6"', 'unit="m/s2"'),
    ("initial unknown missing", "structure.initial-unknowns", '<Unknown index="9" dependencies="2 4 5 6"/>', ""),
    ("initial unknown too many", "structure.initial-unknowns", '<Unknown index="9" dependencies="2 4 5 6"/>',
     '<Unknown index="9" dependencies="2 4 5 6"/><Unknown index="11"/>'),
    ("output twice", "structure.duplicate", _OUTPUT_V, _OUTPUT_V * 2),
    ("initial unknowns unsorted", "structure.order",
     '<Unknown index="12" dependencies=""/>\n      <Unknown index="15" dependencies="6"/>\n    </InitialUnknowns>',
     '<Unknown index="15" dependencies="6"/>\n      <Unknown index="12" dependencies=""/>\n    </InitialUnknowns>'),
    ("dependencies unsorted", "structure.order", 'dependencies="2 4 5 6"', 'dependencies="2 5 4 6"'),
    ("dependency out of range", "structure.dependencies", 'dependencies="2 4 5 6"', 'dependencies="2 4 5 60"'),
    ("dependency on an unknown", "structure.dependencies", 'dependencies="2 4 5 6"', 'dependencies="2 4 5 8"'),
    ("kinds too few", "structure.dependencies-kind", 'dependenciesKind="dependent dependent"/>',
     'dependenciesKind="dependent"/>'),
    ("kinds alone", "structure.dependencies-kind", '<Unknown index="12" dependencies=""/>\n      <Unknown index="15" '
     'dependencies="6"/>\n    </Outputs>',
     '<Unknown index="12" dependenciesKind="dependent"/>\n      <Unknown index="15" '
     'dependencies="6"/>\n    </Outputs>'),
    ("source not there", "file.source-missing", 'canSerializeFMUstate="true"/>',
     'canSerializeFMUstate="true"><SourceFiles><File name="model.c"/></SourceFiles></CoSimulation>'),
]  # fmt: skip


def huge(files: Files) -> None:
    """65 MiB of white space."""
    files[XML] = files[XML].replace(b"<ModelStructure>", b"<ModelStructure>" + b" " * (65 << 20))


def _moved(new: str) -> Callable[[Files], None]:
    def change(files: Files) -> None:
        files[new] = files.pop(LIBRARY)

    return change


def _set(name: str, data: bytes) -> Callable[[Files], None]:
    return lambda files: files.update({name: data})


def _patched(offset: int, data: bytes) -> Callable[[Files], None]:
    def change(files: Files) -> None:
        library = files[LIBRARY]
        files[LIBRARY] = library[:offset] + data + library[offset + len(data) :]

    return change


def windows_library(machine: int = 0x8664) -> bytes:
    """The header of a DLL, with the names that a real one would export."""
    head = b"MZ".ljust(0x3C, b"\0") + struct.pack("<I", 0x40)
    head += b"PE\0\0" + struct.pack("<HHIIIHH", machine, 1, 0, 0, 0, 240, 0x2022)
    return head + b"\0" + b"\0".join(f.encode() for f in FUNCTIONS["2.0"].export_names("CoSimulation")) + b"\0"


def _windows_only(files: Files) -> None:
    del files[LIBRARY]
    files["binaries/win64/MassSpring.dll"] = windows_library()


def _no_library(files: Files) -> None:
    del files[LIBRARY]


def _second_platform(folder: str) -> Callable[[Files], None]:
    return lambda files: files.update({f"binaries/{folder}/MassSpring.so": files[LIBRARY]})


def _undocumented(files: Files) -> None:
    files["documentation/manual.html"] = files.pop("documentation/index.html")


def _no_result(files: Files) -> None:
    del files[RESULT]


_FMI_1 = b"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="1.0" modelName="Old" modelIdentifier="Old" guid="{1}" numberOfContinuousStates="0"
    numberOfEventIndicators="0"><ModelVariables/></fmiModelDescription>
"""
FILE_CHANGES: list[tuple[str, str, Callable[[Files], None]]] = [
    ("FMI 1.0", "model.not-covered", _set(XML, _FMI_1)),
    ("documentation without entry", "file.documentation", _undocumented),
    ("icon", "file.icon", _set("model.png", b"GIF89a")),
    ("manifest without version", "layered.manifest", replacing('fmi-ls:fmi-ls-version="1.0.0-alpha.1"', "", MANIFEST)),
    ("manifest of another", "layered.manifest", replacing('"org.fmi-standard.fmi-ls-ref"',
     '"org.fmi-standard.fmi-ls-xcp"', MANIFEST)),
    ("manifest with entities", "xml.doctype", replacing("<fmiReferences", "<!DOCTYPE x><fmiReferences", MANIFEST)),
    ("role", "layered.role", replacing('role="result"', 'role="outcome"', MANIFEST)),
    ("related file missing", "layered.missing", _no_result),
    ("result column", "layered.result", replacing("time,x,v", "time,x,velocity", RESULT)),
    ("result backwards", "layered.result", replacing("\n0.02,", "\n0.001,", RESULT)),
    ("result off", "reference.result", lambda files: files.update({RESULT: _shifted(files[RESULT])})),
]  # fmt: skip


def _shifted(data: bytes) -> bytes:
    """The result with x larger by 5 mm."""
    head, *rows = data.decode().split()
    moved = [f"{t},{float(x) + 0.005},{v}" for t, x, v in (r.split(",") for r in rows)]
    return "\n".join([head, *moved, ""]).encode()


BINARIES: list[tuple[str, str, Callable[[Files], None]]] = [
    ("none", "binary.none", _no_library),
    ("for Windows only", "binary.not-here", _windows_only),
    ("misnamed", "binary.missing", _moved(LIBRARY.replace("MassSpring.", "libMassSpring."))),
    ("text", "binary.format", _set(LIBRARY, b"#!/bin/sh\necho hello\n")),
    ("DLL in the Linux folder", "binary.format", _set(LIBRARY, windows_library())),
    ("executable", "binary.format", _patched(16, b"\x02\x00")),
    ("for ARM", "binary.architecture", _patched(18, struct.pack("<H", 183))),
    ("32-bit DLL in win64", "binary.architecture", _set("binaries/win64/MassSpring.dll", windows_library(0x14C))),
    ("DLL without functions", "binary.exports", _set("binaries/win64/MassSpring.dll", windows_library()[:0x60])),
    ("folder named as in FMI 3", "binary.folder", _second_platform("x86_64-linux")),
]  # fmt: skip
