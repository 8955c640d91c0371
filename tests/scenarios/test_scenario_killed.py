"""Sweeps of FMUs that are not ours, killed with their workers: same bytes in the end, nothing left on disk."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.c_fmu import build_c_fmu, have_compiler
from tests.support.engine_process import ROOT, children, finished_cases, wait_for_cases, wait_until_gone
from tests.support.waiting import HANGS

SCENARIO = """
stop = 20.0
record = ["slave.x", "slave.v"]
[master]
algorithm = "jacobi"
step = 0.01
[instances.slave]
fmu = "MassSpring.fmu"
"""


def started(folder: Path, out: str) -> "subprocess.Popen[str]":
    words = ["sweep", "--scenario", "scenario.toml", "--vary", "slave.stiffness=range:30:50:60", "--workers", "1"]
    environment = os.environ | {"TMPDIR": str(folder / "temporary"), "PYTHONPATH": str(ROOT)}
    return subprocess.Popen(
        [sys.executable, "-m", "orchestrator", *words, "--resume", "--out", out], cwd=folder, env=environment,
        text=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )  # fmt: skip


def finished(process: "subprocess.Popen[str]", table: Path) -> bytes:
    _, said = process.communicate(timeout=HANGS)
    assert process.returncode == 0, said
    return table.read_bytes()


@pytest.mark.skipif(not have_compiler() or sys.platform != "linux", reason="there is no C compiler, or no /proc")
def test_a_killed_worker_and_a_killed_parent_cost_no_result_and_leave_nothing(tmp_path: Path) -> None:
    build_c_fmu(tmp_path)
    (tmp_path / "scenario.toml").write_text(SCENARIO)
    (tmp_path / "temporary").mkdir()
    calm = finished(started(tmp_path, "calm"), tmp_path / "calm" / "sweep.csv")
    assert not list((tmp_path / "temporary").iterdir())

    out = tmp_path / "killed"
    process = started(tmp_path, "killed")
    wait_for_cases(process, out, 3)
    os.kill(children(process.pid)[0], signal.SIGKILL)
    wait_for_cases(process, out, finished_cases(out) + 3)
    workers = children(process.pid)
    process.kill()
    process.communicate()
    wait_until_gone(workers)
    assert list((tmp_path / "temporary").iterdir())  # a killed parent cannot clean up: the next run does

    assert finished(started(tmp_path, "killed"), out / "sweep.csv") == calm
    assert not list((tmp_path / "temporary").iterdir())
    assert sorted(p.name for p in out.iterdir()) == sorted(p.name for p in (tmp_path / "calm").iterdir())
