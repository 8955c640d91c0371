"""A clocked system of FMI 3.0 in C: plant, controller and supervisor, for co-simulation and model exchange."""

import subprocess
import zipfile
from pathlib import Path

import fmpy

HERE = Path(__file__).parent
NAMES = ("Plant", "Controller", "Supervisor")
VARIABLES = {
    "Plant": """
    <Float64 name="x" valueReference="1" causality="output"/>
    <Float64 name="u" valueReference="2" causality="input" variability="discrete" start="0"/>
    <Float64 name="der(x)" valueReference="3" derivative="1"/>""",
    "Controller": """
    <Clock name="r" valueReference="1" causality="input" intervalVariability="constant" intervalDecimal="0.1"/>
    <Float64 name="a" valueReference="2" causality="input" variability="discrete" start="1" clocks="4"/>
    <Float64 name="u" valueReference="3" causality="output" variability="discrete" clocks="1"/>
    <Clock name="s" valueReference="4" causality="input" intervalVariability="triggered"/>""",
    "Supervisor": """
    <Float64 name="x" valueReference="1" causality="input" start="0" intermediateUpdate="true"/>
    <Clock name="s" valueReference="2" causality="output" intervalVariability="triggered"/>
    <Float64 name="a" valueReference="3" causality="output" variability="discrete" clocks="2"/>""",
}
STRUCTURE = {
    "Plant": '<Output valueReference="1" dependencies=""/><ContinuousStateDerivative valueReference="3"/>',
    "Controller": '<Output valueReference="3" dependencies="2"/>',
    "Supervisor": '<Output valueReference="2"/><Output valueReference="3" dependencies=""/>',
}
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="NAME" instantiationToken="{clocked}">
  <ModelExchange modelIdentifier="NAME" canGetAndSetFMUState="true" MORE/>
  <CoSimulation modelIdentifier="NAME" canGetAndSetFMUState="true" canHandleVariableCommunicationStepSize="true"
    hasEventMode="true" providesIntermediateUpdate="true" MORE/>
  <ModelVariables>VARIABLES
    <Float64 name="time" valueReference="9" causality="independent"/>
  </ModelVariables>
  <ModelStructure>STRUCTURE</ModelStructure>
</fmiModelDescription>
"""


def build_clocked_fmus(folder: Path, *macros: str, more: str = "") -> dict[str, Path]:
    """Compile the FMUs into ``folder`` and return their paths by name.

    Args:
        folder: where to.
        macros: of the supervisor in ``clocked_fmus.c``.
        more: attributes of the interfaces.
    """
    found = {}
    for name in NAMES:
        library = folder / f"{name}{fmpy.sharedLibraryExtension}"
        include = str(Path(fmpy.__file__).parent / "c-code")
        options = [f"-D{macro}" for macro in (name.upper(), *(macros if name == "Supervisor" else ()))]
        source = str(HERE / "clocked_fmus.c")
        command = ["cc", "-shared", "-fPIC", "-w", "-I", include, *options, source, "-o", str(library), "-lm"]
        subprocess.run(command, check=True, capture_output=True)
        text = DESCRIPTION.replace("STRUCTURE", STRUCTURE[name]).replace("VARIABLES", VARIABLES[name])
        found[name] = folder / f"{name}.fmu"
        with zipfile.ZipFile(found[name], "w") as archive:
            archive.writestr("modelDescription.xml", text.replace("NAME", name).replace("MORE", more))
            archive.write(library, f"binaries/{fmpy.platform_tuple}/{library.name}")
    return found
