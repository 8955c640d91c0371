"""Jobs of the workbench: the command itself, its numbers, its Ctrl-C, and what is left when the server dies."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.cli import main
from orchestrator.shared.isolation.walls import support
from orchestrator.shared.operating_system import command_options
from tests.support.broken_archives import ARCHIVES
from tests.support.c_fmu import have_compiler
from tests.support.engine_process import children, wait_until_gone
from tests.support.hostile_fmus import World
from tests.support.workbench import HANGS, drive_log, workbench

pytest.importorskip("starlette")
pytest.importorskip("uvicorn")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return drive_log(tmp_path_factory.mktemp("log") / "drive.csv", 1500)


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory):
    with workbench(tmp_path_factory.mktemp("jobs") / "session") as found:
        yield found


CLICKS = {"u": {"torque_constant": 0.5}, "theta_l": {"name": "Achse B [deg]"}}
VALUES = {"i": 10.0, "J_m": 0.003, "J_l": 0.25, "k": 800.0, "c": 0.8, "b_m": 0.004, "b_l": 0.3, "tau": 0.001}
MACHINE = {
    "name": "machine.toml",
    "columns": CLICKS,
    "parameters": {name: {"value": value, "uncertainty": 0.2 * value} for name, value in VALUES.items()},
}


def is_fitting(job) -> bool:
    """Whether a diagnosis is on its way."""
    assert job["state"] in ("waiting", "running"), job
    return job["stage"].startswith("fitted")


def is_running(job) -> bool:
    return job["state"] == "running"


@pytest.mark.slow
def test_the_numbers_are_those_of_the_command_line(served, log: Path, tmp_path: Path) -> None:
    """Columns by clicks, then `inspect`: the JSON is the one that the same files give on the command line."""
    reference = served.upload(log)
    status, seen = served.ask("POST", "columns", {"file": reference, "columns": CLICKS})
    assert (status, seen["problem"]) == (200, "")
    model = served.ask("POST", "models", {"name": "drive-columns.toml", "columns": CLICKS})[1]["file"]
    job = served.wait(served.start("inspect", [reference], model=model))
    assert (job["state"], job["share"]) == ("done", 1.0)
    assert {"inspect.json", "report.html", "model.toml", "output.txt"} <= set(job["files"])
    columns = tmp_path / "columns.toml"
    columns.write_text('[columns.u]\ntorque_constant = 0.5\n[columns.theta_l]\nname = "Achse B [deg]"\n')
    assert main(["inspect", str(log), "--model", str(columns), "--out", str(tmp_path / "out")]) == 0
    line = json.loads((tmp_path / "out" / "inspect.json").read_text())["results"]
    clicked = served.ask("GET", f"file/results/{job['name']}/inspect.json")[1]["results"]
    assert clicked == line
    fields = served.ask("GET", f"model?file=results/{job['name']}/model.toml")[1]
    sources = {one["name"]: one["source"] for one in fields["parameters"]}
    assert (sources["J_m"], sources["tau"]) == ("assumed", "from the record")
    changed = {
        "base": f"results/{job['name']}/model.toml",
        "parameters": {"J_m": {"value": 0.003, "uncertainty": 3e-4}},
    }
    mine = served.ask("POST", "models", changed)[1]["file"]
    fields = served.ask("GET", f"model?file={mine}")[1]
    values = {one["name"]: one for one in fields["parameters"]}
    assert (values["J_m"]["value"], values["J_m"]["source"]) == (0.003, "yours")
    assert (values["tau"]["source"], fields["columns"]["u"]["torque_constant"]) == ("from the record", 0.5)


def test_bad_input_is_told_in_the_words_of_the_command(served) -> None:
    served.ask("PUT", "upload/words.csv", b"these,are\nno,numbers\n")
    job = served.wait(served.start("inspect", ["files/words.csv"]))
    assert (job["state"], job["exit_code"]) == ("failed", 2)
    assert len(job["messages"]) == 1
    assert job["messages"][0].startswith("error: files/words.csv")
    status, said = served.ask("POST", "columns", {"file": "files/words.csv"})
    assert (status, "words.csv" in said["problem"], said["lines"][0]) == (200, True, "these,are")
    served.ask("PUT", "upload/picture.csv", b"\x89PNG\r\n\x1a\n" + bytes(3000))
    status, said = served.ask("POST", "columns", {"file": "files/picture.csv"})
    assert (status, "picture.csv" in said["error"]) == (422, True)


@pytest.mark.skipif(not have_compiler(), reason="the FMUs are built with a C compiler")
def test_damaged_archives_are_told_and_contained(served, tmp_path: Path) -> None:
    inputs = []
    for n, (_, _, make) in enumerate(ARCHIVES):
        make(tmp_path / f"damaged{n}.fmu")
        inputs.append(served.upload(tmp_path / f"damaged{n}.fmu"))
    for first in range(0, len(inputs), 20):
        job = served.wait(served.start("check", inputs[first : first + 20], static=True))
        assert (job["state"], job["exit_code"]) == ("done", 1)
        assert "Traceback" not in " ".join(job["messages"])
        found = served.ask("GET", f"file/results/{job['name']}/check.json")[1]["results"]
        rules = {rule for _, rule, _ in ARCHIVES[first : first + 20]}
        assert rules <= set(re.findall(r"archive\.[a-z-]+", json.dumps(found)))
    assert not Path("/tmp/outside.txt").exists()


HOSTILE = [
    ("step", "segv"),
    ("step", "hang"),
    ("step", "kill_parent"),
    ("step", "write"),
    ("load", "exit"),
    ("step", "fifo"),
]


@pytest.mark.slow
@pytest.mark.skipif(not have_compiler() or bool(support().not_enforced), reason="no C compiler, or no walls")
def test_hostile_fmus_are_contained(tmp_path: Path) -> None:
    world = World(tmp_path / "world")
    try:
        with workbench(world.folder / "session", environment=world.environment()) as served:
            inputs = [served.upload(world.fmu(*does), f"{'-'.join(does)}.fmu") for does in HOSTILE]
            for reference in inputs:  # the tree of variables loads nothing of an FMU
                assert served.ask("GET", f"variables?file={reference}")[0] == 200
            job = served.wait(served.start("check", inputs, time_limit=3))
            assert (job["state"], job["exit_code"]) == ("done", 1)
            assert served.ask("GET", "state")[0] == 200
        assert world.harm() == []
    finally:
        world.close()


@pytest.mark.slow
def test_stop_is_ctrl_c_and_leaves_nothing_running(served, log: Path) -> None:
    reference = served.upload(log)
    model = served.ask("POST", "models", MACHINE)[1]["file"]
    name = served.start("diagnose", [reference], model=model)
    other = served.start("inspect", [reference], model=model)  # a second user
    served.wait(name, is_fitting)
    # What reads logs for the page goes on.
    running = [pid for pid in children(served.process.pid) if b"diagnose" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    assert running
    served.ask("POST", f"jobs/{name}/stop", {})
    job = served.wait(name)
    assert (job["state"], job["exit_code"]) == ("stopped", 130)
    assert job["messages"][-1] == "interrupted"
    assert job["files"] == ["output.txt"]
    assert served.wait(other)["state"] == "done"
    wait_until_gone(running)


@pytest.mark.slow
def test_results_of_a_server_that_is_killed_are_whole_or_absent(tmp_path: Path, log: Path) -> None:
    with workbench(tmp_path / "session") as first:
        reference = first.upload(log)
        model = first.ask("POST", "models", MACHINE)[1]["file"]
        whole = first.wait(first.start("inspect", [reference], model=model))["name"]
        cut = first.start("diagnose", [reference], model=model)
        first.wait(cut, is_running)
        running = children(first.process.pid)
        first.process.send_signal(signal.SIGKILL)
        first.process.wait()
        wait_until_gone(running)
    with workbench(tmp_path / "session") as again:
        jobs = {job["name"]: job for job in again.ask("GET", "state")[1]["jobs"]}
        assert jobs[whole]["state"] == "done"
        assert "inspect.json" in jobs[whole]["files"]
        assert jobs[cut]["state"] == "ended"
        assert jobs[cut]["files"] == ["output.txt"]
        assert [file["name"] for file in again.ask("GET", "state")[1]["files"]] == ["drive.csv", "machine.toml"]
        assert again.start("inspect", [reference], model=model) == "inspect-2"


@pytest.mark.slow
def test_the_end_of_the_server_stops_its_jobs(tmp_path: Path, log: Path) -> None:
    folder = tmp_path / "session"
    with workbench(folder) as first:
        shutil.copy(log, folder / "files" / "drive.csv")
        model = first.ask("POST", "models", MACHINE)[1]["file"]
        name = first.start("diagnose", ["files/drive.csv"], model=model)
        first.wait(name, is_running)
        running = children(first.process.pid)
        first.process.send_signal(signal.SIGTERM)
        first.process.wait(HANGS)
        wait_until_gone(running)
    assert json.loads((folder / "results" / name / "job.json").read_text())["state"] == "stopped"


def test_a_stop_that_comes_first_of_all_is_told_in_a_word() -> None:
    """While the interpreter starts, Ctrl-C would end in a traceback."""
    prepare = command_options()["preexec_fn"]

    def stopped_at_once() -> None:
        prepare()
        os.kill(os.getpid(), signal.SIGINT)

    command = [sys.executable, "-m", "orchestrator", "inspect", "none.csv"]
    done = subprocess.run(command, check=False, capture_output=True, text=True, preexec_fn=stopped_at_once)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "interrupted\n")
