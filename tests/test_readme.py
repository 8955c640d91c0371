"""What README and docs tell a reader to type works as it stands there."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from orchestrator.records.record import read_record
from tests.support.example_record import FILE, FRICTION, HALF_GAP, copy_examples, example_record
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
COMMANDS = list(dict.fromkeys(line for lines in LINES.values() for line in lines))  # what stands twice is run once
(DIAGNOSE,) = (line for line in COMMANDS if " diagnose " in line)
CHECK = "python -m orchestrator check results/diagnose/Drivetrain_machine.fmu"


def test_there_are_commands_to_test():
    assert len(COMMANDS) >= 6
    assert len(LINES["docs/your-machine.md"]) == 5
    assert LINES["docs/your-machine.md"][3:] == [DIAGNOSE, CHECK]


def test_the_first_command_installs_what_it_needs():
    first = blocks("README.md", "sh")[0]
    assert first.startswith(
        "python3 -m venv .venv && .venv/bin/pip install -q -e . && .venv/bin/python -m orchestrator "
    )


def done_in(folder, line, whole):
    """Run a command of the README where the examples are, with whole records or short ones; return what it found."""
    copy_examples(folder / "docs" / "examples", whole)
    return done_there(folder, line)


def done_there(folder, line):
    words = shlex.split(line)
    done = run([sys.executable, *words[1:]], folder)
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "results" / words[3] / f"{words[3]}.json").read_text(encoding="utf-8"))["results"]


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory, fmus):
    """The folder in which the diagnosis of the README ran, and what it found."""
    folder = tmp_path_factory.mktemp("diagnosed")
    return folder, done_in(folder, DIAGNOSE, whole=True)


@pytest.mark.parametrize("line", [line for line in COMMANDS if line not in (DIAGNOSE, CHECK)])
def test_command_of_the_readme(line, tmp_path, fmus):
    assert done_in(tmp_path, line, whole=False)


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


@pytest.mark.slow(shares="diagnosed")
def test_the_fmu_of_the_diagnosis_passes_the_check(diagnosed):
    folder, _ = diagnosed
    assert done_there(folder, CHECK)


def test_the_example_record_is_what_its_simulator_makes():
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
