"""Faults of two small FMUs: behind a threshold far from driven values, in arrays, and in arrays of other sizes."""

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.checking.check import CheckOptions, check_fmu
from orchestrator.shared.isolation.limits import Limits
from tests.support.c_fmu import have_compiler
from tests.support.outlined_findings import probes_of
from tests.support.small_fmus import build_small_fmu

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not have_compiler(), reason="the FMUs are built with a C compiler on Linux"
)
OPTIONS = CheckOptions(limits=Limits(time=10.0))
FAULTS = [
    ("thermostat", "keep_count", "run.reset"),
    ("thermostat", "lose_heat", "state.restore"),
    ("thermostat", "switch_in_step", "event.outside"),
    ("thermostat", "late_loss", "value.stale"),
    ("thermostat", "dead_truth", "dependency.superfluous"),
    ("thermostat", "time_by_count", "steps.time"),
    ("cells", "first_slope", "derivative.value"),
    ("cells", "resized_lost", "value.kept"),
    ("cells", "refuses_sizes", "configuration.status"),
    ("cells", "voltage_late", "value.stale"),
]


@pytest.mark.parametrize("model", ["thermostat", "cells"])
def test_a_sound_one_has_no_finding(model: str, tmp_path: Path) -> None:
    report = check_fmu(build_small_fmu(tmp_path / "sound.fmu", model), OPTIONS)
    assert report.findings == ()
    assert report.executed


@pytest.mark.parametrize("variant", ["least_power", "opening"])
def test_what_acts_far_away_or_later_is_no_fault(variant: str, tmp_path: Path) -> None:
    report = check_fmu(build_small_fmu(tmp_path / "sound.fmu", "thermostat", variant), OPTIONS)
    assert report.findings == ()


# What shows these is no run of the rule's own probe.
OF_ALL_PROBES = ("time_by_count", "resized_lost")
# Their rules are met by day in test_check_plants.py.
AT_NIGHT = ("lose_heat", "switch_in_step", "late_loss", "voltage_late")


@pytest.mark.parametrize(
    ("model", "fault", "rule"),
    [pytest.param(*row, marks=pytest.mark.night if row[1] in AT_NIGHT else ()) for row in FAULTS],
)
def test_a_fault_is_named_by_its_rule(model: str, fault: str, rule: str, tmp_path: Path) -> None:
    options = OPTIONS if fault in OF_ALL_PROBES else replace(OPTIONS, probes=probes_of(rule))
    report = check_fmu(build_small_fmu(tmp_path / "broken.fmu", model, fault), options)
    assert rule in {f.rule for f in report.findings}


def test_a_factor_of_a_parameter_is_no_constant(tmp_path: Path) -> None:
    changes = {'dependenciesKind="fixed dependent"': 'dependenciesKind="constant dependent"'}
    report = check_fmu(build_small_fmu(tmp_path / "kind.fmu", "cells", "", changes), OPTIONS)
    (found,) = report.findings
    assert found.rule == "dependency.kind"
    assert "`voltage[0]` must follow `current` by a constant factor" in found.message
