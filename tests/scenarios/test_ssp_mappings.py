"""What a mapping, a connector's unit and a `sourceBase` do to a value on its way into a component."""

import zipfile
from pathlib import Path

import pytest

from orchestrator.api.simulate import simulate
from orchestrator.errors import ScenarioError
from orchestrator.scenarios.ssp.read import open_ssp
from tests.scenarios.test_ssp_systems import (
    SPACES,
    UNITS,
    component,
    connector,
    connectors,
    package,
    system,
    value,
    wire,
)
from tests.support.c_fmu import have_compiler

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")
CELSIUS = UNITS.replace("ssd:", "ssv:")
MILLI = '<ssv:Units><ssc:Unit name="mK"><ssc:BaseUnit K="1" factor="0.001"/></ssc:Unit></ssv:Units>'


def mapped(values: str, entries: str, units: str = MILLI) -> str:
    return (
        '<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="1.0" name="v">'
        f"<ssv:Parameters>{values}</ssv:Parameters>{units}</ssv:ParameterSet></ssd:ParameterValues>"
        f'<ssd:ParameterMapping><ssm:ParameterMapping version="1.0">{entries}</ssm:ParameterMapping>'
        "</ssd:ParameterMapping></ssd:ParameterBinding></ssd:ParameterBindings>"
    )


def entry(source: str, target: str, inner: str = "", more: str = "") -> str:
    return f'<ssm:MappingEntry source="{source}" target="{target}"{more}>{inner}</ssm:MappingEntry>'


def start(path: Path, name: str) -> object:
    with open_ssp(path) as scenario:
        return scenario.system.instances[0].start[name]


@pytest.mark.parametrize(
    ("inner", "more", "expected"),
    [
        ("", "", 0.3),
        ('<ssc:LinearTransformation factor="2"/>', "", 0.6),
        ('<ssc:LinearTransformation offset="5"/>', "", 5.3),
        ('<ssc:LinearTransformation factor="-2" offset="5"/>', "", 4.4),
        ('<ssc:LinearTransformation factor="2"/>', ' suppressUnitConversion="true"', 600.0),
    ],
)
@pytest.mark.parametrize("through", ["component", "system", "connector"])
def test_a_transformation_is_done_in_addition_to_the_conversion(
    inner: str, more: str, expected: float, through: str, tmp_path: Path
) -> None:
    given = value("G", "300", unit="mK")
    if through == "component":
        top = system("", component("a", mapped(given, entry("G", "gain", inner, more))), "")
    elif through == "system":
        top = system(mapped(given, entry("G", "a.gain", inner, more)), component("a"), "")
    else:
        own = connectors(connector("H", "parameter")) + mapped(given, entry("G", "H", inner, more))
        top = system(own, component("a"), wire("H", "a/gain"))
    assert start(package(tmp_path, top, unit="K"), "gain") == pytest.approx(expected)


def test_a_transformation_acts_in_the_unit_of_the_connector_that_it_maps_to(tmp_path: Path) -> None:
    """20 degC, one more in degC, are 294.15 K."""
    offset = '<ssc:LinearTransformation offset="1"/>'
    bound = mapped(value("G", "293.15", unit="K"), entry("G", "H", offset), CELSIUS)
    own = connectors(connector("H", "parameter", unit="degC")) + bound
    path = package(tmp_path, system(own, component("a"), wire("H", "a/gain")), unit="K")
    assert start(path, "gain") == pytest.approx(294.15)
    part = component("a", mapped(value("G", "293.15", unit="K"), entry("G", "gain", offset), CELSIUS))
    part = part.replace(
        'name="gain" kind="parameter"><ssc:Real/>', 'name="gain" kind="parameter"><ssc:Real unit="degC"/>'
    )
    assert start(package(tmp_path, system("", part, ""), unit="K"), "gain") == pytest.approx(294.15)


def test_a_value_without_a_unit_is_in_that_of_its_connector(tmp_path: Path) -> None:
    part = component("a", mapped(value("G", "20"), entry("G", "gain"), ""))
    part = part.replace(
        'name="gain" kind="parameter"><ssc:Real/>', 'name="gain" kind="parameter"><ssc:Real unit="degC"/>'
    )
    assert start(package(tmp_path, system("", part, ""), unit="K"), "gain") == pytest.approx(293.15)


def table(kind: str, **pairs: str) -> str:
    entries = "".join(f'<ssc:MapEntry source="{a.strip("_")}" target="{b}"/>' for a, b in pairs.items())
    return f"<ssc:{kind}MappingTransformation>{entries}</ssc:{kind}MappingTransformation>"


def test_tables_of_a_mapping_are_looked_up(tmp_path: Path) -> None:
    values = value("B", "1", "Boolean") + value("M", "4", "Integer")
    entries = entry("B", "on", table("Boolean", true="false", false="true"))
    entries += entry("M", "mode", table("Integer", _4="7", _5="8"))
    path = package(tmp_path, system("", component("a", mapped(values, entries)), ""))
    assert (start(path, "on"), start(path, "mode")) == (False, 7)


@pytest.mark.parametrize(
    ("values", "entries", "said"),
    [
        (value("M", "3", "Integer"), entry("M", "mode", table("Integer", _4="7")), "one of the values that its"),
        (value("M", "3", "Integer"), entry("M", "mode", table("Boolean", true="false")), "must be of the type of its"),
        (value("B", "true", "Boolean"), entry("B", "on", '<ssc:LinearTransformation factor="2"/>'), "must be a number"),
        (value("M", "3", "Integer"), entry("M", "mode", '<ssc:LinearTransformation factor="0.5"/>'),
         "must be a Integer, but is '3', which its mapping makes 1.5"),
        (value("M", "3") + value("M", "4"), entry("M", "gain"), "must be given once in a set"),
    ],
)  # fmt: skip
def test_what_a_mapping_cannot_hand_on_is_refused(values: str, entries: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=said):
        start(package(tmp_path, system("", component("a", mapped(values, entries)), "")), "mode")


def test_what_a_mapping_leaves_out_is_told(tmp_path: Path) -> None:
    bound = mapped(value("G", "3") + value("EXTRA", "4"), entry("G", "gain") + entry("LACKS", "mode"))
    with open_ssp(package(tmp_path, system("", component("a", bound), ""))) as scenario:
        said = " ".join(map(str, scenario.remarks))
    assert "'LACKS' to 'mode' is passed over" in said
    assert "'EXTRA' is passed over" in said


VALUES = f'<ssv:ParameterSet{SPACES} version="1.0" name="v"><ssv:Parameters>{{}}</ssv:Parameters></ssv:ParameterSet>'
BOUND = '<ssd:ParameterBindings><ssd:ParameterBinding source="{}" sourceBase="component"{}/></ssd:ParameterBindings>'


def hidden(folder: Path, bound: str, where: str = "component") -> Path:
    """A package with `gain` 7 in its own resources/set.ssv and 5 in that of its FMU."""
    inside, more = (bound, "") if where == "system" else ("", bound)
    path = package(folder, system(inside, component("a", more), ""))
    fmu = folder / "Answers.fmu"
    with zipfile.ZipFile(fmu, "a") as archive:
        archive.writestr("resources/set.ssv", VALUES.format(value("gain", "5")))
    with zipfile.ZipFile(path) as archive:
        text = archive.read("SystemStructure.ssd")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", text)
        archive.write(fmu, "resources/part.fmu")
        archive.writestr("resources/set.ssv", VALUES.format(value("gain", "7")))
    return path


def test_a_source_in_the_component_is_read_there(tmp_path: Path) -> None:
    path = hidden(tmp_path, BOUND.format("resources/set.ssv", ""))
    assert start(path, "gain") == 5.0
    assert simulate(path)["a.x"][-1] == 0.0  # the FMU with a file more still runs


@pytest.mark.parametrize(
    ("source", "more", "where", "said"),
    [
        ("resources/none.ssv", "", "component", "must be a file in part.fmu .*, but is 'resources"),
        ("resources/set.ssv", "", "system", "must not have the sourceBase component, as a system has no file"),
        ("resources/set.ssv", ' type="text/csv"', "component", "must be application/x-ssp-parameter-set"),
    ],
)  # fmt: skip
def test_a_source_that_cannot_be_taken_is_refused(
    source: str, more: str, where: str, said: str, tmp_path: Path
) -> None:
    with pytest.raises(ScenarioError, match=said):
        start(hidden(tmp_path, BOUND.format(source, more), where), "gain")
