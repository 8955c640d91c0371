"""Parameters that change within a run, and what lies between two FMUs: named, sized and delivered."""

import json

import numpy as np
import pytest

import orchestrator as oc
from orchestrator.cli import main
from orchestrator.diagnosis.fmu.mapping import read_map
from orchestrator.diagnosis.fmu.system import read_system
from orchestrator.diagnosis.selection.outcome import Grade
from orchestrator.errors import InputError
from pyfmu_sources.laws import body as laws
from tests.support.box_fmu import DOMAINS, write_fmu, write_map, write_scenario
from tests.support.box_records import changing_record, coupled_record
from tests.support.c_fmu import have_compiler

pytestmark = pytest.mark.skipif(not have_compiler(), reason="no C compiler")
SPRING = DOMAINS[0]


def changing(folder, fault="", **change):
    fmu = write_fmu(folder / "Spring.fmu", SPRING, fault)
    map_path = write_map(folder / "map.toml", SPRING)
    map_path.write_text(map_path.read_text() + "[signals]\nT = { reference = 20 }\n")
    return changing_record(folder / "record.csv", np.random.default_rng(3), 400, **change), fmu, map_path


def test_a_stiffness_that_drifts_is_named_and_delivered(tmp_path):
    record, fmu, map_path = changing(tmp_path, rate=0.5)
    out = tmp_path / "out"
    assert main(["diagnose", str(record), "--fmu", str(fmu), "--map", str(map_path), "--out", str(out)]) == 0
    results = json.loads((out / "diagnose.json").read_text())["results"]
    (effect,) = results["effects"]
    assert (effect["name"], effect["site"]) == ("parameter_drift", "k")
    assert effect["parameters"]["rate"]["value"] == pytest.approx(0.5, rel=0.02)
    assert effect["parameters"]["rate"]["unit"] == "N/m/s"
    (delivered,) = results["delivery"]
    assert delivered.get("note", "") == ""
    assert delivered["difference_over_noise"] < 0.1


def test_a_stiffness_that_follows_a_temperature_is_named(tmp_path):
    found = oc.diagnose(*changing(tmp_path, slope=0.2))
    found.close()
    (effect,) = found.effects
    assert effect.label == "parameter_dependence@k(T)"
    assert effect.parameters["slope"].value == pytest.approx(0.2, rel=0.02)
    assert effect.parameters["slope"].unit == "N/m/T"


def test_a_parameter_that_is_read_once_is_not_looked_at_for_drift(tmp_path):
    found = oc.diagnose(*changing(tmp_path, fault="read_once", rate=0.5))
    found.close()
    assert not any(f.name == "parameter_drift" for f in found.effects)
    assert any("does not act within a run" in note for note in found.notes)


def test_what_made_up_for_coarse_steps_is_not_named_beside_a_gap(tmp_path):
    loop, map_path = write_scenario(tmp_path)
    record = coupled_record(tmp_path / "record.csv", np.random.default_rng(3), 700, gap=0.006)
    found = oc.diagnose(record, loop, map_path)
    found.close()
    (effect,) = found.diagnosis.graded(Grade.LIKELY)
    assert effect.label == "backlash@coupling"
    width = effect.parameters["width"]
    assert width.value == pytest.approx(0.006, rel=0.03)
    low, high = width.interval
    assert low < 0.006 < high
    assert high - low < 0.001


def test_a_gap_between_two_fmus_is_delivered(tmp_path):
    loop, map_path = write_scenario(tmp_path)
    record = coupled_record(tmp_path / "record.csv", np.random.default_rng(3), 500, gap=0.006)
    out = tmp_path / "out"
    words = ["diagnose", str(record), "--scenario", str(loop), "--map", str(map_path), "--out", str(out)]
    assert main([*words, "--effects", "backlash@coupling"]) == 0
    results = json.loads((out / "diagnose.json").read_text())["results"]
    (effect,) = results["effects"]
    assert (effect["name"], effect["site"]) == ("backlash", "coupling")
    assert effect["parameters"]["width"]["value"] == pytest.approx(0.006, rel=0.02)
    (delivered,) = results["delivery"]
    assert delivered.get("note", "") == ""
    assert delivered["difference_over_noise"] < 0.1


def test_a_compliance_between_two_fmus_is_named(tmp_path):
    loop, map_path = write_scenario(tmp_path)
    found = oc.diagnose(coupled_record(tmp_path / "r.csv", np.random.default_rng(3), 600, soft=0.0015), loop, map_path)
    found.close()
    assert [effect.label for effect in found.effects] == ["compliance@coupling"]
    assert found.effects[0].parameters["compliance"].value == pytest.approx(0.0015, rel=0.06)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.replace('input = "load.phi_in"', 'input = "motor.M"'), "is not connected"),
        (lambda t: t.replace('far = "load.phi"', "").replace('effort = "load.T"', ""), "has neither"),
        (lambda t: t.replace('far = "load.phi"', 'far = "load.nothing"'), "must be a variable"),
    ],
)
def test_a_wrong_cut_is_refused_in_one_line(tmp_path, change, words):
    loop, map_path = write_scenario(tmp_path)
    map_path.write_text(change(map_path.read_text()))
    with pytest.raises(InputError, match=words) as caught:
        read_map(map_path, read_system(loop))
    assert "\n" not in str(caught.value)


def test_a_scenario_that_rounds_or_feeds_an_input_of_its_own_is_refused(tmp_path):
    loop, map_path = write_scenario(tmp_path)
    text = loop.read_text()
    loop.write_text(text.replace('to = "motor.T"', 'to = "motor.T"\nquantum = 0.1'))
    with pytest.raises(InputError, match="without a quantum"):
        read_system(loop)
    loop.write_text(text + '[[sources]]\nto = "load.phi_in"\nkind = "constant"\nvalue = 1.0\n')
    with pytest.raises(InputError, match="the scenario feeds it"):
        read_map(map_path, read_system(loop))


def test_hysteresis_comes_back_on_a_straight_line_and_friction_does_not():
    up = laws.built_up(laws.HYSTERESIS, 0.0, 1.0, 0.5, 10.0)
    assert up == pytest.approx(1.0)
    assert laws.built_up(laws.HYSTERESIS, up, -1.0, 0.5, 0.2) == pytest.approx(up - 0.4)
    assert laws.built_up(laws.COULOMB, up, -1.0, 0.5, 0.2) < up - 0.4
    # two steps are one
    half = laws.built_up(laws.HYSTERESIS, 0.3, -1.0, 0.5, 0.1)
    assert laws.built_up(laws.HYSTERESIS, half, -1.0, 0.5, 0.3) == pytest.approx(
        laws.built_up(laws.HYSTERESIS, 0.3, -1.0, 0.5, 0.4)
    )


def test_a_gap_leaves_its_width_and_a_spring_winds_with_the_effort():
    assert laws.across(laws.BACKLASH, 1.0, 0.7, 1.0, 0.2) == pytest.approx(0.9)
    assert laws.across(laws.BACKLASH, 0.75, 0.7, 1.0, 0.2) == pytest.approx(0.7)
    assert laws.across(laws.COMPLIANCE, 1.0, 5.0, -1.0, 0.02) == pytest.approx(1.1)
