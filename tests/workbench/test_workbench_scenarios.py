"""A scenario that was drawn: its TOML, its run, and drawings that are no scenario."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.building.build import ensure_built
from orchestrator.errors import InputError
from orchestrator.fmi.preview import preview_fmu
from orchestrator.scenarios.scenario import load_scenario
from orchestrator.scenarios.ssp.write import write_ssp
from orchestrator.workbench.scenario_text import scenario_text
from orchestrator.workbench.session import open_session

DRAWN = {
    "stop": 0.1,
    "master": {"algorithm": "jacobi", "step": 0.001},
    "record": ["plant.theta_m", "filter.theta_m_hat"],
    "instances": {
        "plant": {"fmu": "files/plant.fmu", "parameters": {"alpha": 0.01}},
        "filter": {"fmu": "files/filter.fmu"},
    },
    "connections": [{"from": "plant.theta_m", "to": "filter.theta_m"}],
    "sources": [
        {"to": "plant.u", "kind": "table", "file": "files/drawn.csv", "column": "value"},
        {"to": "filter.u", "kind": "constant", "value": 2.0},
    ],
}


@pytest.fixture
def session(tmp_path: Path):
    found = open_session(tmp_path / "session")
    fmus = ensure_built()
    for name, target in (("Drivetrain", "plant"), ("KalmanEstimator", "filter")):
        shutil.copy(fmus[name], found.files / f"{target}.fmu")
    (found.files / "drawn.csv").write_text("time,value\n0,0\n0.05,2\n0.1,0\n")
    return found


def test_what_was_drawn_is_what_the_file_says(session) -> None:
    path = session.files / "scenario.toml"
    path.write_text(scenario_text(session, DRAWN))
    scenario = load_scenario(path)
    assert sorted(one.name for one in scenario.system.instances) == ["filter", "plant"]
    assert len(scenario.system.connections) == 1


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"instances": {"a": {"fmu": "/etc/passwd"}}}, "file"),
        ({"instances": {"a": {"fmu": "../../x.fmu"}}}, "file"),
        ({"instances": {"a": {"fmu": None}}}, "fmu"),
        ({"instances": []}, "instances"),
        ({"instances": {"a": {"fmu": "files/plant.fmu", "parameters": {"k": [1]}}}}, "parameters"),
        ({"master": {"step": 0.1, "evil]\n[x": 1}}, "master"),
        ({"sources": [{"to": "plant.u", "kind": "table", "file": "/etc/passwd"}]}, "file"),
        ({"sources": [{"to": "plant.u", "fmu": "x"}]}, "sources"),
        ({"connections": [{"from": 1, "to": "a"}]}, "connections"),
        ({"sources": [{"to": "plant.u", "kind": "table", "file": 7}]}, "file"),
        ({"evil": 1}, "evil"),
        ({"connections": {}}, "connections"),
        ({"record": ["a"] * 1001}, "record"),
    ],
)
def test_drawings_that_are_no_scenario_are_refused(session, change: dict, word: str) -> None:
    with pytest.raises(InputError, match=word):
        scenario_text(session, {**DRAWN, **change})


def test_a_name_stays_a_name(session) -> None:
    name = 'plant"]\nstop = 9\n[x'
    text = scenario_text(session, {**DRAWN, "instances": {name: {"fmu": "files/plant.fmu"}}})
    assert not [line for line in text.splitlines() if line.startswith(("stop = 9", "[x"))]


def test_the_interface_of_an_fmu(session) -> None:
    seen = preview_fmu(session.files / "plant.fmu")
    shown = {one.name: one for one in seen.variables}
    assert (seen.name, seen.tool.split()[0], seen.stop) == ("Drivetrain", "backlash-cosim", 2.0)
    assert {"linux64", "win64"} <= set(seen.platforms)
    assert (seen.version, seen.kind, shown["u"].causality, shown["u"].unit) == ("2.0", "co-simulation", "input", "N.m")
    assert shown["u"].quantity == shown["T_shaft"].quantity != shown["theta_m"].quantity
    assert "nordin" in shown["backlash_model"].items


def test_what_an_ssp_file_holds(session) -> None:
    file, system = session.files / "scenario.toml", session.files / "system.ssp"
    drawn = {**DRAWN, "sources": [{"to": "plant.u", "kind": "constant", "value": 2.0}]}
    file.write_text(scenario_text(session, drawn))
    write_ssp(system, load_scenario(file))
    command = [sys.executable, "-m", "orchestrator", "inspect", str(system), "--columns"]
    seen = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    assert seen["components"] == {"plant": "Drivetrain", "filter": "KalmanEstimator"}
    assert (seen["connections"], seen["stop"]) == ([["plant.theta_m", "filter.theta_m"]], 0.1)
    shown = {one["name"]: one for one in seen["variables"]}
    assert (shown["plant.alpha"]["start"], shown["plant.alpha"]["unit"]) == (0.01, "rad")
    assert shown["filter.theta_m_hat"]["causality"] == "output"


def test_a_file_that_is_no_system_is_refused(session) -> None:
    wrong = session.files / "wrong.ssp"
    wrong.write_text("no archive")
    command = [sys.executable, "-m", "orchestrator", "inspect", str(wrong), "--columns"]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert "wrong.ssp" in done.stderr
    assert "Traceback" not in done.stderr
