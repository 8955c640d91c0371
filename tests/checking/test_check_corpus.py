"""Every broken FMU is named by its rule and by no other; the FMU they are made from has no finding."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.checking.catalogue import RULES
from orchestrator.checking.check import CheckOptions, check_fmu
from orchestrator.shared.isolation.limits import Limits
from tests.support.broken_ball3 import behavioural
from tests.support.broken_ball3_xml import static
from tests.support.broken_fmus import ALONE, QUICK, Broken, corpus, good, is_of_the_day
from tests.support.broken_plants import broken_plants
from tests.support.c_fmu import REFERENCE, build_c_fmu, fmu_files, have_compiler, write_fmu
from tests.support.outlined_findings import outline_of, outlines, probes_for

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not have_compiler(), reason="the FMUs are built with a C compiler on Linux"
)
DOCS = Path(__file__).parents[2] / "docs" / "check.md"
CORPUS = corpus() if have_compiler() else []
OUTLINES = outlines("2")
MORE = {"behaviour set_has_effect": {"value.order"}, "behaviour hidden_state": {"derivative.value"}}
"""Faults that break another rule as well."""


def test_the_good_fmu_has_no_finding(tmp_path: Path) -> None:
    report = check_fmu(good(tmp_path / "good.fmu"), QUICK)
    assert report.findings == ()
    assert report.executed


IN_FMI_3 = {mutant.name.partition(" ")[2] for mutant in behavioural() if mutant.name.startswith("CoSimulation")}


def is_by_day(broken: Broken) -> bool:
    kind, _, fault = broken.name.partition(" ")
    return kind != "behaviour" or (fault not in ALONE and is_of_the_day(fault, "2.0", IN_FMI_3))


@pytest.mark.parametrize(
    "broken",
    [pytest.param(b, marks=() if is_by_day(b) else pytest.mark.night) for b in CORPUS],
    ids=lambda b: b.name,
)
def test_names_the_rule(broken: Broken, tmp_path: Path) -> None:
    _check_findings(broken, tmp_path, probes_for(OUTLINES[broken.name]))


@pytest.mark.night
@pytest.mark.parametrize("broken", [b for b in CORPUS if not b.options.static], ids=lambda b: b.name)
def test_all_probes_find_no_more(broken: Broken, tmp_path: Path) -> None:
    _check_findings(broken, tmp_path)


def _check_findings(broken: Broken, folder: Path, probes: tuple[str, ...] = ()) -> None:
    path = folder / "broken.fmu"
    broken.make(path)
    report = check_fmu(path, replace(broken.options, probes=probes))
    named = {f.rule for f in report.findings if f.severity != "info" or f.rule == broken.rule}
    assert named == {broken.rule} | MORE.get(broken.name, set()), "\n".join(
        f"{f.rule} {f.path}: {f.message}" for f in report.findings
    )
    assert outline_of(report) == OUTLINES[broken.name]


@pytest.mark.parametrize(
    ("behaviour", "old", "new"),
    [
        ("asynchronous", "canHandleVar", 'canRunAsynchronuously="true" canHandleVar'),
        ("ends_early", "canHandleVar", "canHandleVar"),
        # By day in test_check_relations.py.
        pytest.param(
            "instantiate_once",
            "canHandleVar",
            'canBeInstantiatedOnlyOncePerProcess="true" canHandleVar',
            marks=pytest.mark.night,
        ),
        ("variable_refused", 'StepSize="true"', 'StepSize="false"'),
        ("state_refused", 'canGetAndSetFMUstate="true" canSerializeFMUstate="true"', ""),
        ("serialised_empty", 'canSerializeFMUstate="true"', ""),
    ],
)
def test_what_the_flags_do_not_promise_is_not_asked_for(behaviour: str, old: str, new: str, tmp_path: Path) -> None:
    files = fmu_files(behaviour)
    xml = " ".join(files["modelDescription.xml"].decode().split())
    assert xml.count(old) == 1
    path = write_fmu(tmp_path / "flags.fmu", files | {"modelDescription.xml": xml.replace(old, new).encode()})
    report = check_fmu(path, QUICK)
    assert report.findings == ()
    assert report.executed


def test_inputs_are_set_in_initialisation_mode_and_not_before(tmp_path: Path) -> None:
    files = fmu_files("input_late")
    path = f"{REFERENCE}/MassSpring_out.csv"
    rows = files[path].decode().splitlines()
    files[path] = "\n".join([rows[0] + ",force", *(row + ",0" for row in rows[1:])]).encode()
    report = check_fmu(write_fmu(tmp_path / "late.fmu", files), QUICK)
    assert report.findings == ()
    assert not any(report.executions[0].stages.values())


@pytest.mark.parametrize(("tolerance", "rule"), [(b"1e-6", "state.restore"), (b"1e-4", "run.inexact")])
def test_a_restored_state_is_exact_to_what_the_tolerance_allows(tolerance: bytes, rule: str, tmp_path: Path) -> None:
    files = fmu_files("state_coarse")
    xml = files["modelDescription.xml"].replace(b'tolerance="1e-6"', b'tolerance="' + tolerance + b'"')
    report = check_fmu(write_fmu(tmp_path / "coarse.fmu", files | {"modelDescription.xml": xml}), QUICK)
    assert {f.rule for f in report.findings} == {rule}


def test_a_crash_is_not_hidden_by_the_state_that_is_left(tmp_path: Path) -> None:
    report = check_fmu(build_c_fmu(tmp_path, "crash_restore"), QUICK)
    (finding,) = (f for f in report.findings if f.rule == "run.crash")
    assert finding.message.endswith("during fmi2SetFMUstate")


def test_a_discarded_step_is_done_in_shorter_ones(tmp_path: Path) -> None:
    report = check_fmu(build_c_fmu(tmp_path, "discard_long"), QUICK)
    assert {f.rule for f in report.findings} == {"step.discarded"}
    assert not any(report.executions[0].stages.values())


def test_a_run_ends_before_a_step_that_is_discarded_at_any_size(tmp_path: Path) -> None:
    report = check_fmu(build_c_fmu(tmp_path, "discard_step"), QUICK)
    assert {f.rule for f in report.findings} == {"step.discarded"}
    assert report.ok
    assert {stage for stage, reason in report.executions[0].stages.items() if reason} == {
        "variable steps",
        "reference",
        "derivatives",
    }


def test_an_fmu_that_discards_its_first_step_at_any_size_does_not_pass(tmp_path: Path) -> None:
    report = check_fmu(build_c_fmu(tmp_path, "discard_first"), QUICK)
    assert {f.rule for f in report.findings if f.severity == "error"} == {"run.status"}


def test_a_hang_after_misuse_is_a_warning_as_a_crash_is(tmp_path: Path) -> None:
    report = check_fmu(build_c_fmu(tmp_path, "hang_negative_step"), CheckOptions(limits=Limits(time=10.0)))
    assert {f.rule for f in report.findings if f.severity != "info"} == {"misuse.crash"}


def test_an_fmu_that_writes_to_our_pipe_forges_no_finding(tmp_path: Path) -> None:
    report = check_fmu(build_c_fmu(tmp_path, "forged_messages"), QUICK)
    assert report.findings == ()


def test_the_corpus_is_large_and_covers_the_rules() -> None:
    covered = {b.rule for b in CORPUS} | {m.rule for m in (*behavioural(), *static(), *broken_plants())}
    assert len(CORPUS) >= 40
    assert f"{len(CORPUS)} FMUs, each broken by one mutation" in DOCS.read_text(encoding="utf-8")
    assert [b.name for b in CORPUS] == list(OUTLINES)
    uncovered = {r for r, rule in RULES.items() if rule.severity != "info"} - covered
    assert uncovered == NOT_IN_THE_CORPUS


# Rules that no single mutation of the C FMU shows; test_check_rules.py and test_check_relations.py have them.
NOT_IN_THE_CORPUS = {
    "clock.inactive-change",
    "event.again",
    "log.effect",
    "misuse.clock",
    "model.vendor-annotation",
    "partition.thread",
    "path.letters",
    "process.environment",
    "process.settings",
    "process.signals",
    "promise.completed-step",
    "resources.leak",
    "run.failed",
    "run.moved-crash",
    "run.not-executed",
    "value.order",
    "value.sequence",
    "variable.alias-start",
    "variable.name-flat",
}
