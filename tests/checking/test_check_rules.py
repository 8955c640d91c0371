"""Rules one by one, where no whole FMU is needed."""

import csv
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from orchestrator.checking import xml_reading
from orchestrator.checking.archive import ArchiveLimits
from orchestrator.checking.catalogue import RULES
from orchestrator.checking.check import CheckOptions, check_fmu
from orchestrator.checking.description_reading import read_description
from orchestrator.checking.findings import Finding, FmuFindings, order_findings
from orchestrator.checking.formats.junit import as_junit
from orchestrator.checking.formats.text import as_lines
from orchestrator.checking.layered import _read_csv
from orchestrator.checking.policy import Policy
from orchestrator.checking.rules_model import check_model
from orchestrator.checking.rules_structure import check_structure
from orchestrator.checking.rules_variables import check_variables
from orchestrator.checking.units import dimension_of
from orchestrator.checking.verdict import judge
from orchestrator.checking.xml_reading import check_grammar
from tests.support.c_fmu import fmu_files, have_compiler, model_description, write_fmu
from tools.rules_page import PAGE, page


def rules_of(text: str) -> set[str]:
    """Rules of the modelDescription alone that ``text`` violates."""
    description = read_description(etree.fromstring(text.encode()))
    return {f.rule for f in (*check_variables(description), *check_model(description), *check_structure(description))}


def variables(*lines: str, convention: str = "flat", head: str = "") -> str:
    """A modelDescription with the given ScalarVariables and an exact InitialUnknowns for none."""
    return (
        f'<fmiModelDescription fmiVersion="2.0" variableNamingConvention="{convention}"><CoSimulation/>{head}'
        f"<ModelVariables>{''.join(lines)}</ModelVariables><ModelStructure/></fmiModelDescription>"
    )


def real(name: str, reference: int = 0, attributes: str = 'causality="parameter" variability="fixed"') -> str:
    return f'<ScalarVariable name="{name}" valueReference="{reference}" {attributes}><Real start="1"/></ScalarVariable>'


@pytest.mark.parametrize(
    "name", ["x", "_x1", "a.b[1,2].c", "der(x)", "der(a.b[3],2)", "'odd name'.x", "'it\\'s'", "a['1']"[:1]]
)
def test_structured_names_that_are_valid(name: str) -> None:
    assert rules_of(variables(real(name), convention="structured")) == set()


@pytest.mark.parametrize("name", ["1x", "a..b", "a b", "a[1", "a[]", "der(x", "a.", "'", "a-b", "der(der(x))"])
def test_structured_names_that_are_not_valid(name: str) -> None:
    assert rules_of(variables(real(name), convention="structured")) == {"variable.name-structured"}


def test_flat_names_may_be_anything_but_control_characters() -> None:
    assert rules_of(variables(real("1 ä-b"))) == set()
    assert rules_of(variables(real("a&#9;b"))) == {"variable.name-flat"}


CONSTANT = 'causality="local" variability="constant"'


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (variables(real("a", 0, CONSTANT), real("b", 0, CONSTANT)), set()),
        (variables(real("a", 0, CONSTANT), real("b", 0, CONSTANT).replace('"1"', '"2"')), {"variable.alias-start"}),
        (variables(real("a", 0), real("b", 1)), set()),
        (variables(real("a", 0), real("b", 0)), {"variable.alias-settable"}),
    ],
    ids=["equal constants", "different constants", "no aliases", "two parameters"],
)
def test_aliases(text: str, expected: set[str]) -> None:
    assert rules_of(text) == expected


def test_vendor_annotations_are_unique() -> None:
    twice = '<VendorAnnotations><Tool name="a"/><Tool name="a"/></VendorAnnotations>'
    assert rules_of(variables(real("a"), head=twice)) == {"model.vendor-annotation"}


def test_the_good_description_breaks_no_rule_and_paths_are_xpaths() -> None:
    assert rules_of(model_description()) == set()
    root, problems = xml_reading.parse(model_description().replace('start="40"', 'start="-40"').encode(), "m.xml")
    assert problems == []
    assert root is not None
    (finding,) = check_variables(read_description(root))
    file, _, path = finding.path.partition(":")
    assert file == "modelDescription.xml"
    assert root.xpath(path) == ["-40"]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("N.m", {"kg": 1, "m": 2, "s": -2}),
        ("N.m.s/rad", {"kg": 1, "m": 2, "s": -1}),
        ("rad/(N.m)", {"kg": -1, "m": -2, "s": 2}),
        ("kg.m2", {"kg": 1, "m": 2}),
        ("m/s2", {"m": 1, "s": -2}),
        ("s^-1", {"s": -1}),
        ("1", {}),
        ("furlong", None),
        ("m/s/s", {"m": 1, "s": -2}),
        ("", None),
    ],
)
def test_dimensions_of_unit_names(name: str, expected: dict[str, int] | None) -> None:
    found = dimension_of(name)
    assert (None if found is None else {k: v for k, v in found.items() if v}) == expected


def test_a_document_type_is_refused_in_any_encoding() -> None:
    text = '<?xml version="1.0" encoding="{}"?><!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><a>&b;</a>'
    for encoding in ("UTF-8", "UTF-16", "ISO-8859-1"):
        root, findings = xml_reading.parse(text.format(encoding).encode(encoding), "a.xml")
        assert root is None
        assert [f.rule for f in findings] == ["xml.doctype"]


def test_an_unpacked_fmu_is_checked_too(tmp_path: Path) -> None:
    (tmp_path / "modelDescription.xml").write_text(model_description(), encoding="utf-8")
    (tmp_path / "resources").mkdir()
    (tmp_path / "resources" / "link").symlink_to("/etc/passwd")
    report = check_fmu(tmp_path, CheckOptions(archive=ArchiveLimits()))
    assert {f.rule for f in report.findings} == {"archive.symlink", "binary.none"}
    assert not report.executed


def test_errors_come_first_and_repeats_go() -> None:
    warning, error = Finding("file.icon", "model.png", "w"), Finding("model.guid", "", "e")
    assert order_findings([warning, error, warning]) == (error, warning)
    with pytest.raises(KeyError, match="must be one of RULES"):
        Finding("no.such-rule", "", "")


def test_equal_findings_are_one() -> None:
    found = order_findings(Finding("model.guid", f"m.xml:/a[{i}]", "the same") for i in range(3))
    assert found == (Finding("model.guid", "m.xml:/a[0]", "the same (at 3 places)"),)
    of_probes = [Finding("run.crash", f"({interface}, inputs)", "the same") for interface in ("A", "B")]
    assert order_findings(of_probes) == tuple(of_probes)


def test_hostile_names_reach_neither_terminal_nor_junit() -> None:
    report = FmuFindings("x.fmu", (Finding("archive.odd-name", "a\x1b[31m\nfake: no findings", "<&\"'\x00"),))
    verdict = judge(report, Policy())
    assert all("\x1b" not in line and "\n" not in line for line in as_lines(verdict))
    suite = etree.fromstring(as_junit([verdict]).encode())[0]
    assert suite.get("tests") == str(len(RULES))
    assert suite.get("failures") == "0"


def test_the_documentation_lists_every_rule() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert text == page(), "run `python -m tools.rules_page`"


@given(st.binary(max_size=300) | st.text(max_size=200).map(lambda t: f"<a b='{t}'/>".encode(errors="replace")))
@settings(max_examples=200)
def test_any_bytes_are_xml_or_a_finding(data: bytes) -> None:
    root, findings = xml_reading.parse(data, "a.xml")
    assert root is not None or len(findings) == 1


_CELL = st.text(st.characters(blacklist_categories=()), max_size=6) | st.floats().map(str)


@given(st.lists(st.lists(_CELL, max_size=4), max_size=6), st.binary(max_size=20))
@settings(max_examples=200)
def test_any_bytes_are_a_reference_result_or_refused(rows: list[list[str]], tail: bytes) -> None:
    data = b"time,x\n0,1\n" + "\n".join(",".join(r) for r in rows).encode(errors="replace") + tail
    d = read_description(etree.fromstring(variables(real("x"))))
    try:
        result = _read_csv("r.csv", data, {v.name: v for v in d.variables}, d)
    except (ValueError, csv.Error):
        return
    assert result.names == ("x",)
    assert all(len(r) == 2 for r in result.rows)


def test_an_outcome_per_rule_says_what_was_run(tmp_path: Path) -> None:
    if not have_compiler():
        pytest.skip("the FMU is built with a C compiler")
    from tests.support.broken_fmus import QUICK, good

    report = check_fmu(good(tmp_path / "good.fmu"), QUICK)
    assert {o.rule for o in report.outcomes} == {n for n, rule in RULES.items() if "2.0" in rule.versions}
    not_passed = {o.rule for o in report.outcomes if o.outcome != "passed"}
    assert not_passed == {"interfaces.differ"}  # it has one interface
    static = check_fmu(tmp_path / "good.fmu", CheckOptions(static=True))
    not_run = {o.rule for o in static.outcomes if o.outcome == "not run"}
    assert not_run == {o.rule for o in static.outcomes if RULES[o.rule].stage not in static.stages}
    assert {o.reason for o in static.outcomes if o.outcome == "not run"} == {"nothing is executed, as was asked"}
    short = check_fmu(tmp_path / "good.fmu", replace(QUICK, probes=("life cycle", "misuse")))
    assert [e.stages_run for e in short.executions] == [
        ("load", "life cycle", "misuse", "run", "process", "afterwards")
    ]


NEWER = 'previous="0" clocks="0" intermediateUpdate="true" intervalVariability="constant" maxSize="1" priority="1"'
WITHIN = '<Alias name="other"/><Dimension start="-1"/>'


def test_what_is_of_fmi_3_in_a_description_of_2_is_told_by_the_schema_alone() -> None:
    text = model_description()
    plain = rules_of(text)
    text = text.replace("<ScalarVariable ", f"<ScalarVariable {NEWER} ").replace(
        "</ScalarVariable>", f"{WITHIN}</ScalarVariable>"
    )
    text = text.replace("<CoSimulation ", '<CoSimulation hasEventMode="false" needsExecutionTool="false" ')
    text = text.replace("</ModelStructure>", '<ClockedState valueReference="0"/><EventIndicator/></ModelStructure>')
    assert text.count("previous") > 5
    root = etree.fromstring(text.encode())
    assert rules_of(text) == plain
    assert {f.rule for f in check_grammar(root, "2.0")} == {"schema.invalid"}


@pytest.mark.skipif(not have_compiler(), reason="the FMU is built with a C compiler")
def test_no_rule_speaks_of_a_version_that_it_is_not_for(tmp_path: Path) -> None:
    text = model_description().replace("<ScalarVariable ", f"<ScalarVariable {NEWER} ")
    path = write_fmu(tmp_path / "a.fmu", fmu_files() | {"modelDescription.xml": text.encode()})
    findings = check_fmu(path, CheckOptions(static=True)).findings
    assert [f.rule for f in findings if "2.0" not in RULES[f.rule].versions] == []
    assert len(findings) <= 6  # one for each attribute: they are not in the schema


def unit_findings(*units: str, variables: str = "") -> list[Finding]:
    text = f'<fmiModelDescription fmiVersion="3.0"><UnitDefinitions>{"".join(units)}</UnitDefinitions>'
    text += f"<ModelVariables>{variables}</ModelVariables><ModelStructure/></fmiModelDescription>"
    found = check_model(read_description(etree.fromstring(text.encode())))
    return [f for f in found if f.rule.startswith("unit.")]


def unit(name: str, base: str, *shown: str) -> str:
    """A unit with display units, each written ``name attributes``."""
    inner = "".join(f'<DisplayUnit name="{s.split(" ", 1)[0]}" {s.partition(" ")[2]}/>' for s in shown)
    return f'<Unit name="{name}"><BaseUnit {base}/>{inner}</Unit>'


@pytest.mark.parametrize(
    "text",
    [
        unit("rad", 'rad="1"', 'deg factor="57.29578"', 'rev factor="0.159"', "rad"),
        unit("rad/s", 'rad="1" s="-1"', 'rpm factor="9.5493"', 'deg/s factor="57.3"', 'Hz factor="0.159155"'),
        unit("K", 'K="1"', 'degC offset="-273.15"', 'degC_x offset="3"'),
        unit("degC", 'K="1" offset="273.15"', 'K offset="273.15"'),
        unit("deg", 'rad="1" factor="0.0174533"', 'rad factor="0.01745"'),
        unit("m", 'm="1"', 'mm factor="1000"', 'furlong factor="7"'),
        unit("bar", 'kg="1" m="-1" s="-2" factor="1e5"', 'Pa factor="1e5"', 'MPa factor="0.1"'),
        unit("N.m/rad", 'kg="1" m="2" s="-2"'),  # stiffness is often written without its angle
        unit("rev", 'rad="0"') + unit("rpm", 's="-1" factor="0.016667"') + unit("rev/s", 's="-1"'),  # counted
        unit("%", ""),  # percent as a unit of its own
        unit("g", 'm="1" s="-2" factor="9.81"') + unit("U", 'kg="1"') + unit("t", 's="1"'),  # of more things
        unit("s", 's="1"', 'Hz factor="1" inverse="true"', 'min factor="0.016667"', 'h factor="2.77778e-4"'),
        '<Unit name="radian"/><Unit name="deg"><DisplayUnit name="x"/></Unit>',
    ],
)
def test_units_that_are_right_or_not_certain(text: str) -> None:
    assert unit_findings(text) == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (unit("radian", 'rad="0"'), "the unit `radian`, which has an angle, must have rad=1"),
        (unit("rad/s", 's="-1"'), "the unit `rad/s`, which has an angle"),
        (unit("deg", 'factor="0.01745"'), "the unit `deg`, which has an angle"),
        (unit("rad", 'rad="1"', 'deg factor="0.0174533"'), "`deg` of the unit `rad` has factor 0.0174533"),
        (unit("rad/s", 'rad="1" s="-1"', 'rpm factor="0.10472"'), "factor 9.5493 is right: the wrong way round"),
        (unit("m", 'm="1"', "mm"), "DisplayUnit `mm` of the unit `m` must have factor 1000"),
        (unit("K", 'K="1"', 'degC offset="273.15"'), "offset -273.15 is right: the wrong way round"),
        (unit("K", 'K="1"', "degC"), "must have factor 1 and offset -273.15"),
        (unit("mm", 'm="1"'), "BaseUnit of the unit `mm` must have factor 0.001"),
        (unit("deg", 'rad="1" factor="57.29578"'), "BaseUnit of the unit `deg` must have factor 0.0174533"),
        (unit("degC", 'K="1"'), "must have factor 1 and offset 273.15"),
        (unit("s", 's="1"', 'Hz factor="1"'), "must have factor 1 and inverse"),
        (unit("m", 'm="1"', 'cm factor="100" inverse="true"'), "must have factor 100 to be what the names say"),
    ],
)
def test_units_that_contradict_their_names(text: str, words: str) -> None:
    (finding,) = unit_findings(text)
    assert words in finding.message
    assert finding.severity == "warning"


def test_display_units_that_are_all_the_wrong_way_round_are_one_finding() -> None:
    shown = ('mm factor="0.001"', 'cm factor="0.01"', 'km factor="1000"', 'um factor="1e-6"')
    (finding,) = unit_findings(unit("m", 'm="1"', *shown), unit("s", 's="1"', 'ms factor="0.001"'))
    assert "and 2 more" in finding.message


def test_the_offset_of_a_unit_of_differences_does_not_count() -> None:
    kelvin = unit("degC", 'K="1"')
    variable = '<Float64 name="{}" valueReference="{}" unit="degC" {}/>'
    difference = variable.format("a", 1, 'relativeQuantity="true"')
    assert unit_findings(kelvin, variables=difference) == []
    assert len(unit_findings(kelvin, variables=difference + variable.format("b", 2, ""))) == 1
