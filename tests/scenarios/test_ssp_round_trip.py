"""Values come back through any legal package: units, mappings, prefixes, connectors of systems, transformations."""

import zipfile

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.scenarios.ssp.read import open_ssp
from tests.scenarios.test_ssp_systems import SPACES, connector, connectors, system, wire
from tests.support.answers_fmu import build_answers_fmu
from tests.support.c_fmu import have_compiler

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")
UNITS = {
    "K": (1.0, 0.0), "mK": (1e-3, 0.0), "degC": (1.0, 273.15), "degF": (5.0 / 9.0, 459.67 * 5.0 / 9.0),
    "hK": (100.0, 0.0),
}  # fmt: skip
FMU_UNIT = "K"
number = st.floats(-1e3, 1e3, allow_subnormal=False).map(lambda x: round(x, 6))
linear = st.none() | st.tuples(st.sampled_from([2.0, -1.0, 0.25, 1e-3, 1.0]), st.sampled_from([0.0, 5.0, -273.15]))
unit = st.sampled_from(["", *UNITS])


def declared(space):
    rows = (
        f'<ssc:Unit name="{name}"><ssc:BaseUnit K="1" factor="{f!r}" offset="{o!r}"/></ssc:Unit>'
        for name, (f, o) in UNITS.items()
    )
    return f"<{space}:Units>{''.join(rows)}</{space}:Units>"


def converted(x, source, target):
    """A number in another unit; without one of the two it stays."""
    if not source or not target:
        return x
    (f, o), (g, p) = UNITS[source], UNITS[target]
    return (f * x + o - p) / g


def transformed(x, rule):
    return x if rule is None else rule[0] * x + rule[1]


def inside(rule):
    return "" if rule is None else f'<ssc:LinearTransformation factor="{rule[0]!r}" offset="{rule[1]!r}"/>'


@st.composite
def ways(draw):
    """A value of ``gain``, how it gets there, and what it must be in the FMU's unit."""
    x, said, own = draw(number), draw(unit), draw(unit)
    mapped, rule, suppress = draw(st.booleans()), draw(linear), draw(st.booleans())
    level = draw(st.sampled_from(["component", "system", "connector"]))
    way = {"x": x, "unit": said, "own": own, "level": level, "mapped": mapped, "rule": rule, "suppress": suppress}
    way |= {"prefix": draw(st.booleans()), "file": draw(st.booleans()), "hold": draw(unit), "wired": draw(linear)}
    first = own or FMU_UNIT  # that counts where the value arrives
    if level == "connector":
        first = way["hold"] or first
    y = transformed(converted(x, "" if suppress else said, first), rule) if mapped else converted(x, said, first)
    if level == "connector":
        if way["wired"] and not own:  # what a transformation acts in is then not stated
            way["wired"] = None
        y = transformed(converted(y, first, own or FMU_UNIT), way["wired"])
    return way, converted(y, own or FMU_UNIT, FMU_UNIT)


def write(folder, way):
    """Write the package of a way."""
    source = "G" if way["mapped"] else {"component": "gain", "system": "a.gain", "connector": "H"}[way["level"]]
    target = {"component": "gain", "system": "a.gain", "connector": "H"}[way["level"]]
    prefix = ""
    if way["prefix"] and way["level"] == "system":
        prefix, target = "a.", "gain"
        source = source if way["mapped"] else "gain"
    given_unit = f' unit="{way["unit"]}"' if way["unit"] else ""
    kind = 'xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" '
    kind += 'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" '
    kind += 'xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping"'
    values = (
        f'<ssv:ParameterSet {kind} version="1.0" name="v"><ssv:Parameters><ssv:Parameter name="{source}">'
        f'<ssv:Real value="{way["x"]!r}"{given_unit}/></ssv:Parameter></ssv:Parameters>{declared("ssv")}'
        "</ssv:ParameterSet>"
    )
    rules = (
        f'<ssm:ParameterMapping {kind} version="1.0"><ssm:MappingEntry source="{source}" target="{target}" '
        f'suppressUnitConversion="{str(way["suppress"]).lower()}">{inside(way["rule"])}</ssm:MappingEntry>'
        "</ssm:ParameterMapping>"
    )
    mapping = ""
    if way["mapped"]:
        mapping = (
            '<ssd:ParameterMapping source="resources/map%20one.ssm"/>'
            if way["file"]
            else f"<ssd:ParameterMapping>{rules}</ssd:ParameterMapping>"
        )
    held = "" if way["file"] else f"<ssd:ParameterValues>{values}</ssd:ParameterValues>"
    named = ' source="resources/set.ssv"' if way["file"] else ""
    begun = f' prefix="{prefix}"' if prefix else ""
    bound = (
        f"<ssd:ParameterBindings><ssd:ParameterBinding{named}{begun}>{held}{mapping}</ssd:ParameterBinding>"
        "</ssd:ParameterBindings>"
    )
    at_part = bound if way["level"] == "component" else ""
    part = (
        '<ssd:Component name="a" source="resources/part.fmu">'
        f"{connectors(connector('gain', 'parameter', unit=way['own']))}{at_part}</ssd:Component>"
    )
    above, wires = "" if at_part else bound, ""
    if way["level"] == "connector":
        above = connectors(connector("H", "parameter", unit=way["hold"])) + bound
        wires = wire("H", "a/gain", inside(way["wired"]))
    text = (
        f'<ssd:SystemStructureDescription{SPACES} version="1.0" name="p">{system(above, part, wires)}{declared("ssd")}'
        '<ssd:DefaultExperiment startTime="0" stopTime="1"/></ssd:SystemStructureDescription>'
    )
    path = folder / "package.ssp"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("SystemStructure.ssd", text)
        archive.write(folder / "part.fmu", "resources/part.fmu")
        if way["file"]:
            archive.writestr("resources/set.ssv", values)
            archive.writestr("resources/map one.ssm", rules)
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("round")
    build_answers_fmu(made, parameters=True, unit=FMU_UNIT).rename(made / "part.fmu")
    return made


@settings(max_examples=200, database=None)
@given(found=ways())
def test_a_value_comes_back_through_units_and_mappings(folder, found):
    way, expected = found
    with open_ssp(write(folder, way)) as scenario:
        got = scenario.system.instances[0].start["gain"]
    assert got == pytest.approx(expected, rel=1e-9, abs=1e-9 * max(1.0, abs(way["x"])))
