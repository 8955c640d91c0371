"""A co-simulation FMU of FMI 3.0 in C with time events and a clock that it times itself, built by the tests."""

import zipfile
from pathlib import Path

import fmpy

from tests.support.c_library import compile_source

LIBRARY = f"binaries/{fmpy.platform_tuple}/Events{fmpy.sharedLibraryExtension}"
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Events" instantiationToken="{events}">
  <CoSimulation modelIdentifier="Events" canHandleVariableCommunicationStepSize="true" hasEventMode="true" ATTRIBUTES/>
  <ModelVariables>
    <Float64 name="x" valueReference="0" causality="output"/>
    <Int32 name="n" valueReference="1" causality="output"/>
    <Int32 name="d" valueReference="2" causality="input" start="0"/>
    <Int32 name="e" valueReference="3" causality="output"/>
    <Clock name="later" valueReference="4" causality="input" intervalVariability="VARIABILITY"/>
    <Int32 name="k" valueReference="5" causality="output"/>
    <Float64 name="cu" valueReference="6" causality="input" variability="discrete" start="0" clocks="4"/>
    <Float64 name="cy" valueReference="7" causality="output" variability="discrete" clocks="4"/>
    <Float64 name="time" valueReference="8" causality="independent"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="0" dependencies=""/><Output valueReference="1" dependencies=""/>
    <Output valueReference="3" dependencies=""/><Output valueReference="5" dependencies=""/>
    <Output valueReference="7" dependencies="6"/>
  </ModelStructure>
</fmiModelDescription>
"""


def build_event3_fmu(folder: Path, *macros: str, clock: str = "countdown", saves: bool = True, more: str = "") -> Path:
    """Compile the FMU into ``folder`` and return its path.

    Args:
        folder: where to.
        macros: of ``event3_fmu.c``.
        clock: kind of the clock ``later``: "countdown", "changing" or "fixed".
        saves: whether it declares that it saves its state.
        more: attributes of the element CoSimulation.
    """
    kind = {"countdown": "d", "changing": "c", "fixed": "f"}[clock]
    attributes = f'canGetAndSetFMUState="{str(saves).lower()}" {more}'
    path = folder / "Events.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "modelDescription.xml", DESCRIPTION.replace("ATTRIBUTES", attributes).replace("VARIABILITY", clock)
        )
        archive.writestr(LIBRARY, compile_source("event3_fmu.c", f"KIND='{kind}'", *macros))
    return path
