"""Faults that hosts meet away from start values: each is named by the rule that is meant, and a sound FMU by none."""

import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from orchestrator.checking.catalogue import RULES
from orchestrator.checking.check import CheckOptions, check_fmu
from orchestrator.shared.isolation.limits import Limits
from tests.support.broken_plants import BrokenPlant, broken_plants
from tests.support.c_fmu import have_compiler
from tests.support.outlined_findings import probes_of
from tests.support.plant import build_plant

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not have_compiler(), reason="the FMUs are built with a C compiler on Linux"
)
OPTIONS = CheckOptions(limits=Limits(time=10.0))
PLANTS = broken_plants()
# One of each cause and version here, and these, in one version; `python -m benchmarks.plant_faults` checks all.
# By day the versions of causes take turns.
MORE = (
    "early_only", "derived_early", "clipped_far", "text_plain", "tunable_late", "text_shared", "reset_initialising",
    "restored_local", "state_in_place", "bytes_pointer", "bytes_overrun", "feeds_unswitched", "asked_alone",
    "output_cached", "rates_by_steps", "quiet_count", "count_in_steps", "step_after_end",
    "category_refused",
    "last_before", "ends_early",
)  # fmt: skip
# What shows these is no run of the rule's own probe.
OF_ALL_PROBES = ("output_cached", "quiet_count", "last_before")
CHOSEN = {(plant.cause, plant.version): plant for plant in reversed(PLANTS)}
CHOSEN |= {
    (fault, ""): plant for n, fault in enumerate(MORE)
    for plant in sorted(PLANTS, key=lambda p: p.version == ("2.0", "3.0")[n % 2]) if plant.fault == fault
}  # fmt: skip
SOUND = [
    pytest.param("2.0", "CS ME", {}, marks=pytest.mark.night),  # by day in test_check_unusual.py
    ("3.0", "CS ME", {"clock": "fraction"}),
    ("2.0", "CS", {"flags": 'providesDirectionalDerivative="true"', "step flags": 'canInterpolateInputs="true"'}),
    pytest.param(
        "3.0",
        "ME",
        {
            "flags": 'providesDirectionalDerivatives="true" providesAdjointDerivatives="true" '
            'providesEvaluateDiscreteStates="true"'
        },
        marks=pytest.mark.night,
    ),
]


@pytest.mark.parametrize(("version", "interfaces", "changes"), SOUND, ids=lambda value: str(value)[:12])
def test_a_sound_plant_has_no_finding(version: str, interfaces: str, changes: dict[str, str], tmp_path: Path) -> None:
    report = check_fmu(build_plant(tmp_path / "plant.fmu", version, interfaces, "", changes), OPTIONS)
    assert report.findings == ()
    assert report.executed


CAUSES = list(dict.fromkeys(plant.cause for plant in PLANTS))


def is_of_the_night(key: tuple[str, str]) -> bool:
    return bool(key[1]) and key[1] != ("2.0", "3.0")[CAUSES.index(key[0]) % 2]


@pytest.mark.parametrize(
    "plant",
    [pytest.param(p, marks=pytest.mark.night if is_of_the_night(key) else ()) for key, p in CHOSEN.items()],
    ids=lambda p: p.name,
)
def test_a_fault_is_named_by_its_rule(plant: BrokenPlant, tmp_path: Path) -> None:
    probes = () if plant.fault in OF_ALL_PROBES else probes_of(plant.rule)
    report = check_fmu(plant.build(tmp_path / "plant.fmu"), replace(OPTIONS, probes=probes))
    assert plant.rule in {f.rule for f in report.findings}


@pytest.mark.night
@pytest.mark.parametrize("plant", CHOSEN.values(), ids=lambda p: p.name)
def test_a_fault_is_named_among_all_probes(plant: BrokenPlant, tmp_path: Path) -> None:
    report = check_fmu(plant.build(tmp_path / "plant.fmu"), OPTIONS)
    assert plant.rule in {f.rule for f in report.findings}


def test_each_cause_has_many_faults_of_both_versions() -> None:
    counts = Counter((p.cause, p.version) for p in PLANTS)
    assert min(counts.values()) >= 8
    assert len({p.name for p in PLANTS}) == len(PLANTS)
    assert {p.rule for p in PLANTS} <= set(RULES)


def test_what_the_total_time_leaves_out_is_named(tmp_path: Path) -> None:
    path = build_plant(tmp_path / "plant.fmu", "3.0", "CS", "", {})
    report = check_fmu(path, CheckOptions(limits=Limits(time=10.0, total=0.02)))
    (late,) = (f for f in report.findings if f.rule == "limits.total")
    (execution,) = report.executions
    left_out = [
        stage for stage, reason in execution.stages.items() if reason == "the time of 0.02 s for the FMU was over"
    ]
    assert "misuse" in left_out
    assert all(stage in late.message for stage in left_out)
    assert not report.count("error")
