"""Ctrl-C, SIGTERM and SIGHUP end every command alike: one word, an exit code of their own, and nothing left."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from orchestrator.errors import SlaveError
from orchestrator.fmi.messages import ERROR
from orchestrator.shared import stopping
from tests.support.c_fmu import have_compiler
from tests.support.engine_process import ROOT, children
from tests.support.hostile_fmus import World, command
from tests.support.waiting import HANGS, wait_until

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or not have_compiler(), reason="the FMUs are built with a C compiler on Linux"
)
SPINNING = 0.5  # s of processor time since it was started, and no answer: the FMU is within its step
ENDINGS = {"SIGINT": "interrupted", "SIGTERM": "ended by SIGTERM", "SIGHUP": "ended by SIGHUP"}


@pytest.fixture(autouse=True)
def _ctrl_c_is_heard():
    """Programs that start here hear Ctrl-C, also where the tests themselves run in the background of a shell."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def wait_for_step(pid: int, process: "subprocess.Popen[str]") -> None:
    """Wait until a child of the process spins in the FMU's step: it takes processor time, and nothing else happens."""
    before, since = {}, {}

    def spins() -> bool:
        assert process.poll() is None, process.stderr.read()
        for child in children(pid):
            try:
                if b"MassSpring" not in Path(f"/proc/{child}/maps").read_bytes():
                    continue
                fields = Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()
                reads = Path(f"/proc/{child}/io").read_text().splitlines()[2]  # system calls that read: requests
            except OSError:
                continue
            spent = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
            if before.get(child) != reads:
                before[child], since[child] = reads, spent
            elif spent - since[child] > SPINNING:
                return True
        return False

    wait_until(spins, lambda: "no child came to its step")


@pytest.fixture
def heeded() -> Iterator[None]:
    """Signals act on what a test starts, even where whoever started the tests has them ignored (`nohup`)."""
    before = {name: signal.signal(name, signal.SIG_DFL) for name in (signal.SIGTERM, signal.SIGHUP)}
    before[signal.SIGINT] = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    for name, handler in before.items():
        signal.signal(name, handler)


@pytest.mark.usefixtures("heeded")
@pytest.mark.parametrize(
    ("kind", "names"),
    [
        ("check", ["SIGINT", "SIGTERM"]),
        ("simulate", ["SIGTERM"]),
        ("sweep", ["SIGINT"]),
        ("ssp", ["SIGHUP"]),
        ("diagnose", ["SIGTERM"]),
        # By day each signal and each command once.
        *(
            pytest.param("check", names, marks=pytest.mark.night)
            for names in (["SIGINT"], ["SIGTERM"], ["SIGHUP"], ["SIGTERM", "SIGTERM"])
        ),
        pytest.param("sweep", ["SIGTERM"], marks=pytest.mark.night),
    ],
)
def test_a_signal_while_an_fmu_runs_ends_the_command_and_leaves_nothing(
    kind: str, names: list[str], tmp_path: Path
) -> None:
    world = World(tmp_path)
    try:
        words = command(world, kind, world.fmu("step", "spin"), 600.0)
        process = subprocess.Popen(
            [sys.executable, *words], cwd=world.folder, env=world.environment(), text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        wait_for_step(process.pid, process)
        for name in names:
            process.send_signal(getattr(signal, name))
        said, told = process.communicate(timeout=HANGS)
        assert process.returncode == 128 + getattr(signal, names[0]), told
        (line,) = told.splitlines()
        assert line.startswith(ENDINGS[names[0]])
        if kind == "sweep":
            assert "cases are kept: go on with `--resume`" in line
        assert "run.crash" not in said
        assert world.harm() == []
    finally:
        world.close()


PROGRAM = """
import os, signal, sys
from collections.abc import Iterator
from pathlib import Path
for name in {ignored!r}:
    signal.signal(getattr(signal, name), signal.SIG_IGN)
from orchestrator import cli
from orchestrator.__main__ import run
from orchestrator.shared.output import stage_output
def main():
    with stage_output(Path("out")) as folder:
        (folder / "a").write_text("a")
        for name in {sent!r}:
            os.kill(os.getpid(), getattr(signal, name))
    print("came to its end")
    return 0
cli.main = main
run()
"""


@pytest.mark.usefixtures("heeded")
@pytest.mark.parametrize(
    ("ignored", "sent", "code", "told"),
    [
        ([], ["SIGTERM"], 143, "ended by SIGTERM\n"),
        ([], ["SIGHUP"], 129, "ended by SIGHUP\n"),
        ([], ["SIGINT"], 130, "interrupted\n"),
        (["SIGHUP"], ["SIGHUP"], 0, ""),  # `nohup`
        (["SIGINT"], ["SIGINT"], 0, ""),  # in the background of a shell
        (["SIGINT"], ["SIGINT", "SIGTERM"], 143, "ended by SIGTERM\n"),
    ],
)
def test_signals_end_a_command_unless_whoever_started_it_has_them_ignored(
    ignored: list[str], sent: list[str], code: int, told: str, tmp_path: Path
) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(ignored=ignored, sent=sent)], cwd=tmp_path, text=True,
        capture_output=True, check=False, env=os.environ | {"PYTHONPATH": str(ROOT)},
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (code, told)
    assert done.stdout == ("" if code else "came to its end\n")
    assert [p.name for p in tmp_path.iterdir()] == ([] if code else ["out"])


def test_a_stop_that_an_fmu_in_this_process_kept_to_itself_is_no_fault_of_it(tmp_path, monkeypatch) -> None:
    from orchestrator.fmi.instances import make_slave
    from tests.support.c_fmu import build_c_fmu

    slave = make_slave("a", build_c_fmu(tmp_path))
    try:
        with pytest.raises(SlaveError, match="returned Error"):
            slave._check(ERROR, "fmi2DoStep")
        monkeypatch.setattr(stopping, "_stops", [(signal.SIGTERM, 0.0)])
        with pytest.raises(KeyboardInterrupt):
            slave._check(ERROR, "fmi2DoStep")
        assert stopping.stop_in_words() == ("ended by SIGTERM", 143)
    finally:
        slave.close()
