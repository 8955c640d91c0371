"""The commands where the modules, functions and files of POSIX are missing: the same numbers, and exit code 0."""

import ast
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.cli import COMMANDS as KNOWN
from orchestrator.shared import operating_system
from tests.support.example_record import copy_examples
from tests.support.sources import nodes_of
from tests.support.workbench import drive_log, workbench

ROOT = Path(__file__).resolve().parents[2]
OF_ONE_SYSTEM = {
    "fcntl",
    "resource",
    "grp",
    "pwd",
    "termios",
    "tty",
    "pty",
    "posix",
    "msvcrt",
    "winreg",
    "winsound",
    "nt",
}
COMMANDS = (
    "--help",
    "build LqrController --out built --force",
    "simulate --alpha 0.02",
    "sweep --sizes 0.01,0.02 --noise 1e-4 --seeds 1 --workers 1",
    "check built/LqrController.fmu",
    "ssp export",
    "report results/simulate",
)
AT_NIGHT = (
    # These three start no processes and write no FMUs.
    "inspect machine.csv",
    "estimate machine.csv --no-diagnose",
    "regulator",
    "build ServoAxis --out built --force",
    "calibrate axis.csv --fmu built/ServoAxis.fmu --map axis_map.toml",
    "diagnose machine.csv --model machine.toml",
    "compensate --plants 2",
    "simulate --scenario loop.toml",
)
MEASURED = {"seconds", "time", "duration", "cases_per_second", "wall"}


def run(module: str, words: str, folder: Path) -> subprocess.CompletedProcess[str]:
    program = (
        f"import sys; sys.path.insert(0, {str(ROOT)!r}); import runpy; runpy.run_module('{module}', None, '__main__')"
    )
    quiet = "ignore:only soft file lock"  # filelock's word for a POSIX system without fcntl, which there is not
    command = [sys.executable, "-W", quiet, "-c", program, *words.split()]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def numbers(value: object) -> object:
    """A result without what was measured with a clock, and without rules of memory, which needs a file of POSIX."""
    if isinstance(value, dict):
        if str(value.get("rule")).startswith("resources."):
            return None
        return {k: numbers(v) for k, v in value.items() if k not in MEASURED}
    return [numbers(v) for v in value] if isinstance(value, list) else value


@pytest.mark.slow
@pytest.mark.parametrize(
    "commands", [COMMANDS, pytest.param(AT_NIGHT, marks=pytest.mark.night)], ids=["by day", "at night"]
)
def test_the_commands_give_the_same_numbers(tmp_path: Path, commands: tuple[str, ...]) -> None:
    here, hidden = tmp_path / "here", tmp_path / "hidden"
    for folder in (here, hidden):
        folder.mkdir()
        copy_examples(folder)
        log = folder / "machine.csv"
        log.write_text("".join(log.read_text().splitlines(keepends=True)[:801]))
    lines = [words for words in commands if words != "--help"]  # which ends the process
    for words in ("--help", " + ".join(lines)):
        done = run("tests.support.without_posix", words, hidden)
        cost = r"The fit of \d+ rows will take about \d+ s of processor time\n" if "estimate" in words else ""
        assert not cost or re.fullmatch(cost, done.stderr), (words, done.stderr[-2000:])
        assert "Traceback" not in done.stderr, (words, done.stderr[-2000:])
        assert done.returncode == 0, (words, done.stderr[-2000:])
    together = f"from orchestrator.cli import main; print([main(words.split()) for words in {lines!r}])"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-c", together], check=False, cwd=here, env=environment, capture_output=True, text=True
    )
    assert done.stdout.splitlines()[-1] == str([0] * len(lines)), done.stderr[-2000:]
    written = sorted(p.relative_to(here) for p in (*here.rglob("results/*/*.json"), *here.glob("built/*.json")))
    named = {words.split()[0] for words in commands} - {"--help", "report"}
    assert {path.stem for path in written} >= named - {"regulator", "ssp"}
    for path in written:
        one, other = (numbers(json.loads((folder / path).read_text())) for folder in (here, hidden))
        assert one == other, path
    for fmu in here.glob("built/*.fmu"):
        assert fmu.read_bytes() == (hidden / "built" / fmu.name).read_bytes()


def test_every_command_that_ends_by_itself_is_run() -> None:
    run_here = {words.split()[0] for words in (*COMMANDS, *AT_NIGHT)} - {"--help"}
    assert run_here == set(KNOWN) - {"workbench"}


def test_the_workbench_runs_a_job(tmp_path: Path) -> None:
    pytest.importorskip("starlette")
    with workbench(tmp_path / "session", module="tests.support.without_posix") as served:
        log = served.upload(drive_log(tmp_path / "log.csv", rows=400, unknown="Load position [deg]"))
        assert b"<html" in served.ask("GET", "")[1]
        job = served.wait(served.start("inspect", [log]))
        assert job["state"] == "done", served.ask("GET", f"results/{job['name']}/output.txt")
        stopped = served.start("estimate", [log], no_diagnose=True)
        assert served.ask("POST", f"jobs/{stopped}/stop", {})[0] < 300
        assert served.wait(stopped)["state"] == "stopped"


def test_a_child_without_a_group_is_ended_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the workbench does with its jobs: without signals to groups a job that is stopped ends."""
    monkeypatch.delattr(os, "killpg")
    monkeypatch.delattr(signal, "pthread_sigmask")
    assert operating_system.command_options() == {}
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    assert operating_system.signal_group(child.pid, signal.SIGINT)
    assert child.wait(60) != 0


def test_one_module_alone_imports_what_one_system_has() -> None:
    found: dict[str, set[str]] = {}
    words = re.compile(rf"\b({'|'.join(OF_ONE_SYSTEM)})\b")  # quicker than to read a file as a program
    for path in sorted((ROOT / "orchestrator").rglob("*.py")):
        for node in nodes_of(path) if words.search(path.read_text(encoding="utf-8")) else ():
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            if OF_ONE_SYSTEM & set(names):
                found.setdefault(path.name, set()).update(OF_ONE_SYSTEM & set(names))
    assert found == {"operating_system.py": {"fcntl", "resource"}}
