"""Packages as tools write them: units, parameters and values of a system's own connectors, steps, names."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

from orchestrator.api.simulate import simulate
from orchestrator.errors import ConnectionMismatchError, ScenarioError
from tests.support.answers_fmu import build_answers_fmu
from tests.support.c_fmu import have_compiler
from tests.support.shared_inputs import shared_input

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")
SPACES = "".join(
    f' xmlns:{key}="http://ssp-standard.org/SSP1/SystemStructure{name}"'
    for key, name in (
        ("ssd", "Description"),
        ("ssc", "Common"),
        ("ssv", "ParameterValues"),
        ("ssm", "ParameterMapping"),
    )
)
UNITS = """<ssd:Units><ssc:Unit name="K"><ssc:BaseUnit K="1"/></ssc:Unit>
<ssc:Unit name="degC"><ssc:BaseUnit K="1" offset="273.15"/></ssc:Unit>
<ssc:Unit name="m"><ssc:BaseUnit m="1"/></ssc:Unit></ssd:Units>"""
OMS = 'xmlns:oms="https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"'


def connector(name: str, kind: str, of: str = "Real", unit: str = "") -> str:
    given = f' unit="{unit}"' if unit else ""
    return f'<ssd:Connector name="{name}" kind="{kind}"><ssc:{of}{given}/></ssd:Connector>'


def connectors(*entries: str) -> str:
    return f"<ssd:Connectors>{''.join(entries)}</ssd:Connectors>"


def component(name: str, more: str = "", source: str = "resources/part.fmu", unit: str = "") -> str:
    own = connectors(
        connector("u", "input", unit=unit), connector("x", "output", unit=unit), connector("gain", "parameter"),
        connector("mode", "parameter", "Integer"), connector("on", "parameter", "Boolean"),
        connector("label", "parameter", "String"),
    )  # fmt: skip
    return f'<ssd:Component name="{name}" source="{source}">{own}{more}</ssd:Component>'


def wire(start: str, end: str, inner: str = "") -> str:
    ends = []
    for side, text in (("start", start), ("end", end)):
        element, _, name = text.rpartition("/")
        ends.append((f'{side}Element="{element}" ' if element else "") + f'{side}Connector="{name}"')
    return f"<ssd:Connection {' '.join(ends)}>{inner}</ssd:Connection>"


def system(inside: str, elements: str, wires: str, name: str = "s", behind: str = "") -> str:
    joined = f"<ssd:Connections>{wires}</ssd:Connections>" if wires else ""
    return f'<ssd:System name="{name}">{inside}<ssd:Elements>{elements}</ssd:Elements>{joined}{behind}</ssd:System>'


def binding(*values: str, units: str = "") -> str:
    parameters = "".join(values)
    return (
        '<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="1.0" name="v">'
        f"<ssv:Parameters>{parameters}</ssv:Parameters>{units}</ssv:ParameterSet></ssd:ParameterValues>"
        "</ssd:ParameterBinding></ssd:ParameterBindings>"
    )


def value(name: str, text: str, kind: str = "Real", unit: str = "") -> str:
    given = f' unit="{unit}"' if unit else ""
    return f'<ssv:Parameter name="{name}"><ssv:{kind} value="{text}"{given}/></ssv:Parameter>'


def package(folder: Path, top: str, step: float | None = 0.1, fmu: str = "part.fmu", **kind: object) -> Path:
    """A package of FMUs with x' = gain u (twice that while `on`) + mode, over a second."""
    path, built = folder / "package.ssp", build_answers_fmu(folder, parameters=True, **kind)
    osp = (
        '<ssd:Annotations><ssc:Annotation type="com.opensimulationplatform">'
        f'<osp:Algorithm xmlns:osp="http://opensimulationplatform.com/SSP/OSPAnnotations"><osp:FixedStepAlgorithm '
        f'baseStepSize="{step}"/></osp:Algorithm></ssc:Annotation></ssd:Annotations>'
    )
    text = (
        f'<ssd:SystemStructureDescription{SPACES} version="1.0" name="p">{top}{UNITS}<ssd:DefaultExperiment '
        f'startTime="0" stopTime="1">{osp if step else ""}</ssd:DefaultExperiment></ssd:SystemStructureDescription>'
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", text)
        archive.write(built, f"resources/{fmu}")
    return path


def test_units_of_a_systems_own_connectors_are_converted(tmp_path: Path) -> None:
    top = system(
        connectors(connector("IN", "input", unit="degC"), connector("OUT", "output", unit="degC")),
        component("a", unit="K"),
        wire("IN", "a/u") + wire("a/x", "OUT"),
    )
    result = simulate(package(tmp_path, top, unit="K"), inputs={"IN": 20.0})
    assert result["a.x"][-1] == pytest.approx(2.0 * 293.15)
    assert np.allclose(result["OUT"], result["a.x"] - 273.15)
    assert result.units["OUT"] == "degC"


def test_units_of_connectors_count_where_the_fmu_states_none(tmp_path: Path) -> None:
    top = system(connectors(connector("IN", "input", unit="degC")), component("a", unit="K"), wire("IN", "a/u"))
    assert simulate(package(tmp_path, top), inputs={"IN": 20.0})["a.x"][-1] == pytest.approx(2.0 * 293.15)


@pytest.mark.parametrize("stated", ["degC", ""])
def test_units_and_transformations_through_nested_systems(tmp_path: Path, stated: str) -> None:
    double = '<ssc:LinearTransformation factor="2" offset="1"/>'
    inner = system(
        connectors(connector("J", "input", unit=stated)), component("a", unit="K"), wire("J", "a/u"), "inner"
    )
    top = system(connectors(connector("IN", "input", unit="degC")), inner, wire("IN", "inner/J", double))
    path = package(tmp_path, top, unit="K")
    # Without a unit of its own the inner connector has no meaning that a transformed value could keep.
    expected = 2.0 * (41.0 + (273.15 if stated else 0.0))
    assert simulate(path, inputs={"IN": 20.0})["inner/a.x"][-1] == pytest.approx(expected)


def test_between_components_as_well(tmp_path: Path) -> None:
    through = system(
        connectors(connector("I", "input", unit="degC"), connector("O", "output", unit="degC")),
        component("b", unit="K"), wire("I", "b/u") + wire("b/x", "O"), "inner",
    )  # fmt: skip
    top = system("", component("a", binding(value("u", "1")), unit="K") + through, wire("a/x", "inner/I"))
    result = simulate(package(tmp_path, top, unit="K"), jacobi=True)
    assert result["a.x"][-1] == pytest.approx(2.0)
    assert result["inner/b.x"][-1] == pytest.approx(2.0 * 0.1 * float(np.sum(result["a.x"][:-1])))


def test_units_that_measure_something_else_are_refused(tmp_path: Path) -> None:
    top = system(connectors(connector("IN", "input", unit="m")), component("a", unit="K"), wire("IN", "a/u"))
    with pytest.raises(ConnectionMismatchError, match="must have a unit that measures what m does, but has K"):
        simulate(package(tmp_path, top, unit="K"), inputs={"IN": 1.0})


def test_differences_have_no_offset_in_systems_parameters_and_components(tmp_path: Path) -> None:
    celsius = {name: connector(name, kind, unit="degC") for name, kind in (("in", "input"), ("held", "input"))}
    gain = binding(value("gain", "3", unit="degC"))
    inner = system(
        connectors(*celsius.values(), connector("out", "output")),
        component("a", gain, unit="K") + component("b") + component("c", unit="degC"),
        wire("in", "a/u") + wire("held", "b/u") + wire("a/x", "c/u") + wire("a/x", "out"),
        "inner",
    )
    kelvin = connectors(
        connector("IN", "input", unit="K"),
        connector("HELD", "input", unit="K"),
        connector("OUT", "output", unit="degC"),
    )
    wires = wire("IN", "inner/in") + wire("HELD", "inner/held") + wire("inner/out", "OUT")
    top = system(kelvin + binding(value("HELD", "5", unit="degC")), inner, wires)
    result = simulate(package(tmp_path, top, unit="K", relative=True), inputs={"IN": 2.0})
    assert result["inner/a.x"][-1] == pytest.approx(6.0)
    assert result["inner/b.x"][-1] == pytest.approx(10.0)
    assert result["inner/c.x"][-1] == pytest.approx(6.0, rel=0.2)  # a held value, integrated
    assert result["OUT"] == pytest.approx(result["inner/a.x"])
    assert result.units["OUT"] == "degC"


def test_values_in_a_systems_own_binding_reach_what_they_feed(tmp_path: Path) -> None:
    names = {"G": ("gain", "Real", "3"), "M": ("mode", "Integer", "5"), "B": ("on", "Boolean", "true")}
    own = connectors(
        connector("IN", "input", unit="degC"), *(connector(n, "parameter", k) for n, (_, k, _) in names.items())
    )
    given = binding(value("IN", "294.15", unit="K"), *(value(n, text, kind) for n, (_, kind, text) in names.items()),
                    units=UNITS.replace("ssd:Units", "ssv:Units"))  # fmt: skip
    wires = wire("IN", "a/u") + "".join(wire(n, f"a/{target}") for n, (target, _, _) in names.items())
    path = package(tmp_path, system(own + given, component("a", unit="K"), wires), unit="K")
    assert simulate(path)["a.x"][-1] == pytest.approx(3.0 * 294.15 * 2.0 + 5.0)
    assert simulate(path, inputs={"IN": 1.0})["a.x"][-1] == pytest.approx(3.0 * 274.15 * 2.0 + 5.0)


def test_a_string_in_a_systems_binding(tmp_path: Path) -> None:
    own = connectors(connector("L", "parameter", "String")) + binding(value("L", "seven77", "String"))
    path = package(tmp_path, system(own, component("a"), wire("L", "a/label")))
    assert simulate(path)["a.x"][-1] == pytest.approx(7.0)


def test_a_parameter_of_an_inner_system_given_outside(tmp_path: Path) -> None:
    inner = system(
        connectors(connector("G", "parameter")), component("a", binding(value("u", "1"))), wire("G", "a/gain"), "in"
    )
    top = system(binding(value("in.G", "7")), inner, "")
    assert simulate(package(tmp_path, top))["in/a.x"][-1] == pytest.approx(7.0)


def test_what_is_no_connector_is_named(tmp_path: Path) -> None:
    top = system(binding(value("nothing", "7")), component("a"), "")
    with pytest.raises(ScenarioError, match="must name a component's parameter or a system's connector, but 'nothing'"):
        simulate(package(tmp_path, top))


def test_connectors_that_feed_themselves_are_refused(tmp_path: Path) -> None:
    pair = connectors(connector("I", "input"), connector("O", "output"))
    one, two = (system(pair, component("a"), wire("I", "O"), name) for name in ("one", "two"))
    fed = system(connectors(connector("I", "input")), component("b"), wire("I", "b/u"), "three")
    wires = wire("one/O", "two/I") + wire("two/O", "one/I") + wire("one/O", "three/I")
    with pytest.raises(ConnectionMismatchError, match="must not be fed by itself, but is"):
        simulate(package(tmp_path, system("", one + two + fed, wires)))


def test_an_escaped_name_of_a_file(tmp_path: Path) -> None:
    top = system("", component("a", binding(value("u", "1")), "resources/My%20Part.fmu"), "")
    assert simulate(package(tmp_path, top, fmu="My Part.fmu"))["a.x"][-1] == pytest.approx(2.0)


def test_names_with_dots(tmp_path: Path) -> None:
    elements = component("Motor.left", binding(value("u", "1"))) + component("Motor_left")
    top = system(binding(value("Motor.left.gain", "4"), value("Motor_left.mode", "6", "Integer")), elements, "")
    result = simulate(package(tmp_path, top))
    assert result["Motor_left_.x"][-1] == pytest.approx(4.0)
    assert result["Motor_left.x"][-1] == pytest.approx(6.0)


def test_the_step_of_omsimulators_annotation(tmp_path: Path) -> None:
    annotation = (
        '<ssd:Annotations><ssc:Annotation type="org.openmodelica"><oms:Annotations '
        + OMS
        + "><oms:SimulationInformation>"
        '<oms:FixedStepMaster description="oms-ma" stepSize="0.25" absoluteTolerance="1e-4" relativeTolerance="1e-4"/>'
        "</oms:SimulationInformation></oms:Annotations></ssc:Annotation></ssd:Annotations>"
    )
    top = system("", component("a"), "", behind=annotation)
    assert simulate(package(tmp_path, top, None)).steps == 4
    assert simulate(package(tmp_path, top, 0.1)).steps == 10
    assert simulate(package(tmp_path, top, None), step=0.5).steps == 2


@pytest.mark.parametrize(
    ("name", "signal", "last"),
    [("01_in_deg", "a.x", 0.0349066), ("02_out_deg", "OUT", 114.592), ("04_component_deg", "a.x", 2.0),
     ("05_system_parameter", "a.x", 6.0), ("06_inner_parameter", "inner/a.x", 8.0), ("11_mm_in_ssv", "a.y", 4000.25)],
)  # fmt: skip
def test_shared_inputs(name: str, signal: str, last: float) -> None:
    assert simulate(shared_input(f"06-ssp-system-level/{name}.ssp"), inputs={"IN": 2.0})[signal][-1] == pytest.approx(
        last, rel=1e-5
    )


def test_the_shared_step() -> None:
    assert simulate(shared_input("06-ssp-system-level/10_oms_step.ssp"), inputs={"IN": 2.0}).steps == 20


def remarks(path: Path) -> list[str]:
    return [str(remark) for remark in simulate(path).run.remarks]


def test_other_systems_in_a_package_are_told(tmp_path: Path) -> None:
    path = package(tmp_path, system("", component("a"), ""))
    assert remarks(path) == []
    with zipfile.ZipFile(path, "a") as archive:
        for name in ("Fast.ssd", "variants/slow.SSD"):
            archive.writestr(name, "<x/>")
    text = (
        "the other systems in it are passed over (Fast.ssd, variants/slow.SSD), for SystemStructure.ssd is what is run"
    )
    assert remarks(path) == [f"package.ssp: {text}"]
    with zipfile.ZipFile(tmp_path / "none.ssp", "w") as archive:
        archive.writestr("Fast.ssd", "<x/>")
    with pytest.raises(ScenarioError, match=r"must hold SystemStructure.ssd, but does not; it has Fast.ssd$"):
        simulate(tmp_path / "none.ssp")


@pytest.mark.parametrize("where", ["component", "system", "prefix"])
def test_values_that_an_fmu_has_no_parameter_for_are_told_and_passed_over(where: str, tmp_path: Path) -> None:
    values = [value("u", "1"), value("gain", "4"), value("gian", "9"), value("lubrication", "3", unit="m")]
    if where == "component":
        top = system("", component("a", binding(*values)), "")
    elif where == "system":
        top = system(binding(*(v.replace('name="', 'name="a.') for v in values)), component("a"), "")
    else:
        top = system("", component("a", binding(*values).replace("Binding><", 'Binding prefix=""><', 1)), "")
    path = package(tmp_path, top)
    assert simulate(path)["a.x"][-1] == pytest.approx(4.0)
    assert remarks(path) == [
        "a: the value of the parameter 'gian' is passed over, for Answers has no such variable; did you mean 'gain'?",
        "a: the value of the parameter 'lubrication' is passed over, for Answers has no such variable",
    ]


def test_connectors_of_parameters_that_an_fmu_lacks_are_told_unless_they_are_joined(tmp_path: Path) -> None:
    own = connector("lubrication", "parameter")
    part = component("a", binding(value("u", "1"))).replace("</ssd:Connectors>", f"{own}</ssd:Connectors>")
    path = package(tmp_path, system("", part, ""))
    assert simulate(path)["a.x"][-1] == pytest.approx(2.0)
    assert remarks(path) == ["a: its connector 'lubrication' is passed over, for Answers has no such variable"]
    joined = system(connectors(connector("L", "parameter")), part, wire("L", "a/lubrication"))
    with pytest.raises(ConnectionMismatchError, match="must be a variable of Answers, but 'lubrication' is none"):
        simulate(package(tmp_path, joined))
    fed = part.replace('name="lubrication" kind="parameter"', 'name="lubrication" kind="input"')
    with pytest.raises(ConnectionMismatchError, match="must be a variable of Answers, but 'lubrication' is none"):
        simulate(package(tmp_path, system("", fed, "")))
