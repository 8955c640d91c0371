"""What is done with every attribute of SSP's schemas: used, refused, or without effect on a run; none is guessed."""

import zipfile
from pathlib import Path

import fmpy.ssp
import pytest
from lxml import etree

from orchestrator.errors import OrchestratorError
from orchestrator.master.signals import Constant
from orchestrator.scenarios.ssp.common import _short_name
from orchestrator.scenarios.ssp.grammar import SSP2
from orchestrator.scenarios.ssp.read import open_ssp
from orchestrator.shared.xml_grammar import _attributes, _cells
from tests.scenarios.test_ssp_systems import SPACES
from tests.support.answers_fmu import build_answers_fmu
from tests.support.c_fmu import have_compiler

USED, REFUSED, NO_EFFECT = "used", "refused", "no effect"
ROWS = """
ssd.SystemStructureDescription.version | 1.7 | refused
ssd.SystemStructureDescription.name | other | used
ssd.System.name | other | no effect
ssd.Component.name | other | refused
ssd.Component.type | application/x-ssp-package | refused
ssd.Component.source | resources/none.fmu | refused
ssd.Component.implementation | ScheduledExecution | refused
ssd.Connector.name | other | refused
ssd.Connector.kind | output | refused
ssd.Connection.startElement | b | refused
ssd.Connection.startConnector | H | used
ssd.Connection.startIndices | 1 | refused
ssd.Connection.endElement | b | used
ssd.Connection.endConnector | x | refused
ssd.Connection.endIndices | 1 | refused
ssd.Connection.suppressUnitConversion | true | refused
ssd.ParameterBinding.type | text/plain | refused
ssd.ParameterBinding.source | resources/other.ssv | refused
ssd.ParameterBinding.sourceBase | component | refused
ssd.ParameterBinding.prefix | b. | used
ssd.ParameterMapping.type | text/plain | refused
ssd.ParameterMapping.source | resources/none.ssm | refused
ssd.ParameterMapping.sourceBase | component | refused
ssd.DefaultExperiment.startTime | 0.5 | used
ssd.DefaultExperiment.stopTime | 2 | used
ssv.ParameterSet.version | 1.7 | refused
ssv.ParameterSet.name | other | no effect
ssv.Parameter.name | other | used
ssv.Enumeration.name | other | no effect
ssv.Value.value | b | used
ssm.ParameterMapping.version | 1.7 | no effect
ssm.MappingEntry.source | other | used
ssm.MappingEntry.target | other | refused
ssm.MappingEntry.suppressUnitConversion | true | used
ssc.Enumeration.name | other | no effect
ssc.LinearTransformation.factor | 9 | used
ssc.LinearTransformation.offset | 9 | used
ssc.MapEntry.source | 8 | refused
ssc.MapEntry.target | 8 | used
ssc.Unit.name | other | refused
NamedItems.name | other | no effect
ssc.Item.name | other | no effect
ssc.Item.value | 9 | no effect
ssc.Annotation.type | other | used
"""
# Of an element of these names every attribute is without effect: drawing, and what describes the file.
DRAWN = (
    "ssd.ConnectorGeometry", "ssd.ElementGeometry", "ssd.SystemGeometry", "ssd.Note", "ssd.ConnectionGeometry",
    "ssc.MetaData", "ssc.Signature", "ssc.Content",
)  # fmt: skip
DESCRIBED = frozenset(
    ["id", "description", "author", "fileversion", "copyright", "license", "generationTool", "generationDateAndTime"]
)
# Shown by other tests: of clocks and dimensions `test_ssp2`, which has an FMU of FMI 3.0; the rest refuses the element.
ELSEWHERE = (
    "ssc.Clock", "ssd.Clock", "ssc.Dimension", "ssd.SignalDictionary", "ssd.SignalDictionaryReference", "ssc.Binary",
    "ssv.Binary", "HexValue",
)  # fmt: skip
FLOATS, BASE_UNITS = ("Real", "Float64", "Float32"), ("kg", "m", "s", "A", "K", "mol", "cd", "rad", "factor", "offset")
WHOLE = ("Integer", *(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64)))


def outcomes():
    """Return for each attribute the value that it is changed to, and what is then to be seen."""
    rows = (line.split(" | ") for line in ROWS.strip().splitlines())
    found = {name: (value, outcome) for name, value, outcome in rows}
    found |= {f"ssv.{kind}.value": ("2", USED) for kind in (*FLOATS, *WHOLE)}
    found |= {f"ssv.{kind}.unit": ("K", USED) for kind in FLOATS} | {
        f"ssc.{kind}.unit": ("mK", USED) for kind in FLOATS
    }
    found |= {f"ssc.BaseUnit.{name}": ("3", REFUSED) for name in BASE_UNITS[:-2]}
    found |= {f"ssc.BaseUnit.{name}": ("3", USED) for name in BASE_UNITS[-2:]}
    return found | {
        "ssv.Boolean.value": ("0", USED), "ssv.String.value": ("b", USED), "ssv.Enumeration.value": ("two", REFUSED),
    }  # fmt: skip


OUTCOMES = outcomes()


def schema_attributes():
    """Yield element and attribute of the grammar of SSP 2.0."""
    cells = {line.split(" |")[0].strip(): _cells(line) for line in SSP2.strip().splitlines()}
    for element, (_, attributes) in cells.items():
        if not element.startswith("@"):
            yield from ((element, name) for name in _attributes(attributes, cells))


def test_every_attribute_of_the_schemas_is_in_the_table():
    known = dict.fromkeys(schema_attributes())
    asked = {f"{element}.{name}" for element, name in known if element not in (*DRAWN, *ELSEWHERE)}
    described = {entry for entry in asked if entry.rpartition(".")[2] in DESCRIBED}
    assert set(OUTCOMES) == asked - described
    assert {element for element, _ in known} >= {*DRAWN, *ELSEWHERE}


def test_the_schemas_of_ssp_1_have_no_attribute_that_the_grammar_lacks():
    folder = Path(fmpy.ssp.__file__).parent / "schema"
    names = set()
    for kind in ("Description", "ParameterValues", "ParameterMapping", "Common"):
        root = etree.parse(folder / f"SystemStructure{kind}.xsd")
        names |= {one.get("name") for one in root.iter("{http://www.w3.org/2001/XMLSchema}attribute")} - {None}
    assert names
    assert names <= {name for _, name in schema_attributes()}


SET = f"""<ssv:ParameterSet{SPACES} version="2.0" name="v"><ssv:Parameters>PARAMETERS
<ssv:Parameter name="M"><ssv:Integer value="1"/></ssv:Parameter>
<ssv:Parameter name="B"><ssv:Boolean value="1"/></ssv:Parameter>
<ssv:Parameter name="L"><ssv:String value="a"/></ssv:Parameter></ssv:Parameters>
<ssv:Units><ssc:Unit name="mK"><ssc:BaseUnit K="1" factor="0.001"/></ssc:Unit></ssv:Units></ssv:ParameterSet>"""
MAP = f"""<ssm:ParameterMapping{SPACES} version="2.0">
<ssm:MappingEntry source="G" target="gain"><ssc:LinearTransformation factor="2" offset="1"/></ssm:MappingEntry>
<ssm:MappingEntry source="M" target="mode"><ssc:IntegerMappingTransformation><ssc:MapEntry source="1" target="3"/>
<ssc:MapEntry source="2" target="4"/></ssc:IntegerMappingTransformation></ssm:MappingEntry>
<ssm:MappingEntry source="B" target="on"/><ssm:MappingEntry source="L" target="label"/></ssm:ParameterMapping>"""
PART = """<ssd:Component name="NAME" source="resources/part.fmu" implementation="CoSimulation"><ssd:Connectors>
<ssd:Connector name="u" kind="input"><ssc:Float64 unit="mK"/><ssd:ConnectorGeometry x="0" y="0"/></ssd:Connector>
<ssd:Connector name="x" kind="output"><ssc:Float64 unit="mK"/></ssd:Connector>
<ssd:Connector name="gain" kind="parameter"><ssc:Float64/></ssd:Connector>
<ssd:Connector name="mode" kind="parameter"><ssc:Integer/></ssd:Connector>
<ssd:Connector name="on" kind="parameter"><ssc:Boolean/></ssd:Connector>
<ssd:Connector name="label" kind="parameter"><ssc:String/></ssd:Connector>
</ssd:Connectors><ssd:ElementGeometry x1="0" y1="0" x2="1" y2="1"/></ssd:Component>"""
BODY = f"""<ssd:SystemStructureDescription{SPACES} version="2.0" name="p"><ssd:System name="s"><ssd:Connectors>
<ssd:Connector name="IN" kind="input"><ssc:Float64 unit="K"/></ssd:Connector>
<ssd:Connector name="OUT" kind="output"><ssc:Float64 unit="K"/></ssd:Connector>
<ssd:Connector name="H" kind="parameter"><ssc:Float64 unit="mK"/></ssd:Connector></ssd:Connectors>
<ssd:ParameterBindings>
<ssd:ParameterBinding prefix="a." source="resources/set.ssv"><ssd:ParameterMapping source="resources/map.ssm"/>
</ssd:ParameterBinding></ssd:ParameterBindings>
<ssc:MetaData kind="general" type="text/plain" source="notes.txt"/>
<ssd:Elements>{PART.replace("NAME", "a")}{PART.replace("NAME", "b")}</ssd:Elements>
<ssd:Connections>
<ssd:Connection startConnector="IN" endElement="a" endConnector="u"><ssc:LinearTransformation factor="2" offset="1"/>
<ssd:ConnectionGeometry pointsX="0 1" pointsY="0 1"/></ssd:Connection>
<ssd:Connection startElement="a" startConnector="x" endConnector="OUT"/>
</ssd:Connections><ssd:SystemGeometry x1="0" y1="0" x2="1" y2="1"/>
<ssd:GraphicalElements><ssd:Note x1="0" y1="0" x2="1" y2="1" text="here"/></ssd:GraphicalElements>
<ssd:Annotations><ssc:Annotation type="org.openmodelica"><oms:Annotations
xmlns:oms="https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"><oms:SimulationInformation>
<oms:FixedStepMaster stepSize="0.01"/></oms:SimulationInformation></oms:Annotations></ssc:Annotation></ssd:Annotations>
</ssd:System>
<ssd:Enumerations><ssc:Enumeration name="E"><ssc:Item name="one" value="1"/></ssc:Enumeration></ssd:Enumerations>
<ssd:Units><ssc:Unit name="mK"><ssc:BaseUnit K="1" factor="0.001"/></ssc:Unit>
<ssc:Unit name="K"><ssc:BaseUnit K="1"/></ssc:Unit></ssd:Units>
<ssd:DefaultExperiment startTime="0" stopTime="1"/></ssd:SystemStructureDescription>"""
NUMBER = '<ssv:Parameter name="G"><ssv:KIND value="300" unit="mK"/></ssv:Parameter>'
# The element that an attribute is of, where the package above has none; what it takes the place of.
IN_PLACE = {
    "ssv.Value": ('<ssv:String value="a"/>', '<ssv:String><ssv:Value value="a"/></ssv:String>'),
    "ssv.Enumeration": ('<ssv:Integer value="1"/>', '<ssv:Enumeration value="1" name="E"/>'),
    "ssc.Enumeration": ("<ssc:Integer/>", '<ssc:Enumeration name="E"/>'),
    **{f"ssv.{k}": ('<ssv:Integer value="1"/>', f'<ssv:{k} value="1"/>') for k in WHOLE},
    **{f"ssv.{k}": ('<ssv:Float64 value="300"', f'<ssv:{k} value="300"') for k in FLOATS},
    **{f"ssc.{k}": ("<ssc:Float64 unit", f"<ssc:{k} unit") for k in FLOATS},
}
FILES = {"SystemStructure.ssd": BODY, "resources/set.ssv": SET, "resources/map.ssm": MAP}


def texts_for(element):
    """The files of the package, an element of the kind among them."""
    old, new = IN_PLACE.get(element, ("", ""))
    texts = {name: text.replace("PARAMETERS", NUMBER.replace("KIND", "Float64")) for name, text in FILES.items()}
    texts = {name: text.replace(old, new) if old else text for name, text in texts.items()}
    if element == "ssv.Enumeration":  # which no table of whole numbers maps
        begin, end = texts["resources/map.ssm"].split('target="mode"')
        texts["resources/map.ssm"] = f'{begin}target="mode"/>{end.partition("</ssm:MappingEntry>")[2]}'
    return texts


def changed(texts, element, name, value):
    """The files with one attribute set, of the first element of its kind."""
    wanted = {"NamedItems": "ssc.Enumeration"}.get(element, element)
    for file, text in texts.items():
        root = etree.fromstring(text.encode())
        found = [one for one in root.iter() if isinstance(one.tag, str) and _short_name(one.tag) == wanted]
        found = [one for one in found if element != "NamedItems" or len(one)]
        if found:
            found[0].set(name, value)
            return texts | {file: etree.tostring(root).decode()}
    raise AssertionError(f"no element {wanted}")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    if not have_compiler():
        pytest.skip("there is no C compiler")
    made = tmp_path_factory.mktemp("attributes")
    build_answers_fmu(made, parameters=True, unit="K").rename(made / "part.fmu")
    return made


def seen(folder, texts):
    """All that a run of the package would be."""
    path = folder / "package.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        archive.write(folder / "part.fmu", "resources/part.fmu")
        for name, text in texts.items():
            archive.writestr(name, text)
    with open_ssp(path, {"IN": Constant(20.0)}) as scenario:
        system = scenario.system
        parts = [(one.name, one.start) for one in system.instances]
        run = (scenario.start, scenario.stop, scenario.algorithm, scenario.record, scenario.derived, scenario.name)
        return repr((parts, system.connections, system.sources, *run, scenario.remarks))


def what_is_done(folder, element, name, value, known):
    """Change one attribute and say what that does."""
    texts = texts_for(element)
    plain = known[str(texts)] = known.get(str(texts)) or seen(folder, texts)
    try:
        return NO_EFFECT if seen(folder, changed(texts, element, name, value)) == plain else USED
    except OrchestratorError:
        return REFUSED


def test_an_attribute_is_used_refused_or_without_effect_as_the_table_says(folder):
    drawn = {"ssd.ConnectorGeometry.x", "ssd.ElementGeometry.x1", "ssd.SystemGeometry.x1", "ssd.Note.x1"}
    drawn |= {"ssd.ConnectionGeometry.pointsX", "ssc.MetaData.source", "ssd.System.description", "ssd.Component.id"}
    wrong, known = [], {}
    for entry, (value, outcome) in (OUTCOMES | dict.fromkeys(sorted(drawn), ("0.5", NO_EFFECT))).items():
        element, _, name = entry.rpartition(".")
        done = what_is_done(folder, element, name, value, known)
        wrong += [f"{entry} = {value!r} is {done}"] if done != outcome else []
    assert not wrong, "\n".join(wrong)
