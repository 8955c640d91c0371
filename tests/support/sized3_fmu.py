"""A co-simulation FMU of FMI 3.0 in C whose arrays have the size of a structural parameter, built by the tests."""

import subprocess
import zipfile
from pathlib import Path

import fmpy

HERE = Path(__file__).parent
LIBRARY = f"binaries/{fmpy.platform_tuple}/Sized{fmpy.sharedLibraryExtension}"
SIZE = '<Dimension valueReference="1"/>'
DESCRIPTION = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Sized" instantiationToken="{{sized}}">
  <CoSimulation modelIdentifier="Sized" canHandleVariableCommunicationStepSize="true"/>
  <ModelVariables>
    <UInt64 name="size" valueReference="1" causality="structuralParameter" start="2" min="1" max="8"/>
    <Float64 name="u" valueReference="2" causality="input" start="0 0">{SIZE}</Float64>
    <Float64 name="p" valueReference="3" causality="parameter" variability="fixed" start="1 2">{SIZE}</Float64>
    <Float64 name="y" valueReference="4" causality="output">{SIZE}</Float64>
  </ModelVariables>
  <ModelStructure><Output valueReference="4" dependencies=""/></ModelStructure>
</fmiModelDescription>
"""


def build_sized3_fmu(folder: Path) -> Path:
    """Compile the FMU into ``folder`` and return its path."""
    library = folder / Path(LIBRARY).name
    headers = Path(fmpy.__file__).parent / "c-code"
    command = ["cc", "-shared", "-fPIC", "-w", "-I", str(headers), str(HERE / "sized3_fmu.c"), "-o", str(library)]
    subprocess.run(command, check=True, capture_output=True)
    path = folder / "Sized.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION)
        archive.write(library, LIBRARY)
    return path
