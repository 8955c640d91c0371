"""SSP 2.0: systems of FMUs of both versions of FMI written and read, arrays, sizes, clocks, what is refused."""

import importlib.util
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from orchestrator.api.ssp import export_ssp
from orchestrator.errors import FmuError, InputError, ScenarioError
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel, Jacobi
from orchestrator.master.signals import Constant
from orchestrator.master.system import Connection, SignalSource, System
from orchestrator.paired.cosimulation import FMUS
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.scenario import scenario_of_pair
from orchestrator.scenarios.isolated import Safety
from orchestrator.scenarios.scenario import Scenario, simulate
from orchestrator.scenarios.ssp.common import parse, require_valid
from orchestrator.scenarios.ssp.read import open_ssp
from orchestrator.scenarios.ssp.write import write_ssp
from tests.support.c_fmu import have_compiler
from tests.support.sized3_fmu import build_sized3_fmu

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")

TRUSTED = Safety(trust=True)
FILES = {"ssd": "SystemStructureDescription.xsd", "ssv": "SystemStructureParameterValues.xsd"}


def official(kind: str) -> etree.XMLSchema:
    """The standard's own schema, of the package pyssp-standard; skips where that is not installed."""
    found = importlib.util.find_spec("pyssp_standard")
    if found is None or found.origin is None:
        pytest.skip("pyssp-standard is not installed")
    return etree.XMLSchema(etree.parse(Path(found.origin).parent / "resources" / "ssp2" / FILES[kind]))


def texts_of(package: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(package) as archive:
        return {name: archive.read(name) for name in archive.namelist() if name.endswith((".ssd", ".ssv"))}


# The paired loops -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def built(build_native: Callable[..., dict[str, Path]]) -> dict[int, dict[str, Path]]:
    return {fmi: build_native(FMUS, fmi=fmi) for fmi in (2, 3)}


@pytest.fixture(scope="module", params=["3.0", "mixed"])
def loops(request: pytest.FixtureRequest, built: dict[int, dict[str, Path]], tmp_path_factory) -> tuple[Scenario, Path]:
    """The paired loops with FMI 2.0, and a package of them with FMI 3.0."""
    chosen = built[3] if request.param == "3.0" else {**built[2], "Drivetrain": built[3]["Drivetrain"]}
    expected, scenario = (
        replace(scenario_of_pair(Experiment(), fmus, 0.02, 0.5), stop=0.3) for fmus in (built[2], chosen)
    )
    return expected, export_ssp(tmp_path_factory.mktemp("loops") / "paired.ssp", scenario, version="2.0").path


def test_the_loops_run_to_the_bits_of_fmi_2(loops: tuple[Scenario, Path]) -> None:
    scenario, package = loops
    expected = simulate(scenario, TRUSTED)
    with open_ssp(package, events=False) as again:
        assert again.algorithm == GaussSeidel(1e-3)
        found = simulate(again, TRUSTED)
    for name in expected.names:
        np.testing.assert_array_equal(found[name], expected[name])
    assert np.ptp(found["plant.theta_l"]) > 0.01


def test_files_follow_the_official_schemas(loops: tuple[Scenario, Path]) -> None:
    for name, text in texts_of(loops[1]).items():
        schema, root = official(name[-3:]), etree.fromstring(text)
        assert root.get("version") == "2.0"
        assert schema.validate(root), schema.error_log


def test_types_are_those_of_the_fmus(loops: tuple[Scenario, Path]) -> None:
    texts = texts_of(loops[1])
    assert b"<ssc:Float64" in texts["SystemStructure.ssd"]
    assert b"<ssv:Int64" in texts["resources/plant.ssv"]  # an enumeration
    assert (b"<ssc:Real" in texts["SystemStructure.ssd"]) == (b"<ssv:Real" in texts["resources/controller.ssv"])


# Arrays -----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def sized(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_sized3_fmu(tmp_path_factory.mktemp("sized"))


def chain(path: Path) -> Scenario:
    """Three values from a to b, crossed."""
    gains = {f"p[{k}]": float(k) for k in (1, 2, 3)}
    instances = (fmu_instance("a", path, {"size": 3, **gains}), fmu_instance("b", path, {"size": 3, **gains}))
    connections = tuple(Connection(f"a.y[{k}]", f"b.u[{4 - k}]", 2.0) for k in (1, 2, 3))
    sources = tuple(SignalSource(f"a.u[{k}]", Constant(1.0 + k)) for k in (1, 2, 3))
    return Scenario(System(instances, connections, sources), ("b.y[1]", "b.y[3]"), Jacobi(0.1), 1.0)


def test_arrays_and_their_sizes_are_written_and_read(sized: Path, tmp_path: Path) -> None:
    scenario = chain(sized)
    write_ssp(tmp_path / "chain.ssp", scenario, "2.0")
    text = texts_of(tmp_path / "chain.ssp")["SystemStructure.ssd"].decode()
    assert 'startConnector="y" startIndices="1" endElement="b" endConnector="u" endIndices="3"' in text
    assert '<ssc:Dimension size="3"/>' in text
    values = texts_of(tmp_path / "chain.ssp")["resources/a.ssv"].decode()
    assert '<ssv:Float64 value="1.0 2.0 3.0"/>' in values
    assert '<ssv:UInt64 value="3"/>' in values
    with open_ssp(tmp_path / "chain.ssp", simultaneous=True) as again:
        found = simulate(replace(again, record=scenario.record), TRUSTED)
    np.testing.assert_array_equal(found.values, simulate(scenario, TRUSTED).values)
    for name, content in texts_of(tmp_path / "chain.ssp").items():
        schema = official(name[-3:])
        assert schema.validate(etree.fromstring(content)), schema.error_log


SPACES = "".join(
    f' xmlns:{key}="http://ssp-standard.org/SSP1/SystemStructure{name}"'
    for key, name in (
        ("ssd", "Description"),
        ("ssc", "Common"),
        ("ssv", "ParameterValues"),
        ("ssm", "ParameterMapping"),
    )
)
INNER = """<ssd:System name="s">
<ssd:Connectors>
 <ssd:Connector name="in" kind="input"><ssc:Float64/>DIM</ssd:Connector>
 <ssd:Connector name="out" kind="output"><ssc:Float64/>OUT</ssd:Connector>
 <ssd:Connector name="n" kind="structuralParameter"><ssc:UInt64/></ssd:Connector>
</ssd:Connectors>
<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>
<ssv:ParameterSet version="2.0" name="v"><ssv:Parameters>
 <ssv:Parameter name="n"><ssv:UInt16 value="3"/></ssv:Parameter>
 <ssv:Parameter name="in"><ssv:Float64 value="1 2 3"/><ssc:Dimension size="3"/></ssv:Parameter>
 <ssv:Parameter name="a.p"><ssv:Float32 value="4 5 6"/><ssc:Dimension size="3"/></ssv:Parameter>
</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>
<ssd:Elements><ssd:Component name="a" source="resources/Sized.fmu">
 <ssd:Connectors>
  <ssd:Connector name="u" kind="input"><ssc:Float64/><ssc:Dimension sizeConnector="size"/></ssd:Connector>
  <ssd:Connector name="y" kind="output"><ssc:Float64/><ssc:Dimension/></ssd:Connector>
  <ssd:Connector name="size" kind="structuralParameter"><ssc:UInt64/></ssd:Connector>
  <ssd:Connector name="tick" kind="input">
   <ssc:Clock intervalVariability="constant" intervalDecimal="0.1"/></ssd:Connector>
 </ssd:Connectors>
</ssd:Component></ssd:Elements>
<ssd:Connections>
 <ssd:Connection startConnector="in" endElement="a" endConnector="u"/>
 <ssd:Connection startConnector="n" endElement="a" endConnector="size"/>
 <ssd:Connection startElement="a" startConnector="y" endConnector="out"/>
</ssd:Connections></ssd:System>"""
PLAIN = INNER.replace("DIM", '<ssc:Dimension size="3"/>').replace("OUT", "<ssc:Dimension/>")


def document(system: str) -> str:
    return (
        f'<ssd:SystemStructureDescription{SPACES} version="2.0" name="p">{system}'
        '<ssd:DefaultExperiment startTime="0" stopTime="1"/></ssd:SystemStructureDescription>'
    )


def package(folder: Path, fmu: Path, system: str) -> Path:
    path = folder / "theirs.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", document(system))
        archive.write(fmu, "resources/Sized.fmu")
    return path


def test_whole_arrays_go_through_connectors_of_systems(sized: Path, tmp_path: Path) -> None:
    with open_ssp(package(tmp_path, sized, PLAIN), step=0.1) as found:
        result = simulate(found, TRUSTED)
    assert [result[f"a.y[{k}]"][-1] for k in (1, 2, 3)] == pytest.approx([4.0, 10.0, 18.0])
    np.testing.assert_array_equal(result["out[3]"], result["a.y[3]"])


def test_an_element_is_joined_by_its_indices(sized: Path, tmp_path: Path) -> None:
    one = PLAIN.replace('startConnector="in" endElement', 'startConnector="in" startIndices="2" endElement')
    one = one.replace('endConnector="u"/>', 'endConnector="u" endIndices="3"/>')
    with open_ssp(package(tmp_path, sized, one), step=0.1) as found:
        result = simulate(found, TRUSTED)
    assert [result[f"a.y[{k}]"][-1] for k in (1, 2, 3)] == pytest.approx([0.0, 0.0, 12.0])


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (('<ssc:Dimension size="3"/></ssd:Con', '<ssc:Dimension size="2"/></ssd:Con'), "to an array of its size"),
        (('value="4 5 6"', 'value="4 5"'), "must have 3 values, but has 2"),
        (('sizeConnector="size"', 'size="2"'), "must have the sizes of the FMU's variable, 3, but has 2"),
        (('startConnector="in"', 'startConnector="in" startIndices="9"'), "must be joined to an array of its size"),
        (('startConnector="y"', 'startConnector="tick"'), r"a.tick is a Clock: join clocks by `clock_connections`"),
        (('kind="output"><ssc:Float64/><ssc:Dimension/></ssd:Connector>\n <ssd:Connector name="n"',
          'kind="unspecified"><ssc:Float64/></ssd:Connector>\n <ssd:Connector name="n"'), "of the kind unspecified"),
        (('<ssc:Float64/><ssc:Dimension sizeConnector="size"/>', "<ssc:Binary/>"), "is Binary, which no conn"),
        (('source="resources/Sized.fmu"', ""), "must be a file of the archive, but there is none"),
        (('name="a" source', 'name="a" implementation="ScheduledExecution" source'), "but is ScheduledExecution"),
        (('intervalDecimal="0.1"', 'intervalDecimal="-1"'), "clock .* must be positive, but is -1 s"),
        (('name="tick" kind="input"', 'name="tick" kind="inward"'), "must follow SSP 2.0, but does not: line .*kind"),
        (('<ssv:UInt16 value="3"/>', '<ssv:UInt16 value="-3"/>'), "must follow SSP 2.0"),
        (('<ssv:UInt16 value="3"/>', '<ssv:UInt16 value="30"/>'), "structural parameter size must lie in"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_named(sized: Path, tmp_path: Path, change: tuple[str, str], expected: str) -> None:
    assert change[0] in PLAIN
    path = package(tmp_path, sized, PLAIN.replace(*change))
    with pytest.raises((InputError, FmuError), match=expected), open_ssp(path, step=0.1):
        pass


# The grammar ------------------------------------------------------------------------------------------------------


def variants() -> list[str]:
    """The handwritten file, and what leaving out or changing one piece of it makes of it."""
    whole = document(PLAIN)
    root = etree.fromstring(whole)
    found = [whole]
    for n in range(len(list(root.iter()))):
        for change in ("leave out", "double", "add", "empty"):
            again = etree.fromstring(whole)
            element = list(again.iter())[n]
            parent = element.getparent()
            if change == "leave out" and parent is not None:
                parent.remove(element)
            elif change == "double" and parent is not None:
                parent.append(etree.fromstring(etree.tostring(element)))
            elif change == "add":
                element.set("unknown", "1")
            elif element.attrib:
                del element.attrib[element.keys()[-1]]
            found.append(etree.tostring(again).decode())
    return found


def test_the_grammar_accepts_what_the_schema_accepts() -> None:
    schema, counts = official("ssd"), {True: 0, False: 0}
    for text in variants():
        root = etree.fromstring(text)
        accepted = schema.validate(root)
        try:
            require_valid(root, "ssd", "x")
            ours = True
        except ScenarioError:
            ours = False
        if ours != accepted:  # the schema does not look into what a binding holds
            assert accepted, text
            assert any("ParameterSet" in str(e.tag) for e in root.iter())
        counts[accepted] += 1
    assert min(counts.values()) > 30


def test_files_of_ssp_1_are_read_as_before() -> None:
    with pytest.raises(ScenarioError, match=r"must follow SystemStructureDescription\.xsd"):
        parse(document(PLAIN).replace('version="2.0" name="p"', 'version="1.0" name="p"').encode(), "ssd", "x")
