"""Small files that ask for much: refused in one line, before anything of that size is made."""

import tracemalloc
import zipfile
from pathlib import Path

import pytest

from orchestrator.api.simulate import simulate
from orchestrator.errors import FmuError, InputError, ScenarioError
from orchestrator.fmi.model_description import parse_description
from orchestrator.fmi.size import MOST_VARIABLES
from orchestrator.scenarios.scenario import load_scenario
from orchestrator.scenarios.ssp import flow
from orchestrator.scenarios.ssp.read import open_ssp

HEAD = "".join(
    f' xmlns:{key}="http://ssp-standard.org/SSP1/SystemStructure{name}"'
    for key, name in (("ssd", "Description"), ("ssc", "Common"), ("ssv", "ParameterValues"))
)
MOST_MEMORY = 64 << 20  # bytes; each of these files asked for 0.5 to 100 GB
TOO_MANY = "must have at most 250000 variables, elements of arrays included, but has more: counted up to"
SIZED = (
    '<UInt64 name="n" valueReference="1" causality="structuralParameter" start="2"/>'
    '<Float64 name="x" valueReference="2" causality="output"><Dimension valueReference="1"/>{alias}</Float64>'
)


def description(variables: str = SIZED.format(alias=""), structure: str = "") -> bytes:
    return (
        '<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t"><CoSimulation modelIdentifier="m"/>'
        f"<ModelVariables>{variables}</ModelVariables><ModelStructure>{structure}</ModelStructure>"
        "</fmiModelDescription>"
    ).encode()


def package(folder: Path, system: str, variables: str | None = None) -> Path:
    text = (
        f'<ssd:SystemStructureDescription{HEAD} version="2.0" name="p"><ssd:System name="s">{system}</ssd:System>'
        "</ssd:SystemStructureDescription>"
    )
    with zipfile.ZipFile(folder / "fmu", "w") as archive:
        archive.writestr("modelDescription.xml", description() if variables is None else description(variables))
    with zipfile.ZipFile(folder / "p.ssp", "w") as archive:
        archive.writestr("SystemStructure.ssd", text)
        archive.write(folder / "fmu", "part.fmu")
    return folder / "p.ssp"


def connector(name: str, sizes: str, kind: str = "input") -> str:
    return f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Float64/>{sizes}</ssd:Connector>'


def component(name: str, size: int | None = None) -> str:
    value = f'<ssv:Parameter name="n"><ssv:UInt64 value="{size}"/></ssv:Parameter>'
    given = (
        "<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>"
        f'<ssv:ParameterSet version="2.0" name="v"><ssv:Parameters>{value}</ssv:Parameters></ssv:ParameterSet>'
        "</ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>"
    )
    return f'<ssd:Component name="{name}" source="part.fmu">{"" if size is None else given}</ssd:Component>'


def elements(*found: str) -> str:
    return f"<ssd:Elements>{''.join(found)}</ssd:Elements>"


def connectors(*found: str) -> str:
    return f"<ssd:Connectors>{''.join(found)}</ssd:Connectors>"


def inner(name: str) -> str:
    return f'<ssd:System name="{name}">{connectors(connector("in", "<ssc:Dimension/>"))}</ssd:System>'


def fan_out(count: int, size: int) -> str:
    """A connector of a size, and others without one of their own that are joined to it."""
    wires = (f'<ssd:Connection startConnector="big" endElement="s{k}" endConnector="in"/>' for k in range(count))
    big = connectors(connector("big", f'<ssc:Dimension size="{size}"/>'))
    return (
        f"{big}{elements(*(inner(f's{k}') for k in range(count)))}<ssd:Connections>{''.join(wires)}</ssd:Connections>"
    )


MILLION = '<ssc:Dimension size="1000000"/>'
SYSTEMS = {
    "many arrays": connectors(*(connector(f"c{k}", MILLION) for k in range(300))),
    "each below the limit": connectors(*(connector(f"c{k}", '<ssc:Dimension size="90000"/>') for k in range(300))),
    "many dimensions": connectors(connector("c", '<ssc:Dimension size="18446744073709551615"/>' * 500)),
    "a structural parameter": elements(component("a", 900_000)),
    "several FMUs": elements(*(component(f"a{k}", 90_000) for k in range(3))),
    "an FMU and a connector": connectors(connector("c", '<ssc:Dimension size="160000"/>'))
    + elements(component("a", 90_000)),
    "sizes that are passed on": fan_out(50, 80_000),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_what_is_too_large_together_is_refused_before_it_is_made(name: str, tmp_path: Path) -> None:
    path = package(tmp_path, SYSTEMS[name])
    measured = name not in ("several FMUs", "an FMU and a connector")  # what comes before the limit is made
    if measured:
        tracemalloc.start()
    try:
        with pytest.raises(InputError, match=TOO_MANY) as raised, open_ssp(path):
            pass
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert str(raised.value).startswith(f"{path}: ")
    assert "/content/" not in str(raised.value)
    assert peak < MOST_MEMORY


def test_what_is_as_large_as_can_be_is_read(tmp_path: Path) -> None:
    with open_ssp(package(tmp_path, elements(component("a", MOST_VARIABLES - 1)))) as scenario:
        assert len(scenario.system.instances[0].model.variables) == MOST_VARIABLES
    with pytest.raises(FmuError, match=TOO_MANY), open_ssp(package(tmp_path, elements(component("a", MOST_VARIABLES)))):
        pass


def test_a_scenario_has_the_same_limit(tmp_path: Path) -> None:
    package(tmp_path, "")
    text = 'stop = 1.0\nrecord = ["a.x[1]"]\n[master]\nstep = 0.1\n'
    for name in "abc":
        text += f'[instances.{name}]\nfmu = "fmu"\nparameters = {{ n = 90000 }}\n'
    (tmp_path / "s.toml").write_text(text)
    with pytest.raises(ScenarioError, match=rf"s.toml: a system {TOO_MANY} instance c"):
        load_scenario(tmp_path / "s.toml")
    (tmp_path / "s.toml").write_text(text.replace("90000", "900000"))
    with pytest.raises(FmuError, match=rf"instances.a.fmu: .*{TOO_MANY} 'x'"):
        load_scenario(tmp_path / "s.toml")


def test_aliases_and_dependencies_of_arrays_do_not_multiply() -> None:
    aliases = "".join(f'<Alias name="y{k}"/>' for k in range(100))
    with pytest.raises(FmuError, match=TOO_MANY):
        parse_description(description(SIZED.format(alias=aliases).replace('start="2"', 'start="5000"')), "m.fmu")
    arrays = (
        '<Float64 name="u" valueReference="1" causality="input" start="0"><Dimension start="3000"/></Float64>'
        '<Float64 name="y" valueReference="2" causality="output"><Dimension start="3000"/></Float64>'
    )
    tracemalloc.start()
    try:
        found = parse_description(description(arrays, '<Output valueReference="2" dependencies="1"/>'), "m.fmu")
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert found.model.feedthrough["y[3000]"] == {f"u[{k}]" for k in range(1, 3001)}
    assert peak < MOST_MEMORY  # 3000 times 3000 names take 400 MB


# Rings, and chains without an end ------------------------------------------------------------------------------------


def through(name: str) -> str:
    """A system that hands on what it gets."""
    return (
        f'<ssd:System name="{name}">{connectors(connector("in", ""), connector("out", "", "output"))}'
        '<ssd:Connections><ssd:Connection startConnector="in" endConnector="out"/></ssd:Connections></ssd:System>'
    )


def ring(count: int, closed: bool = True) -> str:
    """Systems in a ring, or in a row, that reach no component."""
    wires = "".join(
        f'<ssd:Connection startElement="s{k}" startConnector="out" endElement="s{(k + 1) % count}" endConnector="in"/>'
        for k in range(count if closed else count - 1)
    )
    systems = (through(f"s{k}") for k in range(count))
    return f"{elements(component('a'), *systems)}<ssd:Connections>{wires}</ssd:Connections>"


@pytest.mark.parametrize("count", [1, 2, 7])
def test_a_ring_of_systems_is_told_also_where_it_feeds_nothing(count: int, tmp_path: Path) -> None:
    with (
        pytest.raises(InputError, match=r"\$.s0.in: must not be fed by itself, but is$"),
        open_ssp(package(tmp_path, ring(count))),
    ):
        pass


def test_a_chain_of_systems_has_an_end(tmp_path: Path) -> None:
    half = flow.MOST_HOPS // 2
    with open_ssp(package(tmp_path, ring(half, closed=False))) as scenario:
        assert [i.name for i in scenario.system.instances] == ["a"]
    with (
        pytest.raises(InputError, match=r"\$.Connections: must feed a connector through at most 512 others"),
        open_ssp(package(tmp_path, ring(half + 2, closed=False))),
    ):
        pass


# Times and names without meaning -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "stated",
    [
        'resolution="0" intervalCounter="5"', 'resolution="0" intervalCounter="0"',
        'resolution="7" intervalCounter="0"',
        'intervalDecimal="0"', 'intervalDecimal="-0.5"', 'intervalDecimal="NaN"', 'intervalDecimal="INF"',
        'intervalDecimal="1e-999999999"', 'intervalDecimal="1e999999999"', f'intervalDecimal="0.{"1" * 5000}"',
        'intervalDecimal="1e-400" shiftDecimal="1"',
    ],
)  # fmt: skip
def test_times_of_clocks_without_meaning_are_named(stated: str, tmp_path: Path) -> None:
    clock = f'<ssc:Clock intervalVariability="constant" {stated}/>'
    whole = f'<ssd:Connector name="tick" kind="input">{clock}</ssd:Connector>'
    part = component("a").replace("</ssd:Component>", f"{connectors(whole)}</ssd:Component>")
    with pytest.raises(ScenarioError, match=r"\$.a.tick: the interval of its clock 'tick' must be (pos|a finite)"):
        simulate(package(tmp_path, elements(part)))
    own = f'<Clock name="c" valueReference="1" causality="input" intervalVariability="constant" {stated}/>'
    with pytest.raises(FmuError, match=r"the interval of its clock 'c' must be (positive|a finite number)"):
        parse_description(description(own), "m.fmu")


@pytest.mark.parametrize("source", ["a%00.fmu", "%00", "%00/part.fmu", "part.fmu%00", "..%2f..%2fpart.fmu", "a" * 5000])
def test_odd_names_of_files_are_no_files(source: str, tmp_path: Path) -> None:
    part = component("a").replace("part.fmu", source)
    with pytest.raises(ScenarioError, match=r"\$.a.source: must be a file of the archive, but is"):
        simulate(package(tmp_path, elements(part)))
    binding = f'<ssd:ParameterBindings><ssd:ParameterBinding source="{source}"/></ssd:ParameterBindings>'
    part = component("a").replace("</ssd:Component>", f"{binding}</ssd:Component>")
    with pytest.raises(ScenarioError, match=r"\$.a.ParameterBindings\[0\].source: must be a file of the archive, but"):
        simulate(package(tmp_path, elements(part)))
