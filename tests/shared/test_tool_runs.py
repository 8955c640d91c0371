"""Programs that are run for their result: none outlives the command, and no temporary folder stays for ever."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.shared.operating_system import alive
from orchestrator.shared.scratch import Scratch
from orchestrator.shared.tool_runs import run_tool
from tests.support.waiting import HANGS, wait_until

ROOT = Path(__file__).resolve().parents[2]
COMPILER = """
import os, signal, subprocess, sys
if sys.argv[1] == "stubborn":
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
child = subprocess.Popen(["sleep", "600"])
open("pids", "w").write(f"{os.getpid()} {child.pid}\\n")
child.wait()
"""
COMMAND = f"""
import sys
from orchestrator.shared.stopping import stop_on_signals
from orchestrator.shared.tool_runs import run_tool
stop_on_signals()
run_tool([sys.executable, "-c", {COMPILER!r}, sys.argv[1]])
"""


@pytest.mark.skipif(sys.platform == "win32", reason="there are no process groups")
@pytest.mark.parametrize("kind", ["plain", "stubborn"])
def test_a_compiler_and_what_it_started_end_with_their_command(kind: str, tmp_path: Path) -> None:
    words = [sys.executable, "-c", COMMAND, kind]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    with subprocess.Popen(words, cwd=tmp_path, env=environment, stderr=subprocess.DEVNULL) as process:
        pids = tmp_path / "pids"
        wait_until(lambda: pids.exists() and pids.read_text().endswith("\n"), lambda: "nothing was started")
        process.send_signal(signal.SIGTERM)
        process.wait(HANGS)
    compiler, child = map(int, pids.read_text().split())
    wait_until(lambda: not alive(compiler) and not alive(child), lambda: "something is left")


def test_what_a_program_is_given_and_says_goes_through() -> None:
    code = "import sys; sys.stderr.write('told'); print(sys.stdin.read()); sys.exit(3)"
    done = run_tool([sys.executable, "-c", code], given="words")
    assert (done.returncode, done.stdout, done.stderr) == (3, "words\n", "told")


def test_scratch_folders_of_killed_processes_go_wherever_they_are(tmp_path: Path) -> None:
    code = (
        "import os, signal; from pathlib import Path; from orchestrator.shared.scratch import Scratch\n"
        f"Scratch('compile', Path({str(tmp_path)!r})); os.kill(os.getpid(), signal.SIGKILL)"
    )
    subprocess.run([sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": str(ROOT)}, check=False)
    assert len(list(tmp_path.iterdir())) == 1
    with Scratch("compile", tmp_path) as scratch:
        assert list(tmp_path.iterdir()) == [scratch.path]


def test_temporary_folders_are_made_in_one_place() -> None:
    made = re.compile(r"mkdtemp|TemporaryDirectory|NamedTemporaryFile|mkstemp")
    places = {p.name for p in (ROOT / "orchestrator").rglob("*.py") if made.search(p.read_text(encoding="utf-8"))}
    assert places == {"scratch.py", "publishing.py", "cache.py"}
