"""A co-simulation FMU of FMI 3.0 in C with variables of every numeric type and arrays, built by the tests."""

import zipfile
from pathlib import Path

import fmpy

from tests.support.c_library import compile_source

LIBRARY = f"binaries/{fmpy.platform_tuple}/Typed{fmpy.sharedLibraryExtension}"
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Typed" instantiationToken="{typed}">
  <CoSimulation modelIdentifier="Typed" canHandleVariableCommunicationStepSize="true" ATTRIBUTES/>
  <TypeDefinitions><EnumerationType name="Three">
    <Item name="one" value="1"/><Item name="two" value="2"/><Item name="three" value="3"/>
  </EnumerationType></TypeDefinitions>
  <ModelVariables>
    <Float64 name="u" valueReference="0" causality="input" start="0"><Dimension start="2"/></Float64>
    <Int8 name="n" valueReference="1" causality="input" start="0"/>
    <UInt64 name="w" valueReference="2" causality="input" start="0"/>
    <Float32 name="f" valueReference="3" causality="input" start="0"/>
    <Boolean name="b" valueReference="4" causality="input" start="false"/>
    <Enumeration name="e" valueReference="5" causality="input" declaredType="Three" start="1"/>
    <Int16 name="s" valueReference="6" causality="input" start="0"/>
    <UInt16 name="h" valueReference="7" causality="input" start="0"/>
    <Float64 name="y" valueReference="10" causality="output"><Dimension start="2"/></Float64>
    <Int8 name="m" valueReference="11" causality="output"/>
    <UInt64 name="k" valueReference="12" causality="output"/>
    <Float32 name="g" valueReference="13" causality="output" variability="discrete"/>
    <Boolean name="c" valueReference="14" causality="output"/>
    <Enumeration name="r" valueReference="15" causality="output" declaredType="Three"/>
    <Int16 name="d" valueReference="16" causality="output"/>
    <UInt16 name="o" valueReference="17" causality="output"/>
    <Float64 name="p" valueReference="20" causality="parameter" start="1 2 3"><Dimension start="3"/></Float64>
    <String name="label" valueReference="21" causality="parameter"><Start value="none"/></String>
    <Float64 name="time" valueReference="30" causality="independent"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="10" dependencies=""/><Output valueReference="11" dependencies=""/>
    <Output valueReference="12" dependencies=""/><Output valueReference="13" dependencies=""/>
    <Output valueReference="14" dependencies=""/><Output valueReference="15" dependencies=""/>
    <Output valueReference="16" dependencies=""/><Output valueReference="17" dependencies=""/>
  </ModelStructure>
</fmiModelDescription>
"""


def build_typed3_fmu(folder: Path, *macros: str, saves: bool = True, attributes: str = "") -> Path:
    """Compile the FMU into ``folder`` and return its path.

    Args:
        folder: where to.
        macros: of ``typed3_fmu.c``, such as ``WARNS_FROM=0.5``.
        saves: whether it declares that it saves its state.
        attributes: more of the element CoSimulation.
    """
    path = folder / "Typed.fmu"
    text = DESCRIPTION.replace("ATTRIBUTES", f'canGetAndSetFMUState="{str(saves).lower()}" {attributes}')
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        archive.writestr(LIBRARY, compile_source("typed3_fmu.c", *macros))
    return path
