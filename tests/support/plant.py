"""FMUs of FMI 2.0 and 3.0 in C, built by the tests: a plant with inputs and parameters of every type (``plant.h``)."""

from collections.abc import Mapping
from pathlib import Path

from orchestrator.checking.binaries import here
from tests.support.c_fmu import SUFFIX, write_fmu
from tests.support.c_library import compile_with_fault

TOKEN = "{plant-of-the-tests}"
Changes = Mapping[str, str]
"""What a description has otherwise, by a word and the name of a variable: ``Output y``, ``flags``, ``step``."""

# name, value reference, type, causality, variability, initial, attributes.
_VARIABLES = """
time   | 12 | Real    | independent         | continuous | -          |
u      | 1  | Real    | input               | continuous | -          | start="0" min="-3" max="3"
w      | 2  | Real    | input               | continuous | -          | start="0"
j      | 22 | Integer | input               | discrete   | -          | start="0" min="-5" max="5"
on     | 31 | Boolean | input               | discrete   | -          | start="false"
k      | 3  | Real    | parameter           | fixed      | exact      | start="4" min="0.1"
d      | 4  | Real    | parameter           | tunable    | exact      | start="0.5" min="0" max="2"
i      | 20 | Integer | parameter           | fixed      | exact      | start="2" min="0" max="9"
m      | 21 | Enumeration | parameter       | fixed      | exact      | start="2" declaredType="Mode"
b      | 30 | Boolean | parameter           | fixed      | exact      | start="true"
l      | 40 | String  | parameter           | fixed      | exact      | start="plant"
r      | 18 | Real    | local               | constant   | exact      | start="9.81"
c      | 5  | Real    | calculatedParameter | fixed      | calculated |
e      | 14 | Real    | calculatedParameter | tunable    | calculated |
x      | 6  | Real    | output              | continuous | exact      | start="0.3" min="-5" max="5" nominal="1"
v      | 7  | Real    | local               | continuous | exact      | start="0" nominal="2" reinit="true"
q      | 13 | Real    | output              | continuous | exact      | start="0"
der(x) | 8  | Real    | local               | continuous | calculated | derivative="x"
der(v) | 9  | Real    | local               | continuous | calculated | derivative="v"
der(q) | 15 | Real    | local               | continuous | calculated | derivative="q"
y      | 10 | Real    | output              | continuous | calculated |
z      | 11 | Real    | output              | continuous | calculated |
ys     | 17 | Real    | output              | continuous | calculated |
o      | 23 | Integer | output              | discrete   | calculated |
g      | 24 | Enumeration | output          | discrete   | calculated | declaredType="Mode"
sw     | 32 | Boolean | output              | discrete   | calculated |
t      | 41 | String  | output              | discrete   | calculated |
n      | 51 | UInt64  | structuralParameter | fixed      | exact      | start="3" min="1" max="8"
p      | 16 | Real    | parameter           | fixed      | exact      | start="1 2 3"
blob   | 50 | Binary  | output              | discrete   | calculated | maxSize="8"
z0     | 70 | Real    | local               | continuous | calculated |
z1     | 71 | Real    | local               | continuous | calculated |
z2     | 72 | Real    | local               | continuous | calculated |
"""
_CLOCKED = """
cc     | 61 | Integer | output              | discrete   | -          | clocks="60"
cu     | 62 | Real    | output              | discrete   | -          | clocks="60"
"""
_NEW = ("n", "p", "blob", "z0", "z1", "z2")
_OUTPUTS = {
    "x": "x", "q": "q", "y": "x u", "z": "v x", "ys": "x", "o": "j", "g": "x", "sw": "", "t": "", "blob": "",
}  # fmt: skip
_RATES = {"der(x)": "v", "der(v)": "u w x v j on", "der(q)": "u"}
_RATE_KINDS = {"der(x)": "constant", "der(q)": "constant"}
_INITIAL = {
    "c": "k", "e": "d", "y": "x u", "z": "v x", "ys": "x p", "o": "j", "g": "x", "sw": "", "t": "l", "blob": "",
    "der(x)": "v", "der(v)": "u w x v k d i m b j on", "der(q)": "u",
}  # fmt: skip
_TYPES = {
    "2.0": '<SimpleType name="Mode"><Enumeration><Item name="off" value="1"/><Item name="on" value="2"/>'
    '<Item name="auto" value="3"/></Enumeration></SimpleType>',
    "3.0": '<EnumerationType name="Mode"><Item name="off" value="1"/><Item name="on" value="2"/>'
    '<Item name="auto" value="3"/></EnumerationType>',
}
_FLAGS = {
    "2.0": 'canGetAndSetFMUstate="true" canSerializeFMUstate="true"',
    "3.0": 'canGetAndSetFMUState="true" canSerializeFMUState="true"',
}
_NAMES = {"Real": "Float64", "Integer": "Int32"}


def compile_plant(version: str, fault: str = "") -> bytes:
    """Compile the library of a version of FMI with a fault (empty: none)."""
    return compile_with_fault(f"plant{version[0]}.c", fault)


def describe(version: str, interfaces: str = "CS", changes: Changes | None = None) -> str:
    """The modelDescription.xml.

    Args:
        interfaces: ``CS``, ``ME`` or ``CS ME``.
        changes: what is otherwise than in the correct one.
    """
    changes = changes or {}
    clocked = "clock" in changes
    rows = [
        [cell.strip() for cell in line.split("|")]
        for line in (_VARIABLES + (_CLOCKED if clocked else "")).splitlines()
        if line
    ]
    rows = [row for row in rows if version == "3.0" or row[0] not in _NEW]
    position = {row[0]: str(n) for n, row in enumerate(rows, 1)}
    number = position if version == "2.0" else {row[0]: row[1] for row in rows}
    variables = [_variable(version, row, number, changes, "ME" in interfaces) for row in rows]
    if clocked:
        attributes = 'causality="input" intervalVariability="constant" intervalDecimal="0.1" shiftDecimal="0.05"'
        more = ' supportsFraction="true" resolution="10" intervalCounter="1" shiftCounter="0"'
        attributes += more if changes["clock"] == "fraction" else ""
        variables.append(f'<Clock name="tick" valueReference="60" {attributes}/>')
    flags = f"{_FLAGS[version]} {changes.get('flags', '')}"
    steps = 'canHandleVariableCommunicationStepSize="true"' if "fixed steps" not in changes else ""
    found = {
        "CS": f'<CoSimulation modelIdentifier="Plant" {flags} {steps} {changes.get("step flags", "")} '
        f"{'hasEventMode=' + chr(34) + 'true' + chr(34) if clocked else ''}/>",
        "ME": f'<ModelExchange modelIdentifier="Plant" {flags}/>',
    }
    order = ["ME", "CS"]
    head = {
        "2.0": f'fmiVersion="2.0" guid="{TOKEN}" numberOfEventIndicators="3"',
        "3.0": f'fmiVersion="3.0" instantiationToken="{TOKEN}"',
    }
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription modelName="Plant" generationTool="tests" generationDateAndTime="2024-01-01T00:00:00Z" {head[version]}>
  {" ".join(found[i] for i in order if i in interfaces.split())}
  <TypeDefinitions>{_TYPES[version]}</TypeDefinitions>
  <LogCategories><Category name="logStatusError"/><Category name="logAll"/></LogCategories>
  <DefaultExperiment startTime="0" stopTime="{changes.get("stop", "3")}" stepSize="{changes.get("step", "0.03")}"/>
  <ModelVariables>
    {chr(10).join(variables)}
  </ModelVariables>
  <ModelStructure>
    {_structure(version, number, changes)}
  </ModelStructure>
</fmiModelDescription>
"""  # noqa: E501


def _variable(version: str, row: list[str], number: Mapping[str, str], changes: Changes, exchange: bool) -> str:
    name, reference, kind, causality, variability, initial, attributes = row
    attributes = changes.get(f"attributes {name}", attributes)
    if "reinit" in attributes and not exchange:
        attributes = attributes.replace('reinit="true"', "")
    for other in ("x", "v", "q"):
        attributes = attributes.replace(f'derivative="{other}"', f'derivative="{number[other]}"')
    causality = f'causality="{causality}" variability="{variability}"'
    head = f'name="{name}" valueReference="{reference}" {causality}' + (
        f' initial="{initial}"' if initial != "-" else ""
    )
    if version == "2.0":
        return f"<ScalarVariable {head}><{kind} {attributes}/></ScalarVariable>"
    kind = _NAMES.get(kind, kind)
    inner = ""
    if kind == "String" and "start" in attributes:
        attributes, inner = "", '<Start value="plant"/>'
    if name == "p":
        inner = '<Dimension valueReference="51"/>'
    return f"<{kind} {head} {attributes}>{inner}</{kind}>"


def _structure(version: str, number: Mapping[str, str], changes: Changes) -> str:
    outputs = _OUTPUTS | ({"cc": "", "cu": ""} if "clock" in changes else {})
    lists = {
        "Output": (outputs, {}), "Derivative": (_RATES, _RATE_KINDS), "Initial": (_INITIAL, {}),
    }  # fmt: skip
    parts = []
    for section, (entries, kinds) in lists.items():
        found = []
        names = [name for name in entries if name in number]
        for name in sorted(names, key=lambda n: int(number[n])) if version == "2.0" else names:
            found.append(_entry(version, section, name, (entries[name], kinds.get(name, "")), number, changes))
        tag = {"Output": "Outputs", "Derivative": "Derivatives", "Initial": "InitialUnknowns"}[section]
        parts.append(f"<{tag}>{''.join(found)}</{tag}>" if version == "2.0" else "\n".join(found))
    if version == "3.0":
        for z in ("z0", "z1", "z2"):
            knowns = changes.get(f"Indicator {z}")
            listed = "" if knowns is None else f'dependencies="{" ".join(number[k] for k in knowns.split())}"'
            parts.append(f'<EventIndicator valueReference="{number[z]}" {listed}/>')
    return "\n".join(parts)


def _entry(
    version: str, section: str, name: str, declared: tuple[str, str], number: Mapping[str, str], changes: Changes
) -> str:
    text = changes.get(f"{section} {name}", declared[0])
    kinds = changes.get(f"{section} kinds {name}", declared[1])
    known = [other for other in text.split() if other in number]
    listed = sorted(zip(known, kinds.split() or [""] * len(known), strict=True), key=lambda pair: int(number[pair[0]]))
    attributes = f'dependencies="{" ".join(number[other] for other, _ in listed)}"'
    attributes = "" if text == "-" else attributes
    if kinds and text != "-":
        attributes += f' dependenciesKind="{" ".join(kind for _, kind in listed)}"'
    tag = {"Output": "Output", "Derivative": "ContinuousStateDerivative", "Initial": "InitialUnknown"}[section]
    key = "index" if version == "2.0" else "valueReference"
    return f'<{"Unknown" if version == "2.0" else tag} {key}="{number[name]}" {attributes}/>'


def build_plant(
    path: Path, version: str, interfaces: str = "CS", fault: str = "", changes: Changes | None = None
) -> Path:
    """Build an FMU at ``path`` and return it."""
    folder = here(version)  # type: ignore[arg-type]
    return write_fmu(
        path,
        {
            "modelDescription.xml": describe(version, interfaces, changes).encode(),
            f"binaries/{folder}/Plant{SUFFIX}": compile_plant(version, fault),
            "documentation/index.html": b"<!DOCTYPE html><title>Plant</title><p>A plant.</p>\n",
            "documentation/licenses/license.txt": b"free\n",
        },
    )
