"""Faults that a run and its variations show, that calls leave in the process, and that legal FMUs must not be told."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.checking.check import CheckOptions, check_fmu
from orchestrator.shared.isolation.limits import Limits
from tests.support.c_fmu import have_compiler
from tests.support.tank import build_tank

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not have_compiler(), reason="the FMUs are built with a C compiler on Linux"
)
OPTIONS = CheckOptions(limits=Limits(time=10.0))
DERIVATIVES = replace(OPTIONS, probes=("life cycle", "inputs", "derivatives"))
# Model, fault, the probe that sees it, its rule. The probes before "determinism" make what is compared with.
FAULTS = (
    ("2 CS", "logging_slows", "determinism", "log.effect"),
    ("2 CS", "reading_adds", "determinism", "value.order"),
    ("2 CS", "changes_folder", "life cycle", "process.settings"),
    ("2 ME", "takes_signals", "life cycle", "process.signals"),
    ("2 ME", "counts_idle_events", "determinism", "event.idle"),
    ("2 ME", "counts_updates", "determinism", "event.again"),
    ("2 ME", "keeps_time", "time", "value.kept"),
    ("2 CS", "loses_switch", "values", "value.kept"),
    ("2 ME", "late_rates", "determinism", "value.sequence"),
    ("2 ME", "needs_completed_steps", "determinism", "promise.completed-step"),
    ("2 ME", "shares_state", "instances", "instances.interference"),
    ("2 CS", "plain_uri", "", "path.letters"),
    ("3 ME", "traps", "life cycle", "process.settings"),
    ("3 CS", "sets_environment", "life cycle", "process.environment"),
    ("3 CS", "leaves_threads", "memory", "resources.leak"),
    ("se", "crosses_partitions", "clocks", "clock.inactive-change"),
    ("se", "thread_memory", "determinism", "partition.thread"),
    ("se", "any_clock", "clocks", "misuse.clock"),
    ("se", "ends_at_zero", "values", "value.kept"),
    ("se", "rounds_down", "life cycle", "process.settings"),
)


@pytest.mark.parametrize("model", ["2 CS", "2 ME", "3 CS", "3 ME", "se"])
def test_a_sound_tank_has_no_finding(model: str, tmp_path: Path) -> None:
    report = check_fmu(build_tank(tmp_path / "sound.fmu", model), OPTIONS)
    assert report.findings == ()
    assert report.executed


@pytest.mark.parametrize(("model", "fault", "probe", "rule"), FAULTS, ids=lambda value: value)
def test_a_fault_is_named_by_its_rule(model: str, fault: str, probe: str, rule: str, tmp_path: Path) -> None:
    options = replace(OPTIONS, probes=("life cycle", "inputs", probe)) if probe else OPTIONS
    report = check_fmu(build_tank(tmp_path / "broken.fmu", model, f"FAULT_{fault}"), options)
    assert rule in {f.rule for f in report.findings}


def test_one_instance_a_process_is_never_made_two(tmp_path: Path) -> None:
    once = {'modelIdentifier="tank"': 'modelIdentifier="tank" canBeInstantiatedOnlyOncePerProcess="true"'}
    report = check_fmu(build_tank(tmp_path / "once.fmu", "2 CS", "ONCE", changes=once), OPTIONS)
    assert report.findings == ()
    assert report.executed


def test_a_derivative_is_no_chord_of_a_step_that_is_longer_than_what_happens_in_it(tmp_path: Path) -> None:
    order = {"canHandleVariable": 'maxOutputDerivativeOrder="1" canHandleVariable'}
    report = check_fmu(build_tank(tmp_path / "ripple.fmu", "2 CS", "RIPPLE", changes=order), DERIVATIVES)
    assert not {f.rule for f in report.findings} & {"derivative.value", "run.status"}


def test_what_a_calculated_parameter_needs_is_not_superfluous(tmp_path: Path) -> None:
    silent = {'<Unknown index="9" dependencies="4 11"/>': '<Unknown index="9"/>'}
    report = check_fmu(build_tank(tmp_path / "spare.fmu", "2 CS", changes=silent), OPTIONS)
    assert report.findings == ()


def test_a_warning_is_advice_and_a_staircase_is_no_clock_inside(tmp_path: Path) -> None:
    stairs = {
        'name="h" valueReference="1" causality="output"': 'name="h" valueReference="1" causality="local"',
        'name="y" valueReference="6" causality="output"': 'name="y" valueReference="6" causality="local"',
        'name="d" valueReference="7" causality="output" variability="discrete"':
            'name="d" valueReference="7" causality="output" variability="continuous"',
        '<Unknown index="2" dependencies="2"/>\n<Unknown index="7" dependencies="2"/>\n': "",
        '<Unknown index="7" dependencies="2 5"/>\n': "",
        'stepSize="0.06"': 'stepSize="0.07"',
    }  # fmt: skip
    report = check_fmu(build_tank(tmp_path / "stairs.fmu", "2 CS", "WARNS", changes=stairs), OPTIONS)
    assert {(f.rule, f.severity) for f in report.findings} == {("run.warning", "info")}
