"""Two small FMUs in C, built by the tests: a thermostat of FMI 2.0 and cells of a battery of FMI 3.0."""

from collections.abc import Mapping
from pathlib import Path

from orchestrator.checking.binaries import here
from tests.support.c_fmu import SUFFIX, write_fmu
from tests.support.c_library import compile_with_fault

_HEAD = 'generationTool="tests" generationDateAndTime="2024-01-01T00:00:00Z"'
_SIZED = '<Dimension valueReference="1"/>'
THERMOSTAT = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Thermostat" guid="{{room-of-the-tests}}"
  {_HEAD} numberOfEventIndicators="1">
  <ModelExchange modelIdentifier="thermostat" canGetAndSetFMUstate="true"/>
  <CoSimulation modelIdentifier="thermostat" canGetAndSetFMUstate="true" canHandleVariableCommunicationStepSize="true"/>
  <DefaultExperiment startTime="0" stopTime="50" stepSize="0.5"/>
  <ModelVariables>
    <ScalarVariable name="time" valueReference="0" causality="independent" variability="continuous">
      <Real/></ScalarVariable>
    <ScalarVariable name="outside" valueReference="1" causality="input">
      <Real start="275" min="230" max="320" nominal="300"/></ScalarVariable>
    <ScalarVariable name="set" valueReference="2" causality="parameter" variability="fixed">
      <Real start="293" min="280" max="310" nominal="300"/></ScalarVariable>
    <ScalarVariable name="power" valueReference="3" causality="parameter" variability="fixed">
      <Real start="0.5" min="0"/></ScalarVariable>
    <ScalarVariable name="thick" valueReference="4" causality="parameter" variability="fixed">
      <Boolean start="true"/></ScalarVariable>
    <ScalarVariable name="T" valueReference="5" causality="output" initial="exact">
      <Real start="292" nominal="300"/></ScalarVariable>
    <ScalarVariable name="der(T)" valueReference="6"><Real derivative="6"/></ScalarVariable>
    <ScalarVariable name="loss" valueReference="7" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="heat" valueReference="8" causality="output" variability="discrete">
      <Boolean/></ScalarVariable>
    <ScalarVariable name="count" valueReference="9" causality="output" variability="discrete">
      <Integer/></ScalarVariable>
  </ModelVariables>
  <ModelStructure>
    <Outputs>
      <Unknown index="6" dependencies="6"/><Unknown index="8" dependencies="2 6"/>
      <Unknown index="9" dependencies=""/><Unknown index="10" dependencies=""/>
    </Outputs>
    <Derivatives><Unknown index="7" dependencies="2 6"/></Derivatives>
    <InitialUnknowns>
      <Unknown index="7" dependencies="2 3 4 5 6"/><Unknown index="8" dependencies="2 5 6"/>
      <Unknown index="9" dependencies="3 6"/><Unknown index="10" dependencies=""/>
    </InitialUnknowns>
  </ModelStructure>
</fmiModelDescription>
"""
CELLS = f"""<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Cells" instantiationToken="{{cells-of-the-tests}}" {_HEAD}>
  <CoSimulation modelIdentifier="cells" canHandleVariableCommunicationStepSize="true" maxOutputDerivativeOrder="1"/>
  <DefaultExperiment startTime="0" stopTime="5" stepSize="0.1"/>
  <ModelVariables>
    <Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
    <UInt64 name="size" valueReference="1" causality="structuralParameter" variability="fixed"
      start="3" min="1" max="8"/>
    <Float64 name="current" valueReference="2" causality="input" start="2"/>
    <Float64 name="resistance" valueReference="3" causality="parameter" variability="fixed" start="0.05"/>
    <Float64 name="capacity" valueReference="4" causality="parameter" variability="fixed" start="40" min="1">
      {_SIZED}</Float64>
    <Float64 name="charge" valueReference="5" causality="output" initial="exact" start="0.8">{_SIZED}</Float64>
    <Float64 name="rate" valueReference="6" derivative="5">{_SIZED}</Float64>
    <Float64 name="voltage" valueReference="7" causality="output">{_SIZED}</Float64>
  </ModelVariables>
  <ModelStructure>
    <Output valueReference="5" dependencies="5"/>
    <Output valueReference="7" dependencies="2 5" dependenciesKind="fixed dependent"/>
    <ContinuousStateDerivative valueReference="6" dependencies="2" dependenciesKind="fixed"/>
    <InitialUnknown valueReference="6" dependencies="2 4"/>
    <InitialUnknown valueReference="7" dependencies="2 3 5"/>
  </ModelStructure>
</fmiModelDescription>
"""
_MODELS = {"thermostat": ("2.0", THERMOSTAT), "cells": ("3.0", CELLS)}


def build_small_fmu(path: Path, model: str, fault: str = "", changes: Mapping[str, str] | None = None) -> Path:
    """Build an FMU at ``path`` and return it.

    Args:
        model: "thermostat" or "cells".
        fault: in its source; empty for none.
        changes: texts of the description and what is there instead.
    """
    version, description = _MODELS[model]
    for old, new in (changes or {}).items():
        assert old in description
        description = description.replace(old, new)
    binary = f"binaries/{here(version)}/{model}{SUFFIX}"  # type: ignore[arg-type]
    library = compile_with_fault(f"{model}.c", fault)
    return write_fmu(path, {"modelDescription.xml": description.encode(), binary: library})
