"""What README and docs tell a reader to type works as it stands there."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

from orchestrator.cli import main
from orchestrator.records.record import read_record
from tests.support.example_record import (
    FILE,
    FRICTION,
    HALF_GAP,
    SERVO,
    SERVO_FRICTION,
    SERVO_GAP,
    copy_examples,
    example_record,
    servo_log,
)
from tests.support.waiting import HANGS

ROOT = Path(__file__).resolve().parents[1]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
# Pages whose Python examples are complete programs.
PROGRAMS = ("README.md", "docs/experiment.md")


def blocks(page, language):
    text = (ROOT / page).read_text(encoding="utf-8")
    return [body for kind, body in BLOCK.findall(text) if kind == language]


def run(words, folder):
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run(
        words, cwd=folder, env=environment, capture_output=True, text=True, timeout=HANGS, check=False
    )


LINES = {
    page: re.findall(r"(?:^ *|/)(python -m orchestrator .*)$", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE)
    for page in ("README.md", "docs/tour.md", "docs/your-machine.md")
}
TUTORIAL = LINES.pop("docs/your-machine.md")
OWN_CHECK = "python -m orchestrator check"  # of all our FMUs: the last step of CI
TO_A_CONTROLLER = LINES["docs/tour.md"][-3:]  # each goes on with what the one before has left
# What stands twice is run once.
COMMANDS = list(
    dict.fromkeys(
        line for lines in LINES.values() for line in lines if line != OWN_CHECK and line not in TO_A_CONTROLLER
    )
)
BY_DAY = {
    " compensate": "--plants 2",
    " --design": "--duration 1",
    "estimate docs/examples/servo.csv": "--no-diagnose",
    " check results": "--static",
}
"""What a command gets besides by day, so that it does less; at night each is run as it stands.

What `estimate` asks of a diagnosis by itself, `diagnose` does here too. CI also checks our FMUs while they run.
"""
WAYS = pytest.mark.parametrize(
    "more", [BY_DAY, pytest.param({}, marks=pytest.mark.night)], ids=["by day", "as it stands"]
)
(DIAGNOSE,) = (line for line in COMMANDS if " diagnose " in line)


def test_there_are_commands_to_test():
    assert len(COMMANDS) >= 6
    words = ["inspect", "inspect", "estimate", "estimate", "diagnose", "check", "compensate"]
    assert [line.split()[3] for line in TUTORIAL] == words
    assert [line.split()[3] for line in TO_A_CONTROLLER] == ["estimate", "compensate", "simulate"]
    assert "-m orchestrator check --out" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")


def test_the_first_command_installs_what_it_needs():
    first = blocks("README.md", "sh")[0]
    assert first.startswith(
        "python3 -m venv .venv && .venv/bin/pip install -q -e . && .venv/bin/python -m orchestrator "
    )


def done_in(folder, line, whole, more=MappingProxyType({})):
    """Run a command of the README where the examples are, with whole records or short ones; return what it found."""
    copy_examples(folder / "docs" / "examples", whole)
    return done_there(folder, line, more)


def done_there(folder, line, more):
    words = shlex.split(" ".join([line, *(text for words, text in more.items() if words in line)]))
    if more:  # by day no Python starts for each command; that of `diagnosed` does
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(folder)
            assert main(words[3:]) == 0
    else:
        done = run([sys.executable, *words[1:]], folder)
        assert done.returncode == 0, done.stderr
    return json.loads((folder / "results" / words[3] / f"{words[3]}.json").read_text(encoding="utf-8"))["results"]


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory, fmus):
    """The folder in which the diagnosis of the README ran, and what it found."""
    folder = tmp_path_factory.mktemp("diagnosed")
    return folder, done_in(folder, DIAGNOSE, whole=True)


@WAYS
@pytest.mark.parametrize("line", [line for line in COMMANDS if line != DIAGNOSE])
def test_command_of_the_readme(line, more, tmp_path, fmus):
    assert done_in(tmp_path, line, False, more)


@pytest.mark.slow(shares="diagnosed")
def test_the_diagnosis_finds_what_the_readme_says(diagnosed):
    _, found = diagnosed
    gap, friction = (effect["parameters"] for effect in found["effects"])
    sizes = [(gap["alpha"], 5, HALF_GAP), (friction["torque"], 3, FRICTION)]
    rows = []
    for size, n, truth in sizes:
        low, high = size["interval"]
        rows.append(
            f"{size['value']:.{n}f} {size['unit']} (95 %: {low:.{n}f} to {high:.{n}f}) | {truth:g} {size['unit']} |"
        )
    misfit = found["test"][0]["misfit"]["theta_m"]
    rows += [f"{misfit['nominal']:.3g} rad -> {misfit['final']:.2g} rad | {misfit['noise']:.2g} rad of encoder noise |"]
    said = (ROOT / "README.md").read_text(encoding="utf-8")
    assert [row for row in rows if row not in said] == []


@WAYS
@pytest.mark.slow
def test_the_tutorial_goes_from_a_log_in_amperes_to_an_fmu_of_the_machine(tmp_path, more):
    copy_examples(tmp_path / "docs" / "examples")
    _, _, estimated, _, diagnosed, _, _ = (done_there(tmp_path, line, more) for line in TUTORIAL)
    assert estimated["alpha"] == pytest.approx(SERVO_GAP, rel=5e-3)
    found = {effect["name"]: effect["parameters"] for effect in diagnosed["effects"]}
    assert found["backlash"]["alpha"]["value"] == pytest.approx(SERVO_GAP, rel=5e-3)
    assert found["coulomb_friction"]["torque"]["value"] == pytest.approx(SERVO_FRICTION, rel=0.1)


@WAYS
@pytest.mark.slow
def test_the_tour_ends_with_a_controller_of_the_machine(tmp_path, more):
    copy_examples(tmp_path / "docs" / "examples", whole=not more)
    for line in TO_A_CONTROLLER:
        assert done_there(tmp_path, line, more)


def test_the_example_records_are_what_their_simulator_makes():
    assert SERVO.read_text(encoding="utf-8") == servo_log()
    columns, truth = example_record()
    record = read_record(FILE)
    for name, counts in zip(("theta_m", "theta_l"), truth["counts"], strict=True):
        assert np.abs(getattr(record, name) - columns[name]).max() <= 1.01 * 2.0 * np.pi / counts
    assert np.abs(record.u - columns["u"]).max() < 1e-3
    said = (ROOT / "docs" / "tour.md").read_text(encoding="utf-8")
    assert f"The truth: {HALF_GAP:g} rad of half-gap, {FRICTION:g} N.m of friction at the motor" in said


@pytest.mark.parametrize("page", PROGRAMS)
def test_program(page, tmp_path, fmus):
    for body in blocks(page, "python"):
        done = run([sys.executable, "-c", body], tmp_path)
        assert done.returncode == 0, done.stderr
        assert done.stdout.strip()


def test_the_page_of_the_experiment_prints_its_own_figures(tmp_path):
    done = run([sys.executable, "-c", blocks("docs/experiment.md", "python")[0]], tmp_path)
    low, high = done.stdout.split(" to ")
    assert f"| default | {low} | {high.strip()} |" in (ROOT / "docs/experiment.md").read_text(encoding="utf-8")
