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


COMMANDS = [
    found[1]
    for page in ("README.md", "docs/tour.md")
    for body in blocks(page, "sh")
    for found in re.finditer(r"(?:^|/)(python -m orchestrator .*)$", body, re.MULTILINE)
]


def test_there_are_commands_to_test():
    assert len(COMMANDS) >= 6


def test_the_first_command_installs_what_it_needs():
    first = blocks("README.md", "sh")[0]
    assert first.startswith(
        "python3 -m venv .venv && .venv/bin/pip install -q -e . && .venv/bin/python -m orchestrator "
    )


def done_in(folder, line, whole):
    """Run a command of the README where the examples are, with whole records or short ones; return what it found."""
    words = shlex.split(line)
    copy_examples(folder / "docs" / "examples", whole)
    done = run([sys.executable, *words[1:]], folder)
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "results" / words[3] / f"{words[3]}.json").read_text(encoding="utf-8"))["results"]


@pytest.mark.parametrize("line", [line for line in COMMANDS if " diagnose " not in line])
def test_command_of_the_readme(line, tmp_path, fmus):
    assert done_in(tmp_path, line, whole=False)


@pytest.mark.slow
def test_the_diagnosis_finds_what_the_readme_says(tmp_path, fmus):
    (line,) = (line for line in COMMANDS if " diagnose " in line)
    found = done_in(tmp_path, line, whole=True)
    gap, friction = (effect["parameters"] for effect in found["effects"])
    sizes = [(gap["alpha"], 5, HALF_GAP), (friction["torque"], 3, FRICTION)]
    rows = [
        f"{size['value']:.{n}f} +- {size['standard_error']:.{n}f} {size['unit']} | {truth:g} {size['unit']} |"
        for size, n, truth in sizes
    ]
    misfit = found["test"][0]["misfit"]["theta_m"]
    rows += [f"{misfit['nominal']:.3g} rad -> {misfit['final']:.2g} rad | {misfit['noise']:.2g} rad of encoder noise |"]
    said = (ROOT / "README.md").read_text(encoding="utf-8")
    assert [row for row in rows if row not in said] == []


@pytest.mark.slow
def test_the_five_steps_on_the_reader_s_own_machine(tmp_path, fmus):
    page = (ROOT / "docs" / "your-machine.md").read_text(encoding="utf-8")
    lines = re.findall(r"^ *(python -m orchestrator .*)$", page, re.MULTILINE)
    assert len(lines) == 5
    copy_examples(tmp_path / "docs" / "examples")
    for line in lines:
        done = run([sys.executable, *shlex.split(line)[1:]], tmp_path)
        assert done.returncode == 0, done.stdout + done.stderr


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
