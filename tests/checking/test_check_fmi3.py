"""FMI 3.0: the good FMU has no finding, and every broken one is named by the rule that is meant."""

import random
import subprocess
import sys
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from lxml import etree

from benchmarks.fuzz_check import one_case
from orchestrator.checking.check import check_fmu
from orchestrator.checking.xml_reading import check_grammar
from tests.support.ball3 import INTERFACES, LIBRARY, XML, ball_files, build_ball, model_description
from tests.support.broken_ball3 import (
    KICKED,
    PARTIAL,
    QUICK,
    RESIZED,
    SETTABLE,
    SLOPES,
    Edits,
    Mutant,
    behavioural,
    extended,
)
from tests.support.broken_ball3 import STATIC as STATIC_ONLY
from tests.support.broken_ball3_xml import static
from tests.support.broken_fmus import is_of_the_day
from tests.support.c_fmu import have_compiler, write_fmu
from tests.support.c_fmu import model_description as model_description_2
from tests.support.fuzz_fmu import damaged_tree
from tests.support.outlined_findings import outline_of, outlines, probes_for

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not have_compiler(), reason="the FMUs are built with a C compiler on Linux"
)
STATIC = static()
BEHAVIOURAL = behavioural()
OUTLINES = outlines("3")
RECURRING = ("CoSimulation early_always", "CoSimulation event_without_cause", "CoSimulation update_beyond")
"""What recurs over time, and is one finding."""
FIRST = {mutant.rule: mutant.name for mutant in reversed(BEHAVIOURAL)}
NOBODYS = (
    # What none of four other checkers saw.
    "xml identifier of no library", "files library is text", "files folder misspelt", "xml build file missing",
    "files sources without build description", "files neither binary nor sources", "xml start values too few",
    "xml constant without interval", "xml continuous clocked variable", "xml serialise without save", "xml empty token",
)  # fmt: skip


@pytest.mark.parametrize("interface", INTERFACES)
def test_the_good_fmu_has_no_finding(interface: str, tmp_path: Path) -> None:
    report = check_fmu(build_ball(tmp_path, "", interface), QUICK)
    assert report.findings == ()
    assert report.executed
    assert report.version == "3.0"


def test_an_update_of_a_trial_step_may_lie_after_the_next_one(tmp_path: Path) -> None:
    report = check_fmu(build_ball(tmp_path, "update_trial"), QUICK)
    assert report.findings == ()


def test_a_discarded_step_is_done_in_shorter_ones(tmp_path: Path) -> None:
    report = check_fmu(build_ball(tmp_path, "discard_long"), QUICK)
    assert {f.rule for f in report.findings} == {"step.discarded"}
    assert {stage for stage, reason in report.executions[0].stages.items() if reason} == {"derivatives"}


def test_discrete_inputs_stay_in_continuous_time_mode(tmp_path: Path) -> None:
    files = ball_files("input_discrete", "ModelExchange")
    changed = (
        files[XML]
        .replace(b'name="u"', b'name="u" variability="discrete"')
        .replace(b'\n        intermediateUpdate="true"/>', b"/>")
    )
    report = check_fmu(write_fmu(tmp_path / "discrete.fmu", files | {XML: changed}), QUICK)
    assert report.findings == ()
    assert report.executed


@pytest.mark.parametrize(
    ("interface", "edits", "fault", "stage"),
    [
        ("CoSimulation", SLOPES, "", "derivatives"),
        ("ModelExchange", PARTIAL, "", "derivatives"),
        ("CoSimulation", KICKED, "", "clocks"),
        ("ModelExchange", KICKED, "", "clocks"),
        ("CoSimulation", RESIZED, "", "configuration"),
        pytest.param("ModelExchange", RESIZED, "", "configuration", marks=pytest.mark.night),
        ("CoSimulation", SETTABLE, "interval_wanted", "clocks"),
    ],
    ids=[
        "output derivatives",
        "partial derivatives",
        "kick",
        "kick of a model",
        "resized",
        "resized model",
        "interval",
    ],
)
@pytest.mark.parametrize("every", [False, pytest.param(True, marks=pytest.mark.night)], ids=["its probe", "all probes"])
def test_what_more_a_description_promises_is_probed(
    interface: str, edits: Edits, fault: str, stage: str, every: bool, tmp_path: Path
) -> None:
    options = replace(QUICK, probes=() if every else ("life cycle", "inputs", stage))
    report = check_fmu(write_fmu(tmp_path / "more.fmu", extended(fault, interface, edits)), options)
    assert report.findings == ()
    assert report.executions[0].stages[stage] == ""


def test_an_event_may_change_what_is_hidden(tmp_path: Path) -> None:
    assert check_fmu(build_ball(tmp_path, "event_silent"), QUICK).findings == ()


def test_a_text_with_an_attribute_start_is_one_finding(tmp_path: Path) -> None:
    files = ball_files()
    old = b'variability="fixed"><Start value="ball"/></String>'
    assert files[XML].count(old) == 1
    changed = files[XML].replace(old, b'variability="fixed" start="two words"/>')
    report = check_fmu(write_fmu(tmp_path / "text.fmu", files | {XML: changed}), STATIC_ONLY)
    assert [f.rule for f in report.findings] == ["schema.invalid"]


def test_a_solver_goes_on_in_shorter_steps_where_derivatives_are_discarded(tmp_path: Path) -> None:
    report = check_fmu(build_ball(tmp_path, "discard_below", "ModelExchange"), QUICK)
    assert report.findings == ()
    assert report.executed


def _check_findings(mutant: Mutant, folder: Path, probes: tuple[str, ...] = ()) -> None:
    path = folder / "broken.fmu"
    mutant.make(path)
    report = check_fmu(path, replace(mutant.options, probes=probes))
    named = [f.rule for f in report.findings]
    assert mutant.rule in named
    assert outline_of(report) == OUTLINES[mutant.name]
    if mutant.name in RECURRING:
        assert named.count(mutant.rule) == 1


@pytest.mark.parametrize("mutant", STATIC, ids=lambda m: m.name)
def test_what_is_read_is_named_by_its_rule(mutant: Mutant, tmp_path: Path) -> None:
    _check_findings(mutant, tmp_path)


IN_FMI_3 = {mutant.name.partition(" ")[2] for mutant in BEHAVIOURAL if mutant.name.startswith("CoSimulation")}
# By day for another interface, or with the plants of test_check_plants.py.
AT_NIGHT = ("CoSimulation reset_clock", "CoSimulation state_clock", "ModelExchange directional_wrong")


def marks_of(mutant: Mutant) -> Any:
    interface, _, fault = mutant.name.partition(" ")
    if mutant.name in AT_NIGHT or (interface == "CoSimulation" and not is_of_the_day(fault, "3.0", IN_FMI_3)):
        return pytest.mark.night
    return () if FIRST[mutant.rule] == mutant.name else pytest.mark.slow


@pytest.mark.parametrize("mutant", [pytest.param(m, marks=marks_of(m)) for m in BEHAVIOURAL], ids=lambda m: m.name)
def test_behaviour_is_named_by_its_rule(mutant: Mutant, tmp_path: Path) -> None:
    _check_findings(mutant, tmp_path, probes_for(OUTLINES[mutant.name]))


@pytest.mark.night
@pytest.mark.parametrize("mutant", BEHAVIOURAL, ids=lambda m: m.name)
def test_all_probes_find_no_more(mutant: Mutant, tmp_path: Path) -> None:
    _check_findings(mutant, tmp_path)


def test_a_state_that_is_not_nulled_is_that_of_the_function_of_fmi3(tmp_path: Path) -> None:
    report = check_fmu(build_ball(tmp_path, "state_not_nulled"), QUICK)
    assert [f.message.split()[0] for f in report.findings] == ["fmi3FreeFMUState"]


def test_there_are_many_and_each_has_a_name() -> None:
    assert [m.name for m in (*STATIC, *BEHAVIOURAL)] == list(OUTLINES)
    assert len(STATIC) >= 150
    assert len(BEHAVIOURAL) >= 40


@pytest.mark.parametrize("name", NOBODYS)
def test_no_green_for_what_nobody_sees(name: str, tmp_path: Path) -> None:
    (mutant,) = (m for m in STATIC if m.name == name)
    path = tmp_path / "broken.fmu"
    mutant.make(path)
    report = check_fmu(path, replace(QUICK, static=False, probes=("life cycle",)))
    assert mutant.rule in {f.rule for f in report.findings}
    assert not report.ok


@pytest.mark.parametrize("version", ["2", "3"])
def test_the_grammar_accepts_what_the_schema_accepts(version: str) -> None:
    path = Path(str(files("fmpy"))) / "schema" / f"fmi{version}" / f"fmi{version}ModelDescription.xsd"
    schema = etree.XMLSchema(etree.parse(str(path)))
    good = (model_description() if version == "3" else model_description_2()).encode()
    rng = random.Random(3)
    valid = 0
    for _ in range(300):
        root = etree.fromstring(damaged_tree(rng, good))
        if root.tag != "fmiModelDescription" or (version == "2" and root.get("fmiVersion") != "2.0"):
            continue
        accepted = bool(schema.validate(root))
        valid += accepted
        assert accepted == (not list(check_grammar(root, f"{version}.0"))), etree.tostring(root)
    assert valid > 10


def test_damage_gives_findings_and_nothing_else(tmp_path: Path) -> None:
    rng = random.Random(7)
    codes = [one_case(rng, tmp_path, run_share=0.05, version="3.0")[0] for _ in range(40)]
    assert set(codes) <= {0, 1}
    assert 1 in codes


def test_a_library_without_functions_is_a_finding(tmp_path: Path) -> None:
    subprocess.run(["cc", "-shared", "-xc", "-", "-o", str(tmp_path / "empty")], input=b"int empty;", check=True)
    library = (tmp_path / "empty").read_bytes()
    report = check_fmu(write_fmu(tmp_path / "Empty.fmu", ball_files() | {LIBRARY: library}))
    told = {f.message for f in report.findings if f.rule == "binary.exports"}
    assert "fmi3GetVersion must be exported, but is not" in told
