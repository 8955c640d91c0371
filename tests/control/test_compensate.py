"""The command `compensate`, and what it measures."""

import json

import numpy as np
import pytest

from orchestrator.cli import main
from orchestrator.control.loops import ControlTask
from orchestrator.control.machine import thesis_machine
from orchestrator.control.measures import least_time, measure_loop, quickest_landing, quickest_path
from orchestrator.master.result import Recording
from orchestrator.records.model_file import read_model
from tests.support.c_fmu import have_compiler

MODEL = read_model(None)


def made_task(alpha=0.02, tau=5e-3, impact_speed=0.1):
    return ControlTask(thesis_machine(MODEL, alpha, tau, 2.0), impact_speed)


TASK = made_task()


def record_by_hand(contact, twist, speed):
    """A run whose load stands still at 0.1 rad, with the contacts given."""
    n = contact.size
    i = TASK.nominal.i
    values = {
        "plant.contact": contact,
        "plant.theta_l": np.full(n, 0.1),
        "plant.omega_l": np.zeros(n),
        "plant.theta_m": i * (0.1 + twist),
        "plant.omega_m": i * speed,
    }
    time = np.arange(n) * TASK.sample_time
    return Recording(time, np.array(list(values.values())), tuple(values), dict.fromkeys(values))


def made_run():
    """A bounce on one flank at 0.7 rad/s, then a traversal of 50 samples that lands at 0.2 rad/s."""
    n = round(TASK.stop / TASK.sample_time) + 1
    contact, twist, speed = np.ones(n), np.full(n, 0.02), np.zeros(n)
    contact[1000:1010], speed[1009] = 0.0, 0.7
    contact[2000:2050], speed[2049] = 0.0, -0.2
    twist[1999:2051] = np.linspace(0.02, -0.02, 52)
    contact[2050:], twist[2051:] = -1.0, -0.02
    return record_by_hand(contact, twist, speed)


def test_measures_are_those_of_a_run_made_by_hand():
    found = measure_loop(made_run(), TASK)
    assert found.times == pytest.approx([0.05])
    assert found.impacts == pytest.approx([0.2])
    assert found.largest_impact == pytest.approx(0.7)
    assert (found.rest, found.contacts) == (0.0, 0.0)
    reference = TASK.reference()[0][: round((TASK.stop - 2.0) / TASK.sample_time)]
    assert found.error == pytest.approx(np.sqrt(np.mean((0.1 - reference) ** 2)))


def test_a_path_goes_from_one_flank_to_the_other():
    for times, path in (measure_loop(made_run(), TASK).path, quickest_path(TASK, 0.1)):
        assert times[0] == 0.0
        assert np.all(np.diff(path) >= 0.0)
        assert path[[0, -1]] == pytest.approx([0.0, 2.0 * TASK.machine.alpha])


def test_a_harder_landing_has_a_shorter_bound():
    assert least_time(TASK, 0.3) < least_time(TASK, 0.1) == pytest.approx(0.0360, abs=1e-4)


def test_an_impact_speed_that_no_traversal_reaches_is_refused_with_one_that_can_be_had(capsys):
    words = ["compensate", "--alpha", "0.002", "--tau", "0.2", "--impact-speed", "0.3"]
    assert main(words) == 2
    error = capsys.readouterr().err
    assert "`--impact-speed` must be at most 0.24" in error
    assert "but is 0.3 rad/s" in error
    told = float(error.split("at most ")[1].split()[0])
    task = made_task(alpha=0.002, tau=0.2, impact_speed=0.3)
    assert least_time(task, told) > 0.0 == least_time(task, 1.02 * told)
    assert quickest_landing(task) == pytest.approx(told / 0.99, rel=5e-3)


@pytest.mark.skipif(not have_compiler(), reason="Python FMUs take half a minute")
def test_the_compensator_lands_softest_and_near_the_bound(tmp_path, capsys):
    assert main(["compensate", "--plants", "2", "--out", str(tmp_path / "out")]) == 0
    assert "impact speed of 0.1 rad/s: 0.0360 s" in capsys.readouterr().out
    found = json.loads((tmp_path / "out" / "compensate.json").read_text(encoding="utf-8"))["results"]
    plain, shifted, ours = found["laws"]
    assert [law["law"] for law in found["laws"]] == ["LQR", "shifted LQR", "compensator"]
    assert ours["impact"] < 0.6 * shifted["impact"]
    assert ours["error"] < 0.4 * plain["error"]
    # A load that coasts leaves its flank before the crossing begins, so only the quickest say how quick a crossing is.
    assert min(ours["times"]) < 1.25 * found["bound"]
    assert np.quantile(ours["times"], 0.25) < 1.35 * found["bound"]
    rows = (tmp_path / "out" / "traversals.csv").read_text(encoding="utf-8").splitlines()
    assert len(rows) == 1 + sum(len(law["times"]) for law in found["laws"])
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Control laws across the gap" in page


@pytest.mark.parametrize(("option", "value"), [("--alpha", "0"), ("--plants", "0"), ("--tau", "3"), ("--seed", "-1")])
def test_a_value_out_of_range_is_one_line(tmp_path, capsys, option, value):
    assert main(["compensate", option, value, "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err.strip()
    assert option in told
    assert "must be between" in told
    assert "\n" not in told
