"""A co-simulation FMU in C whose answers a test chooses: warnings, discarded steps, an early end, a step of its own."""

import zipfile
from pathlib import Path

from tests.support.c_library import compile_source

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Answers" guid="{{answers}}" generationTool="by hand"
    generationDateAndTime="2026-01-01T00:00:00Z" variableNamingConvention="flat" numberOfEventIndicators="0">
  <CoSimulation modelIdentifier="Answers" {attributes}/>
  {units}
  <ModelVariables>{variables}
  </ModelVariables>
  <ModelStructure>
    <Outputs><Unknown index="2" dependencies=""/><Unknown index="5" dependencies=""/></Outputs>
    <InitialUnknowns><Unknown index="2"/><Unknown index="5"/></InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""


UNITS = """<UnitDefinitions><Unit name="K"><BaseUnit K="1"/></Unit>
  <Unit name="mK"><BaseUnit K="1" factor="0.001"/></Unit>
  <Unit name="degC"><BaseUnit K="1" offset="273.15"/><DisplayUnit name="degF" factor="1.8" offset="32"/></Unit>
  </UnitDefinitions>"""


def _variable(
    reference: int, name: str, causality: str, variability: str, kind: str, start: str | None, more: str = ""
) -> str:
    given = ("" if start is None else f' start="{start}"') + more
    attributes = f'name="{name}" valueReference="{reference}" causality="{causality}" variability="{variability}"'
    return f"\n    <ScalarVariable {attributes}><{kind}{given}/></ScalarVariable>"


def build_answers_fmu(
    folder: Path,
    *macros: str,
    saves: bool = False,
    varies: bool = True,
    parameters: bool = False,
    more: str = "",
    unit: str | None = None,
    relative: bool = False,
    name: str = "Answers",
) -> Path:
    """Compile the FMU into ``folder`` and return its path.

    Args:
        folder: where to.
        macros: of ``answers_fmu.c``, such as ``WARNS_FROM=0.5``.
        saves, varies: capabilities that it declares: it saves its state, it takes steps of any length.
        parameters: whether ``mode`` (Integer) and ``on`` (Boolean) are fixed parameters, not inputs.
        more: attributes of CoSimulation.
        unit: of ``u``, ``x`` and ``gain``: "K", "mK", "degC" or none.
        relative: whether these are differences.
        name: stem of the file.
    """
    attributes = f'canHandleVariableCommunicationStepSize="{str(varies).lower()}" {more}'
    attributes += f' canGetAndSetFMUstate="{str(saves).lower()}"'
    mode, held = ("parameter", "fixed") if parameters else ("input", "discrete")
    kind = (f' unit="{unit}"' if unit else "") + (' relativeQuantity="true"' if relative else "")
    variables = (
        _variable(0, "u", "input", "continuous", "Real", "0", kind),
        _variable(1, "x", "output", "continuous", "Real", None, kind),
        _variable(2, "gain", "parameter", "fixed", "Real", "2", kind),
        _variable(0, "mode", mode, held, "Integer", "0"),
        _variable(1, "steps", "output", "discrete", "Integer", None),
        _variable(0, "on", mode, held, "Boolean", "false"),
        _variable(0, "label", "parameter", "fixed", "String", ""),
    )
    units = UNITS if unit else ""
    path = folder / f"{name}.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(
            "modelDescription.xml", DESCRIPTION.format(attributes=attributes, units=units, variables="".join(variables))
        )
        archive.writestr("binaries/linux64/Answers.so", compile_source("answers_fmu.c", *macros))
    return path
