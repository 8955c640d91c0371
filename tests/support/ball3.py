"""FMUs of FMI 3.0 written in C and built by the tests: a ball that bounces, correct or with one fault."""

from pathlib import Path

from orchestrator.checking.binaries import here
from tests.support.c_fmu import SUFFIX, write_fmu
from tests.support.c_library import compile_source

HERE = Path(__file__).parent
LIBRARY = f"binaries/{here('3.0')}/Ball{SUFFIX}"
REFERENCE = "extra/org.fmi-standard.fmi-ls-ref"
XML = "modelDescription.xml"
TERMINALS = "terminalsAndIcons/terminalsAndIcons.xml"
BUILD = "sources/buildDescription.xml"
MANIFEST = f"{REFERENCE}/fmi-ls-manifest.xml"
INTERFACES = {
    "CoSimulation": "",
    "ModelExchange": '<ModelExchange modelIdentifier="Ball" canGetAndSetFMUState="true" canSerializeFMUState="true"/>',
    "ScheduledExecution": '<ScheduledExecution modelIdentifier="Ball" canGetAndSetFMUState="true"/>',
}
_TERMINALS = """<?xml version="1.0" encoding="UTF-8"?>
<fmiTerminalsAndIcons fmiVersion="3.0">
  <GraphicalRepresentation>
    <CoordinateSystem x1="-100" y1="-100" x2="100" y2="100" suggestedScalingFactorTo_mm="0.1"/>
    <Icon x1="-100" y1="-100" x2="100" y2="100"/>
  </GraphicalRepresentation>
  <Terminals>
    <Terminal name="flange" matchingRule="plug" terminalKind="org.example.flange">
      <TerminalMemberVariable variableName="x" memberName="x" variableKind="signal"/>
      <TerminalMemberVariable variableName="v" memberName="v" variableKind="signal"/>
      <TerminalGraphicalRepresentation x1="-10" y1="-10" x2="10" y2="10" iconBaseName="flange"/>
    </Terminal>
    <Terminal name="drive" matchingRule="sequence">
      <TerminalMemberVariable variableName="u" variableKind="inflow"/>
      <TerminalStreamMemberVariable inStreamMemberName="a" outStreamMemberName="b"
          inStreamVariableName="g" outStreamVariableName="e"/>
    </Terminal>
  </Terminals>
</fmiTerminalsAndIcons>
"""
_BUILD = """<?xml version="1.0" encoding="UTF-8"?>
<fmiBuildDescription fmiVersion="3.0">
  <BuildConfiguration modelIdentifier="Ball">
    <SourceFileSet language="C11">
      <SourceFile name="ball.c"/>
      <IncludeDirectory name="include"/>
    </SourceFileSet>
    <Library name="m"/>
  </BuildConfiguration>
</fmiBuildDescription>
"""
_MANIFEST = """<?xml version="1.0" encoding="UTF-8"?>
<fmiReferences xmlns:fmi-ls="http://fmi-standard.org/fmi-ls-manifest"
    fmi-ls:fmi-ls-name="org.fmi-standard.fmi-ls-ref" fmi-ls:fmi-ls-version="1.0.0-alpha.1"
    fmi-ls:fmi-ls-description="Layered Standard providing information on related files included in an FMU.">
  <Related type="text/csv" source="Ball_out.csv" role="result" description="Output of the default experiment"/>
</fmiReferences>
"""
_PNG = b"\x89PNG\r\n\x1a\n"


def model_description(interface: str = "CoSimulation") -> str:
    """The modelDescription.xml of the correct FMU with one interface."""
    text = (HERE / "ball3.xml").read_text(encoding="utf-8")
    if not INTERFACES[interface]:
        return text
    begin = text.index("  <CoSimulation")
    end = text.index("  <UnitDefinitions>")
    return f"{text[:begin]}  {INTERFACES[interface]}\n{text[end:]}"


def compile_library(fault: str = "") -> bytes:
    """Compile ``ball3.c`` with a fault (empty: none; "hostile": what resources/hostile.txt says)."""
    macros = ("HOSTILE", "_GNU_SOURCE") if fault == "hostile" else (f"FAULT_{fault}",) if fault else ()
    return compile_source("ball3.c", *macros)


def reference() -> str:
    """The default experiment as CSV, from the closed form of the motion; the array stands in one cell."""
    lines = ["time,x,v,bounces,title,q"]
    x, v, t, bounces, g, e = 1.0, 0.0, 0.0, 0, 9.81, 0.7
    for k in range(61):
        end = 0.02 * k
        while True:
            flight = (v + (v * v + 2.0 * g * x) ** 0.5) / g
            if t + flight > end:
                break
            v, x, t, bounces = (g * flight - v) * e, 0.0, t + flight, bounces + 1
        h = end - t
        x, v, t = x + v * h - 0.5 * g * h * h, v - g * h, end
        lines.append(f"{end:.12g},{x:.12g},{v:.12g},{bounces},ball,2 4 6")
    return "\n".join(lines) + "\n"


def ball_files(fault: str = "", interface: str = "CoSimulation") -> dict[str, bytes]:
    """The files of the FMU by their path in the archive."""
    return {
        XML: model_description(interface).encode(),
        LIBRARY: compile_library(fault),
        TERMINALS: _TERMINALS.encode(),
        "terminalsAndIcons/icon.png": _PNG,
        "terminalsAndIcons/flange.png": _PNG,
        BUILD: _BUILD.encode(),
        "sources/ball.c": b"int ball;\n",
        "sources/include/ball.h": b"\n",
        "resources/readme.txt": b"nothing is needed here\n",
        "documentation/index.html": b"<!DOCTYPE html><title>Ball</title><p>A ball.</p>\n",
        "documentation/licenses/license.txt": b"free\n",
        MANIFEST: _MANIFEST.encode(),
        f"{REFERENCE}/Ball_out.csv": reference().encode(),
    }


def build_ball(folder: Path, fault: str = "", interface: str = "CoSimulation") -> Path:
    """Build the FMU into ``folder`` and return its path."""
    return write_fmu(folder / f"{fault or 'Ball'}.fmu", ball_files(fault, interface))
