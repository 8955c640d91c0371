"""FMUs for model exchange alone: one in C, built by the tests, and any FMU without its other interfaces."""

import re
import zipfile
from pathlib import Path

import fmpy

from tests.support.c_library import compile_source

DESCRIPTION2 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Ball" guid="{ball}" numberOfEventIndicators="1">
  <ModelExchange modelIdentifier="Ball" canGetAndSetFMUstate="SAVES" MORE/>
  <ModelVariables>
    <ScalarVariable name="h" valueReference="1" causality="output" initial="exact"><Real start="1"/></ScalarVariable>
    <ScalarVariable name="v" valueReference="2" causality="output" initial="exact"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="u" valueReference="3" causality="input"><Real start="0"/></ScalarVariable>
    <ScalarVariable name="y" valueReference="4" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="der(h)" valueReference="5"><Real derivative="1"/></ScalarVariable>
    <ScalarVariable name="der(v)" valueReference="6"><Real derivative="2"/></ScalarVariable>
    <ScalarVariable name="n" valueReference="10" causality="output" variability="discrete"><Integer/></ScalarVariable>
    <ScalarVariable name="d" valueReference="11" causality="input" variability="discrete"><Integer start="0"/>
    </ScalarVariable>
    <ScalarVariable name="e" valueReference="12" causality="output" variability="discrete"><Integer/></ScalarVariable>
    <ScalarVariable name="s" valueReference="13" causality="output" variability="discrete"><Integer/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="1" dependencies=""/><Unknown index="2" dependencies=""/>
      <Unknown index="4" dependencies="1 3"/><Unknown index="7" dependencies=""/><Unknown index="9" dependencies=""/>
      <Unknown index="10" dependencies=""/></Outputs>
    <Derivatives><Unknown index="5" dependencies="2"/><Unknown index="6" dependencies="3"/></Derivatives>
  </ModelStructure>
</fmiModelDescription>
"""
DESCRIPTION3 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Ball" instantiationToken="{ball}">
  <ModelExchange modelIdentifier="Ball" canGetAndSetFMUState="SAVES" needsCompletedIntegratorStep="true" MORE/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent"/>
    <Float64 name="h" valueReference="1" causality="output" initial="exact" start="1"/>
    <Float64 name="v" valueReference="2" causality="output" initial="exact" start="0"/>
    <Float64 name="u" valueReference="3" causality="input" start="0"/>
    <Float64 name="y" valueReference="4" causality="output"/>
    <Float64 name="der(h)" valueReference="5" derivative="1"/><Float64 name="der(v)" valueReference="6" derivative="2"/>
    <Int32 name="n" valueReference="10" causality="output"/>
    <Int32 name="d" valueReference="11" causality="input" start="0"/>
    <Int32 name="e" valueReference="12" causality="output"/><Int32 name="s" valueReference="13" causality="output"/>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="1" dependencies=""/><Output valueReference="2" dependencies=""/>
    <Output valueReference="4" dependencies="1 3"/><Output valueReference="10" dependencies=""/>
    <Output valueReference="12" dependencies=""/><Output valueReference="13" dependencies=""/>
    <ContinuousStateDerivative valueReference="5"/><ContinuousStateDerivative valueReference="6"/>
    <EventIndicator valueReference="1"/>
  </ModelStructure>
</fmiModelDescription>
"""


def build_exchange_fmu(folder: Path, version: int, *macros: str, saves: bool = True, more: str = "") -> Path:
    """Compile the ball of ``exchange_fmu.c`` into ``folder`` and return its path.

    Args:
        folder: where to.
        version: of FMI, 2 or 3.
        macros: of ``exchange_fmu.c``.
        saves: whether it declares that it saves its state.
        more: attributes of the element ModelExchange.
    """
    platform = fmpy.platform if version == 2 else fmpy.platform_tuple
    library = compile_source("exchange_fmu.c", f"FMI={version}", *macros)
    text = (DESCRIPTION2 if version == 2 else DESCRIPTION3).replace("SAVES", str(saves).lower()).replace("MORE", more)
    path = folder / "Ball.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", text)
        archive.writestr(f"binaries/{platform}/Ball{fmpy.sharedLibraryExtension}", library)
    return path


def exchange_only(fmu: Path, target: Path) -> Path:
    """Write an FMU without its interface for co-simulation to ``target``, and return that."""
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(target, "w") as archive:
        for item in source.infolist():
            data = source.read(item)
            if item.filename == "modelDescription.xml":
                data = re.sub(rb"<CoSimulation\b(?:[^>]*?/>|.*?</CoSimulation>)", b"", data, flags=re.DOTALL)
            archive.writestr(item, data)
    return target
