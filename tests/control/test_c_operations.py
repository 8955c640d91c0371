"""The most operations of a sample in plain C: counted in the text, against what a counting compiler sees."""

import math
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from orchestrator.control.loops import make_task
from orchestrator.control.machine import machine_of
from orchestrator.control.take_away import c_files
from orchestrator.records.model_file import read_model
from tests.control.test_machine import write_model
from tests.support.c_operations import OPERATORS, Operations

ROOT = Path(__file__).resolve().parents[2]
PARTS = 0.06  # of a swing of the shaft, that the estimator takes in one part: see `backlash_estimator.LONGEST_PART`
MAIN = """
#include "tests/support/counted.hpp"
#include <cstdio>
#include <cstdlib>
#define double Counted
#include "controller_press.c"
#undef double
int main()
{
    long most[5] = {0};
    controller_press_Inputs in;
    controller_press_Outputs out;
    srand(1);
    for (int n = 0; n < 6000; n++) {
        const double turn = 0.3 * ::sin(0.01 * n) + 0.02 * ::sin(0.3 * n), noise = 1e-4 * (rand() % 100);
        in.theta_m = 3.984 * turn + noise;
        in.theta_l = turn + 0.0137 * ::sin(0.05 * n) + noise;
        in.reference = (n / 500) % 2 ? 0.3 : -0.3;
        in.reference_speed = ::cos(0.002 * n);
        for (long &count : counts) count = 0;
        if (n ? controller_press_step(&in, &out) : controller_press_start(&in, &out)) return 1;
        for (int k = 0; k < 4 && n; k++) if (counts[k] > most[k]) most[k] = counts[k];
    }
    std::printf("%ld %ld %ld %ld", most[0], most[1], most[2], most[3]);
}
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("press")
    machine = machine_of(read_model(write_model(folder)))
    for name, text in c_files("press", make_task(machine, 1e-3)).items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder, machine


def most_operations(folder, machine):
    v = machine.nominal
    swing = math.sqrt(v.k * (1.0 / v.J_l + 1.0 / (v.J_m * v.i**2)))
    bounds = {"advance.parts": 1 + int(1e-3 * swing / PARTS), "combine.count": 7}
    bounds |= {"foresee_late.count_1": 1, "foresee.parts": 5}  # a request of this machine acts at once, if not told
    text = (folder / "controller_press.c").read_text(encoding="utf-8")
    return Operations(text, bounds).of("controller_press_step")


def test_the_page_states_the_most_operations_of_a_sample(made):
    most = most_operations(*made)
    page = (ROOT / "docs" / "control.md").read_text(encoding="utf-8")
    stated = re.search(
        r"at most ([\d,]+) additions, ([\d,]+)\s+multiplications, ([\d,]+)\s+divisions\s+and ([\d,]+) calls", page
    )
    assert stated is not None
    assert [int(text.replace(",", "")) for text in stated.groups()] == [most[kind] for kind in OPERATORS]


@pytest.mark.skipif(shutil.which("g++") is None, reason="there is no C++ compiler")
def test_no_sample_takes_more_than_that_nor_much_less(made):
    folder, machine = made
    (folder / "main.cpp").write_text(MAIN, encoding="utf-8")
    command = ["g++", "-fpermissive", "-w", "-O1", f"-I{ROOT}", "main.cpp", "-o", "main"]
    subprocess.run(command, cwd=folder, check=True)
    done = subprocess.run([folder / "main"], check=True, capture_output=True, text=True)
    seen = dict(zip(OPERATORS, map(int, done.stdout.split()), strict=True))
    most = most_operations(folder, machine)
    print(seen, most)
    for kind in OPERATORS:
        assert seen[kind] <= most[kind]
        assert most[kind] <= 10 * seen[kind], (kind, seen, most)
