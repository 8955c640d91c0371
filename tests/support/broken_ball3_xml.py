"""Faults of what is read of an FMU of FMI 3.0: edits of the ball's files, and the rule that must name each."""

import re
from collections.abc import Callable
from pathlib import Path

from tests.support.ball3 import BUILD, LIBRARY, MANIFEST, REFERENCE, TERMINALS, XML, ball_files, compile_library
from tests.support.broken_ball3 import STATIC, Mutant
from tests.support.c_fmu import write_fmu

# ruff: noqa: E501
# fmt: off

Files = dict[str, bytes]
Edit = tuple[str, str, str, str]

# name, rule, what is found once in modelDescription.xml, what comes in its place
_HEAD: list[Edit] = [
    ("empty token", "model.guid", 'instantiationToken="{ball}"', 'instantiationToken=""'),
    ("blank token", "model.guid", 'instantiationToken="{ball}"', 'instantiationToken="  "'),
    ("no token", "schema.invalid", 'instantiationToken="{ball}" ', ""),
    ("no model name", "schema.invalid", 'modelName="Ball" ', ""),
    ("date without zone", "model.date", "00:00:00Z", "00:00:00"),
    ("date with offset", "model.date", "00:00:00Z", "00:00:00+01:00"),
    ("no date", "schema.invalid", "2024-01-01T00:00:00Z", "yesterday"),
    ("date that is none", "schema.invalid", "2024-01-01T", "2024-13-01T"),
    ("naming convention", "schema.invalid", '"structured"', '"dotted"'),
    ("version 4", "model.fmi-version", 'fmiVersion="3.0"', 'fmiVersion="4.0"'),
    ("version beta", "model.not-covered", 'fmiVersion="3.0"', 'fmiVersion="3.0-beta.2"'),
    ("version 1", "model.not-covered", 'fmiVersion="3.0"', 'fmiVersion="1.0"'),
    ("identifier with a dash", "model.identifier", 'modelIdentifier="Ball"', 'modelIdentifier="Ball-1"'),
    ("identifier with a digit", "model.identifier", 'modelIdentifier="Ball"', 'modelIdentifier="1Ball"'),
    ("identifier is a keyword", "model.identifier", 'modelIdentifier="Ball"', 'modelIdentifier="double"'),
    ("identifier of no library", "binary.missing", 'modelIdentifier="Ball"', 'modelIdentifier="Bell"'),
    ("no identifier", "schema.invalid", 'modelIdentifier="Ball" ', ""),
    ("serialise without save", "model.capability", 'canGetAndSetFMUState="true" ', ""),
    ("early return without update", "model.capability", 'providesIntermediateUpdate="true" ', ""),
    ("internal step zero", "model.capability", "<CoSimulation ", '<CoSimulation fixedInternalStepSize="0" '),
    ("internal step negative", "model.capability", "<CoSimulation ", '<CoSimulation fixedInternalStepSize="-0.1" '),
    ("internal step text", "schema.invalid", "<CoSimulation ", '<CoSimulation fixedInternalStepSize="small" '),
    ("flag misspelt", "model.unknown-flag", "canGetAndSetFMUState=", 'canGetAndSetFMUstate="true" canGetAndSetFMUState='),
    ("flag no truth value", "schema.invalid", 'hasEventMode="true"', 'hasEventMode="yes"'),
    ("order of derivatives", "schema.invalid", "<CoSimulation ", '<CoSimulation maxOutputDerivativeOrder="-1" '),
    ("tool undocumented", "file.external", "<CoSimulation ", '<CoSimulation needsExecutionTool="true" '),
    ("no interface", "model.interface", "(?s)  <CoSimulation.*?/>\n", ""),
    ("log category twice", "model.log-category", 'name="event"', 'name="error"'),
    ("stop before start", "model.experiment", 'stopTime="1.2"', 'stopTime="-1"'),
    ("stop infinite", "model.experiment", 'stopTime="1.2"', 'stopTime="INF"'),
    ("step zero", "model.experiment", 'stepSize="0.02"', 'stepSize="0"'),
    ("step longer than the run", "model.experiment", 'stepSize="0.02"', 'stepSize="5"'),
    ("tolerance zero", "model.experiment", 'stepSize="0.02"', 'stepSize="0.02" tolerance="0"'),
    ("start no number", "schema.invalid", 'startTime="0"', 'startTime="zero"'),
    ("element unknown", "schema.invalid", "<LogCategories>", "<LogBook/><LogCategories>"),
    ("elements in another order", "schema.invalid", "(?s)(  <UnitDefinitions>.*</UnitDefinitions>\n)(.*</TypeDefinitions>\n)", r"\2\1"),
    ("no variables", "schema.invalid", "(?s)<ModelVariables>.*</ModelVariables>", "<ModelVariables/>"),
    ("text among elements", "schema.invalid", "<ModelStructure>", "<ModelStructure>structure"),
]
_TYPES: list[Edit] = [
    ("unit twice", "unit.name", '<Unit name="m/s2">', '<Unit name="m"/><Unit name="m/s2">'),
    ("display unit twice", "unit.name", '<DisplayUnit name="mm" factor="1000"/>', '<DisplayUnit name="mm" factor="1000"/><DisplayUnit name="mm" factor="1e3"/>'),
    ("factor zero", "unit.factor", 'factor="1000"', 'factor="0"'),
    ("display unit inverse", "unit.conversion", 'factor="1000"', 'factor="1000" inverse="true"'),
    ("exponents", "unit.exponents", 'm="1" s="-1"', 'm="1" s="-2"'),
    ("exponent no integer", "schema.invalid", 'm="1" s="-1"', 'm="1.5" s="-1"'),
    ("unit without name", "schema.invalid", '<Unit name="m/s2">', "<Unit>"),
    ("inverse no truth value", "schema.invalid", 'factor="1000"', 'factor="1000" inverse="no"'),
    ("type twice", "type.name", 'name="Acceleration" unit', 'name="Length" unit'),
    ("type named as a variable", "type.name", '"Surface"', '"label"'),
    ("unit of a type", "type.unit", 'name="Length" unit="m"', 'name="Length" unit="ell"'),
    ("display unit of a type", "type.unit", 'unit="m" displayUnit="mm" min', 'unit="m" displayUnit="km" min'),
    ("bounds of a type", "type.bounds", 'min="-10" max="50"', 'min="60" max="50"'),
    ("item named twice", "type.enumeration", 'name="soft"', 'name="hard"'),
    ("item value twice", "type.enumeration", '<Item name="soft" value="2"/>', '<Item name="soft" value="1"/>'),
    ("no items", "schema.invalid", '<Item name="hard" value="1"/><Item name="soft" value="2"/>', ""),
    ("item without value", "schema.invalid", '<Item name="soft" value="2"/>', '<Item name="soft"/>'),
    ("type of no type", "schema.invalid", "<EnumerationType", "<FloatType/><EnumerationType"),
]
_VARIABLES: list[Edit] = [
    ("name twice", "variable.name-duplicate", 'name="e" ', 'name="g" '),
    ("alias named as a variable", "variable.name-duplicate", 'Alias name="height"', 'Alias name="v"'),
    ("alias without name", "schema.invalid", 'Alias name="height" ', "Alias "),
    ("display unit of an alias", "variable.display-unit", 'name="height" displayUnit="mm"', 'name="height" displayUnit="km"'),
    ("name with a blank", "variable.name-structured", 'name="label"', 'name="la bel"'),
    ("name with a digit first", "variable.name-structured", 'name="label"', 'name="1abel"'),
    ("alias with a bracket", "variable.name-structured", 'name="height"', 'name="height["'),
    ("derivative of an integer", "variable.name-structured", 'name="bounces"', 'name="der(bounces)"'),
    ("name empty", "variable.name-structured", 'name="label"', 'name=""'),
    ("reference twice", "variable.reference-duplicate", 'valueReference="5"', 'valueReference="4"'),
    ("reference negative", "schema.invalid", 'name="e" valueReference="5"', 'name="e" valueReference="-5"'),
    ("reference too large", "schema.invalid", 'name="e" valueReference="5"', 'name="e" valueReference="4294967296"'),
    ("no reference", "schema.invalid", 'name="e" valueReference="5"', 'name="e"'),
    ("causality misspelt", "schema.invalid", 'name="e" valueReference="5" causality="parameter"', 'name="e" valueReference="5" causality="param"'),
    ("constant input", "variable.causality-variability", 'name="u" valueReference="3"', 'name="u" valueReference="3" variability="constant"'),
    ("fixed output", "variable.causality-variability", 'name="v" valueReference="2"', 'name="v" valueReference="2" variability="fixed"'),
    ("discrete parameter", "variable.causality-variability", 'name="e" valueReference="5" causality="parameter" variability="fixed"', 'name="e" valueReference="5" causality="parameter" variability="discrete"'),
    ("constant structural parameter", "variable.causality-variability", 'causality="structuralParameter" variability="fixed"', 'causality="structuralParameter" variability="constant"'),
    ("discrete time", "variable.causality-variability", 'causality="independent"', 'causality="independent" variability="discrete"'),
    ("continuous integer", "variable.continuous-not-real", 'name="bounces" valueReference="6"', 'name="bounces" valueReference="6" variability="continuous"'),
    ("continuous text", "variable.continuous-not-real", 'name="title" valueReference="11"', 'name="title" valueReference="11" variability="continuous"'),
    ("initial of a parameter", "variable.initial", 'name="e" valueReference="5"', 'name="e" valueReference="5" initial="approx"'),
    ("initial of an input", "variable.initial", 'name="u" valueReference="3"', 'name="u" valueReference="3" initial="approx"'),
    ("exact calculated parameter", "variable.initial", 'name="q" valueReference="9"', 'name="q" valueReference="9" initial="exact"'),
    ("initial misspelt", "schema.invalid", 'name="e" valueReference="5"', 'name="e" valueReference="5" initial="given"'),
    ("no time", "variable.independent", '    <Float64 name="time" valueReference="17" causality="independent"/>\n', ""),
    ("two times", "variable.independent", '<Float64 name="time"', '<Float64 name="time2" valueReference="55" causality="independent"/><Float64 name="time"'),
    ("time is an integer", "variable.independent", '<Float64 name="time" valueReference="17" causality="independent"', '<Int32 name="time" valueReference="17" causality="independent" variability="continuous"'),
    ("time with a start", "variable.start-forbidden", 'causality="independent"', 'causality="independent" start="0"'),
    ("parameter without start", "variable.start-missing", 'max="1" start="0.7"', 'max="1"'),
    ("input without start", "variable.start-missing", 'declaredType="Acceleration" start="0" min', 'declaredType="Acceleration" min'),
    ("text without start", "variable.start-missing", 'name="label" valueReference="10" causality="parameter" variability="fixed"><Start value="ball"/></String>', 'name="label" valueReference="10" causality="parameter" variability="fixed"/>'),
    ("structural parameter without start", "variable.start-missing", 'start="3" min="1" max="8"', 'min="1" max="8"'),
    ("calculated with a start", "variable.start-forbidden", 'name="q" valueReference="9"', 'name="q" valueReference="9" start="1"'),
    ("start above max", "variable.start-range", 'max="1" start="0.7"', 'max="1" start="1.7"'),
    ("start below min", "variable.start-range", 'max="1" start="0.7"', 'max="1" start="-0.7"'),
    ("integer start above max", "variable.start-range", 'start="0" min="0" max="1000"', 'start="1001" min="0" max="1000"'),
    ("element of a start above max", "variable.start-range", 'start="1 2 3"', 'start="1 2 3" max="2"'),
    ("start above the type's max", "variable.start-range", 'initial="exact" declaredType="Length" start="1"', 'initial="exact" declaredType="Length" start="51"'),
    ("start of no item", "variable.start-range", 'declaredType="Surface" start="1"', 'declaredType="Surface" start="3"'),
    ("bounds exchanged", "variable.bounds", 'min="0" max="1" start', 'min="1" max="0" start'),
    ("nominal zero", "variable.nominal", 'start="0.5" nominal="1"', 'start="0.5" nominal="0"'),
    ("nominal negative", "variable.nominal", 'start="0.5" nominal="1"', 'start="0.5" nominal="-1"'),
    ("start not finite", "variable.not-finite", 'start="9.81"', 'start="INF"'),
    ("start is no number", "schema.invalid", 'start="9.81"', 'start="much"'),
    ("start beyond Int32", "schema.invalid", 'start="0" min="0" max="1000"', 'start="99999999999" min="0" max="1000"'),
    ("start negative of UInt64", "schema.invalid", 'variability="fixed" start="7"', 'variability="fixed" start="-7"'),
    ("truth value", "schema.invalid", 'start="false"', 'start="no"'),
    ("type unknown", "variable.declared-type", 'name="u" valueReference="3" causality="input" declaredType="Acceleration"', 'name="u" valueReference="3" causality="input" declaredType="Speed"'),
    ("type of another kind", "variable.declared-type", 'name="small" valueReference="15"', 'name="small" valueReference="15" declaredType="Length"'),
    ("enumeration without type", "schema.invalid", ' declaredType="Surface"', ""),
    ("unit unknown", "variable.unit", 'name="v" valueReference="2" causality="output" initial="exact" unit="m/s"', 'name="v" valueReference="2" causality="output" initial="exact" unit="kn"'),
    ("display unit unknown", "variable.display-unit", 'initial="exact" unit="m/s" start', 'initial="exact" unit="m/s" displayUnit="kn" start'),
    ("display unit without unit", "variable.display-unit", 'name="e" valueReference="5"', 'name="e" valueReference="5" displayUnit="mm"'),
    ("unit of an integer", "schema.invalid", 'name="bounces" valueReference="6"', 'name="bounces" valueReference="6" unit="m"'),
    ("derivative of nothing", "variable.derivative", 'unit="m/s2" derivative="2"', 'unit="m/s2" derivative="77"'),
    ("derivative of itself", "variable.derivative", 'unit="m/s2" derivative="2"', 'unit="m/s2" derivative="19"'),
    ("derivative of an integer variable", "variable.derivative", 'unit="m/s2" derivative="2"', 'unit="m/s2" derivative="6"'),
    ("derivative of an array", "variable.derivative", 'unit="m/s2" derivative="2"', 'unit="m/s2" derivative="8"'),
    ("reinit of no state", "variable.reinit", 'name="e" valueReference="5"', 'name="e" valueReference="5" reinit="true"'),
    ("multiple set of a parameter", "variable.multiple-set", 'name="e" valueReference="5"', 'name="e" valueReference="5" canHandleMultipleSetPerTimeInstant="false"'),
    ("update of a discrete variable", "variable.intermediate-update", 'name="bounces" valueReference="6"', 'name="bounces" valueReference="6" intermediateUpdate="true"'),
    ("update of a parameter", "variable.intermediate-update", 'name="e" valueReference="5"', 'name="e" valueReference="5" intermediateUpdate="true"'),
    ("update of a clock", "schema.invalid", 'name="hit" valueReference="101"', 'name="hit" valueReference="101" intermediateUpdate="true"'),
    ("binary longer than its most", "variable.max-size", 'maxSize="8"', 'maxSize="2"'),
    ("binary odd digits", "schema.invalid", '<Start value="00000000"/>', '<Start value="000"/>'),
    ("size negative", "schema.invalid", 'maxSize="8"', 'maxSize="-8"'),
]
_ARRAYS: list[Edit] = [
    ("start values too few", "variable.start-count", 'start="1 2 3"', 'start="1 2"'),
    ("start values too many", "variable.start-count", 'start="1 2 3"', 'start="1 2 3 4"'),
    ("start list of a scalar", "variable.start-count", 'start="0.5" nominal', 'start="0.5 0.6" nominal'),
    ("start texts of a scalar", "variable.start-count", '<Start value="ball"/></String>', '<Start value="ball"/><Start value="b"/></String>'),
    ("dimension of nothing", "variable.dimension", 'start="1 2 3"><Dimension valueReference="7"/>', 'start="1 2 3"><Dimension valueReference="77"/>'),
    ("dimension of a parameter", "variable.dimension", 'start="1 2 3"><Dimension valueReference="7"/>', 'start="1 2 3"><Dimension valueReference="22"/>'),
    ("dimension of an integer output", "variable.dimension", 'start="1 2 3"><Dimension valueReference="7"/>', 'start="1"><Dimension valueReference="6"/>'),
    ("dimension with both", "variable.dimension", 'start="1 2 3"><Dimension valueReference="7"/>', 'start="1 2 3"><Dimension valueReference="7" start="3"/>'),
    ("dimension with neither", "variable.dimension", 'start="1 2 3"><Dimension valueReference="7"/>', 'start="1 2 3"><Dimension/>'),
    ("dimension zero", "variable.dimension", 'start="1 2 3"><Dimension valueReference="7"/>', 'start="1"><Dimension start="0"/>'),
    ("structural start zero", "variable.dimension", 'start="3" min="1" max="8"', 'start="0" min="0" max="8"'),
    ("structural parameter is an array", "variable.structural", 'start="3" min="1" max="8"/>', 'start="3" min="1" max="8"><Dimension start="1"/></UInt64>'),
    ("dimension negative", "schema.invalid", 'start="1 2 3"><Dimension valueReference="7"/>', 'start="1 2 3"><Dimension start="-3"/>'),
    ("dimension of a clock", "schema.invalid", 'intervalVariability="triggered"/>', 'intervalVariability="triggered"><Dimension start="2"/></Clock>'),
]
_CLOCKS: list[Edit] = [
    ("constant without interval", "clock.interval", 'intervalDecimal="0.1"\n        shiftDecimal="0.05" ', ""),
    ("interval zero", "clock.interval", 'intervalDecimal="0.1"', 'intervalDecimal="0"'),
    ("interval negative", "clock.interval", 'intervalDecimal="0.1"', 'intervalDecimal="-0.1"'),
    ("triggered with interval", "clock.interval", '"triggered"', '"triggered" intervalDecimal="0.1"'),
    ("countdown with interval", "clock.interval", '"constant" intervalDecimal', '"countdown" intervalDecimal'),
    ("changing with interval", "clock.interval", '"constant" intervalDecimal', '"changing" intervalDecimal'),
    ("interval no number", "schema.invalid", 'intervalDecimal="0.1"', 'intervalDecimal="often"'),
    ("no variability of the interval", "schema.invalid", ' intervalVariability="triggered"', ""),
    ("kind of interval misspelt", "schema.invalid", '"triggered"', '"trigger"'),
    ("shift negative", "clock.shift", 'shiftDecimal="0.05"', 'shiftDecimal="-0.05"'),
    ("shift without interval", "clock.shift", '"constant" intervalDecimal="0.1"', '"fixed"'),
    ("counter without fraction", "clock.fraction", 'shiftDecimal="0.05"', 'intervalCounter="1" resolution="10"'),
    ("counter without resolution", "clock.fraction", 'shiftDecimal="0.05"', 'supportsFraction="true" intervalCounter="1"'),
    ("counter zero", "clock.fraction", 'shiftDecimal="0.05"', 'supportsFraction="true" intervalCounter="0" resolution="10"'),
    ("resolution zero", "clock.fraction", 'shiftDecimal="0.05"', 'supportsFraction="true" intervalCounter="1" resolution="0"'),
    ("fraction and decimal differ", "clock.fraction", 'shiftDecimal="0.05"', 'supportsFraction="true" intervalCounter="1" resolution="20"'),
    ("shift counter alone", "clock.fraction", 'shiftDecimal="0.05"', 'supportsFraction="true" shiftCounter="1"'),
    ("clock is a parameter", "clock.causality", 'valueReference="100" causality="input"', 'valueReference="100" causality="parameter" variability="tunable"'),
    ("periodic output clock", "clock.causality", '"constant" intervalDecimal="0.1"\n        shiftDecimal="0.05" priority="1"/>', '"constant" intervalDecimal="0.1"/>\n    <Clock name="k" valueReference="102" intervalVariability="constant" intervalDecimal="1"/>'),
    ("tunable clock", "clock.variability", 'valueReference="101" causality="output"', 'valueReference="101" causality="local" variability="tunable"'),
    ("output clock with priority", "clock.priority", '"triggered"', '"triggered" priority="1"'),
    ("no event mode", "clock.event-mode", ' hasEventMode="true"', ""),
    ("continuous clocked variable", "variable.clocks", 'variability="discrete" clocks="100" previous', 'variability="continuous" clocks="100" previous'),
    ("clocks of no clock", "variable.clocks", 'name="count" valueReference="16" causality="output" clocks="100"', 'name="count" valueReference="16" causality="output" clocks="6"'),
    ("clocks of nothing", "variable.clocks", 'name="count" valueReference="16" causality="output" clocks="100"', 'name="count" valueReference="16" causality="output" clocks="777"'),
    ("clocks empty", "variable.clocks", 'name="count" valueReference="16" causality="output" clocks="100"', 'name="count" valueReference="16" causality="output" clocks=""'),
    ("clocks no list", "schema.invalid", 'name="count" valueReference="16" causality="output" clocks="100"', 'name="count" valueReference="16" causality="output" clocks="tick"'),
    ("previous of nothing", "variable.previous", 'previous="21"', 'previous="77"'),
    ("previous is itself", "variable.previous", 'previous="21"', 'previous="20"'),
    ("previous of another type", "variable.previous", 'previous="21"', 'previous="16"'),
    ("previous is an input", "variable.previous", 'previous="21"', 'previous="3"'),
    ("previous twice", "variable.previous", 'name="old" valueReference="21"', 'name="two" valueReference="66" variability="discrete" clocks="100" previous="21"/><Float64 name="old" valueReference="21"'),
]
_STRUCTURE: list[Edit] = [
    ("output missing", "structure.outputs", '    <Output valueReference="11"/>\n', ""),
    ("output clock missing", "structure.outputs", '    <Output valueReference="101"/>\n', ""),
    ("output too many", "structure.outputs", '<Output valueReference="11"/>', '<Output valueReference="11"/><Output valueReference="4"/>'),
    ("output of nothing", "structure.index", '<Output valueReference="11"/>', '<Output valueReference="11"/><Output valueReference="777"/>'),
    ("output twice", "structure.duplicate", '<Output valueReference="11"/>', '<Output valueReference="11"/><Output valueReference="11"/>'),
    ("output without reference", "schema.invalid", '<Output valueReference="11"/>', "<Output/>"),
    ("order of the lists", "schema.invalid", '    <EventIndicator valueReference="1"/>\n', '    <EventIndicator valueReference="1"/><Output valueReference="11"/>\n'),
    ("derivative without attribute", "structure.derivatives", 'unit="m/s2" derivative="2"', 'unit="m/s2"'),
    ("derivative is an integer", "structure.derivatives", '<ContinuousStateDerivative valueReference="18" dependencies="2" dependenciesKind="constant"/>', '<ContinuousStateDerivative valueReference="6"/>'),
    ("initial unknown missing", "structure.initial-unknowns", '    <InitialUnknown valueReference="9" dependencies="8"/>\n', ""),
    ("initial derivative missing", "structure.initial-unknowns", '    <InitialUnknown valueReference="18"/>\n', ""),
    ("initial unknown is a parameter", "structure.initial-unknowns", '<InitialUnknown valueReference="18"/>', '<InitialUnknown valueReference="18"/><InitialUnknown valueReference="5"/>'),
    ("initial unknown twice", "structure.duplicate", '<InitialUnknown valueReference="18"/>', '<InitialUnknown valueReference="18"/><InitialUnknown valueReference="18"/>'),
    ("clocked state missing", "structure.clocked-states", '    <ClockedState valueReference="20"/>\n', ""),
    ("clocked state without previous", "structure.clocked-states", '<ClockedState valueReference="20"/>', '<ClockedState valueReference="20"/><ClockedState valueReference="16"/>'),
    ("clocked state of nothing", "structure.index", '<ClockedState valueReference="20"/>', '<ClockedState valueReference="20"/><ClockedState valueReference="99"/>'),
    ("indicator is an integer", "structure.event-indicators", '<EventIndicator valueReference="1"/>', '<EventIndicator valueReference="6"/>'),
    ("indicator of nothing", "structure.index", '<EventIndicator valueReference="1"/>', '<EventIndicator valueReference="88"/>'),
    ("dependency of nothing", "structure.dependencies", 'dependencies="8"', 'dependencies="88"'),
    ("dependency twice", "structure.dependencies", 'dependencies="8"', 'dependencies="8 8"'),
    ("dependency on a calculated one", "structure.dependencies", 'dependencies="8"', 'dependencies="19"'),
    ("dependency no number", "schema.invalid", 'dependencies="8"', 'dependencies="p"'),
    ("kinds too few", "structure.dependencies-kind", '"3 4" dependenciesKind="dependent dependent"', '"3 4" dependenciesKind="dependent"'),
    ("kinds alone", "structure.dependencies-kind", '<InitialUnknown valueReference="18"/>', '<InitialUnknown valueReference="18" dependenciesKind="dependent"/>'),
    ("kind of an initial unknown", "structure.dependencies-kind", '"3 4" dependenciesKind="constant dependent"', '"3 4" dependenciesKind="constant fixed"'),
    ("kind of an integer", "structure.dependencies-kind-type", '"3 4" dependenciesKind="dependent dependent"', '"3 4" dependenciesKind="constant dependent"'),
    ("kind misspelt", "schema.invalid", '"3 4" dependenciesKind="dependent dependent"', '"3 4" dependenciesKind="dependent linear"'),
]
_OTHERS: dict[str, list[Edit]] = {
    TERMINALS: [
        ("terminals of version 2", "schema.invalid", 'fmiVersion="3.0"', 'fmiVersion="2.0"'),
        ("terminals of version 3.1", "file.version", 'fmiVersion="3.0"', 'fmiVersion="3.1"'),
        ("terminal twice", "terminals.name", 'name="drive"', 'name="flange"'),
        ("terminal without rule", "schema.invalid", 'matchingRule="sequence"', ""),
        ("member is no variable", "terminals.variable", 'variableName="v"', 'variableName="w"'),
        ("stream is no variable", "terminals.variable", 'inStreamVariableName="g"', 'inStreamVariableName="h"'),
        ("member without name", "terminals.member", ' memberName="v"', ""),
        ("member twice", "terminals.member", 'memberName="v"', 'memberName="x"'),
        ("stream without flow", "terminals.stream", 'variableKind="inflow"', 'variableKind="signal"'),
        ("icon of a terminal", "terminals.icon", 'iconBaseName="flange"', 'iconBaseName="shaft"'),
        ("corners exchanged", "terminals.coordinates", 'x2="100" y2="100" sugg', 'x2="-200" y2="100" sugg'),
        ("coordinate no number", "schema.invalid", 'x1="-10"', 'x1="left"'),
        ("terminals malformed", "xml.malformed", "</Terminals>", ""),
        ("terminals root", "schema.invalid", "fmiTerminalsAndIcons", "fmiTerminals"),
    ],
    BUILD: [
        ("build of version 3.2", "file.version", 'fmiVersion="3.0"', 'fmiVersion="3.2"'),
        ("build of another model", "build.identifier", 'modelIdentifier="Ball"', 'modelIdentifier="Bell"'),
        ("build file missing", "build.file", 'name="ball.c"', 'name="bell.c"'),
        ("build folder missing", "build.include", 'name="include"', 'name="inc"'),
        ("build without identifier", "schema.invalid", ' modelIdentifier="Ball"', ""),
        ("build file without name", "schema.invalid", '<SourceFile name="ball.c"/>', "<SourceFile/>"),
        ("build element unknown", "schema.invalid", '<Library name="m"/>', '<Linker name="m"/>'),
    ],
    MANIFEST: [
        ("manifest without version", "layered.manifest", 'fmi-ls:fmi-ls-version="1.0.0-alpha.1"', ""),
        ("manifest without description", "layered.manifest", '(?s)    fmi-ls:fmi-ls-description=".*?"', ""),
        ("manifest of another folder", "layered.manifest", '"org.fmi-standard.fmi-ls-ref"', '"org.fmi-standard.fmi-ls-bus"'),
        ("role unknown", "layered.role", 'role="result"', 'role="results"'),
        ("related missing", "layered.missing", 'source="Ball_out.csv"', 'source="Bell_out.csv"'),
    ],
    f"{REFERENCE}/Ball_out.csv": [
        ("result of another variable", "layered.result", "time,x,v", "time,x,w"),
        ("result with a short array", "layered.result", "0,1,0,0,ball,2 4 6", "0,1,0,0,ball,2 4"),
    ],
}

# fmt: on


def _edited(path: str, old: str, new: str) -> Callable[[Files], Files]:
    def change(files: Files) -> Files:
        text = files[path].decode()
        pattern = old if old.startswith("(?s)") else re.escape(old)
        changed, count = re.subn(pattern, new if old.startswith("(?s)") else new.replace("\\", r"\\"), text)
        assert count, f"{old!r} is not in {path}"
        return files | {path: changed.encode()}

    return change


def _removed(*paths: str) -> Callable[[Files], Files]:
    return lambda files: {k: v for k, v in files.items() if not k.startswith(paths)}


def _moved(folder: str) -> Callable[[Files], Files]:
    return lambda files: {(k if k != LIBRARY else f"binaries/{folder}/Ball.so"): v for k, v in files.items()}


# fmt: off
_FILES: dict[str, tuple[str, Callable[[Files], Files]]] = {
    "library is text": ("binary.format", lambda files: files | {LIBRARY: b"hello\n"}),
    "library is a DLL": ("binary.format", lambda files: files | {LIBRARY: b"MZ".ljust(0x3C, b"\0") + b"\x40\0\0\0PE\0\0"}),
    "library is an object": ("binary.format", lambda files: files | {LIBRARY: files[LIBRARY][:16] + b"\1\0" + files[LIBRARY][18:]}),
    "library for ARM": ("binary.architecture", lambda files: files | {LIBRARY: files[LIBRARY][:18] + b"\xb7\0" + files[LIBRARY][20:]}),
    "library of another name": ("binary.missing", lambda files: {k.replace("Ball.so", "bell.so"): v for k, v in files.items()}),
    "library without a function": ("binary.exports", lambda files: files | {LIBRARY: compile_library("missing_function")}),
    "folder of FMI 2.0": ("binary.folder", _moved("linux64")),
    "folder misspelt": ("binary.folder", _moved("x86_64-linus")),
    "neither binary nor sources": ("binary.none", _removed("binaries/", "sources/")),
    "sources without build description": ("build.missing", _removed(BUILD)),
    "no binary for this machine": ("binary.not-here", _removed("binaries/")),
    "no entry of the documentation": ("file.documentation", lambda files: {k.replace("index.html", "main.html"): v for k, v in files.items()}),
    "no entry of the licenses": ("file.license", lambda files: {k.replace("license.txt", "mit.txt"): v for k, v in files.items()}),
    "diagram in SVG alone": ("file.documentation", lambda files: files | {"documentation/diagram.svg": b"<svg/>"}),
    "icon is no image": ("file.icon", lambda files: files | {"terminalsAndIcons/icon.png": b"GIF"}),
    "icon in SVG alone": ("terminals.icon", lambda files: files | {"terminalsAndIcons/big.svg": b"<svg/>"}),
    "description malformed": ("xml.malformed", lambda files: files | {XML: files[XML][:-10]}),
    "description with DOCTYPE": ("xml.doctype", lambda files: files | {XML: files[XML].replace(b"<fmi", b"<!DOCTYPE a><fmi", 1)}),
    "description in Latin-1": ("xml.encoding", _edited(XML, "UTF-8", "ISO-8859-1")),
    "no description": ("archive.no-model-description", _removed(XML)),
    "names that differ by case": ("archive.case-clash", lambda files: files | {"resources/README.txt": b""}),
    "path that leaves": ("archive.traversal", lambda files: files | {"../evil": b""}),
    "name of a device": ("archive.odd-name", lambda files: files | {"resources/con.txt": b""}),
}
# fmt: on
_SCHEDULED: list[Edit] = [("input clock without priority", "clock.priority", ' priority="1"', "")]


def _making(change: Callable[[Files], Files], interface: str = "CoSimulation") -> Callable[[Path], object]:
    return lambda path: write_fmu(path, change(ball_files("", interface)))


def static() -> list[Mutant]:
    """All faults of what is read."""
    edits = [*_HEAD, *_TYPES, *_VARIABLES, *_ARRAYS, *_CLOCKS, *_STRUCTURE]
    found = [Mutant(f"xml {n}", rule, _making(_edited(XML, old, new)), STATIC) for n, rule, old, new in edits]
    for path, others in _OTHERS.items():
        found += [Mutant(f"xml {n}", rule, _making(_edited(path, old, new)), STATIC) for n, rule, old, new in others]
    found += [
        Mutant(f"xml {n}", rule, _making(_edited(XML, old, new), "ScheduledExecution"), STATIC)
        for n, rule, old, new in _SCHEDULED
    ]
    return found + [Mutant(f"files {n}", rule, _making(change), STATIC) for n, (rule, change) in _FILES.items()]
