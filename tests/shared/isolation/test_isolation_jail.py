"""The jail: a channel that nothing runs from, limits, walls of the kernel, and nothing left."""

import os
import pickle
import re
import select
import socket
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from orchestrator.errors import ChildError, ScenarioError, SimulationError, SlaveError
from orchestrator.shared.isolation import jail as jail_module
from orchestrator.shared.isolation.jail import Jail, Limits
from orchestrator.shared.isolation.walls import support
from orchestrator.shared.operating_system import alive, processor_wait
from orchestrator.shared.scratch import PREFIX, Scratch
from tests.support.engine_process import wait_until_gone

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the limits are those of Linux")
ENTRY = "tests.support.jail_programs:opened"
QUICK = Limits(time=60.0, memory=256 << 20, output=2 << 20, disk=8 << 20, threads=8, total=600.0)
enclosed = pytest.mark.skipif(bool(support().not_enforced), reason="this kernel has no walls")


@pytest.fixture(autouse=True)
def nothing_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    place = tmp_path / "temporary"
    place.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(place))
    yield
    assert not [p.name for p in place.iterdir() if "-cache-" not in p.name]  # without a home, until the process ends


def test_answers_come_back_with_their_types() -> None:
    plain = [1, 2.5, None, "é", b"\0", True]
    with Jail(ENTRY, {"a": 1}, limits=QUICK) as jail:
        assert jail.call(["echo", plain], Any) == [{"a": 1}, plain]
        assert np.array_equal(jail.call(["array", 6], Any), [[0.0, 1.0, 2.0], [3.0, 4.0, 5.0]])


@dataclass(frozen=True)
class Row:
    name: str
    values: NDArray[np.float64]
    count: int | None = None


def test_an_answer_is_of_the_type_that_is_asked_for_or_ends_the_child() -> None:
    good = {"name": "a", "values": np.arange(2.0)}
    with Jail(ENTRY, limits=QUICK) as jail:
        (_, row) = jail.call(["echo", good], tuple[None, Row])
        assert (row.name, row.values.tolist(), row.count) == ("a", [0.0, 1.0], None)
    wrong = [{"name": 1}, {"values": [0.0, 1.0]}, {"values": np.arange(2)}, {"values": np.arange(2.0) > 0.0}]
    for change in [*wrong, {"values": None}, {"count": 0.5}]:
        with Jail(ENTRY, limits=QUICK) as jail:
            with pytest.raises(ChildError, match="its answer must be of another type") as raised:
                jail.call(["echo", good | change], tuple[None, Row])
            assert raised.value.reason == "protocol"
            assert not Path(f"/proc/{jail.pid}").exists()


def test_pickles_of_a_child_are_bytes_and_nothing_else() -> None:
    with Jail(ENTRY, limits=QUICK) as jail, pytest.raises(ChildError, match="of another type"):
        jail.call(["echo", pickle.dumps(Row("a", np.arange(2.0)))], tuple[None, Row])
    folder = Path(jail_module.__file__).parents[2]
    found = {
        path.relative_to(folder).as_posix()
        for path in folder.rglob("*.py")
        if re.search(r"pickle\.loads?\(|Unpickler|multiprocessing|shelve|marshal\.loads?|allow_pickle=True",
                     path.read_text(encoding="utf-8"))
    }  # fmt: skip
    # What the parent sent; see docs/security.md.
    own = {"shared/isolation/inmate.py", "engine/lane.py", "engine/worker.py", "engine/cluster.py"}
    assert found == own


@pytest.mark.parametrize("error", [KeyboardInterrupt(), MemoryError()])
def test_what_cleans_up_after_an_interruption_does_not_hide_it(error: BaseException) -> None:
    def interrupt() -> None:
        raise error

    with Jail(ENTRY, limits=QUICK) as jail:
        jail.start()
        jail._tick = interrupt  # type: ignore[method-assign]
        for request in (["sleep", 60.0], ["echo", 1]):  # the second as an instance is freed, whatever happened
            with pytest.raises(type(error)):
                jail.call(request, Any)
        assert not Path(f"/proc/{jail.pid}").exists()


def test_errors_come_back_as_they_are_and_the_child_lives() -> None:
    with Jail(ENTRY, limits=QUICK) as jail:
        with pytest.raises(ScenarioError, match=r"`it` must be right, but is wrong"):
            jail.call(["refuse"], Any)
        with pytest.raises(SimulationError, match=r"KeyError: 'odd'"):
            jail.call(["fail"], Any)
        with pytest.raises(SlaveError, match=r"it returned Error \(it printed: no licence\)"):
            jail.call(["print"], Any)
        assert jail.call(["echo", 1], Any) == [None, 1]


@pytest.mark.parametrize(
    ("request_", "reason", "text"),
    [
        (["leave", 0], "exit", "exit code 0"),
        (["leave", 7], "exit", "exit code 7"),
        (["abort"], "signal", "SIGABRT"),
        (["sleep", 30.0], "time", "within 1 s"),
        (["eat"], "memory", "256 MiB"),
        (["fill"], "disk", "8 MiB"),
        (["threads"], "threads", "8 threads"),
        (["forge", b"\0\0\0\0\0\0\0\5hello" * 2], "protocol", "protocol"),
        (["flood"], "protocol", "at most"),
        (["deep"], "exit", "exit code 0"),
    ],
)
def test_every_other_ending_is_told_and_leaves_nothing(request_: list, reason: str, text: str) -> None:
    with Jail(ENTRY, limits=QUICK) as jail:
        jail.start()
        with pytest.raises(ChildError, match=text) as raised:
            jail.call(request_, Any, 1.0 if reason == "time" else None)
        assert raised.value.reason == reason
        assert not Path(f"/proc/{jail.pid}").exists()


def test_what_nobody_asked_for_ends_the_child() -> None:
    with Jail(ENTRY, limits=QUICK) as jail:
        assert jail.call(["early"], Any) == "first"
        select.select([jail._link], [], [])  # what nobody asked for has arrived
        with pytest.raises(ChildError, match="without being asked"):
            jail.call(["echo", 1], Any)


def test_the_environment_has_no_secrets_and_its_own_folders(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MY_ACCESS_TOKEN", "secret")
    monkeypatch.setenv("HARMLESS", "yes")
    with Jail(ENTRY, limits=QUICK) as jail:
        names, path, temporary, work, leads = jail.call(["environment"], Any)
        assert "HARMLESS" in names
        assert "MY_ACCESS_TOKEN" not in names
        assert "" not in path
        assert (Path(temporary), Path(work)) == (jail.scratch / "tmp", jail.scratch)
        assert leads


REFUSED = "PermissionError"


@enclosed
@pytest.mark.parametrize("what", ["read", "write", "delete", "truncate", "chmod", "rename", "link", "symlink", "utime"])
def test_files_of_the_user_are_out_of_reach(tmp_path: Path, what: str) -> None:
    precious = tmp_path / "precious"
    precious.write_text("mine")
    before = precious.stat()
    with Jail(ENTRY, limits=QUICK) as jail:
        assert jail.call(["attempt", what, str(precious)], Any) in (REFUSED, "OSError")
    after = precious.stat()
    assert precious.read_text() == "mine"
    assert (before.st_mode, before.st_mtime_ns, before.st_nlink) == (after.st_mode, after.st_mtime_ns, after.st_nlink)


@enclosed
def test_without_walls_the_same_calls_work(tmp_path: Path) -> None:
    precious = tmp_path / "precious"
    precious.write_text("mine")
    with Jail(ENTRY, limits=QUICK, walls=False) as jail:
        assert jail.call(["attempt", "read", str(precious)], Any) == "done"
        assert jail.call(["attempt", "delete", str(precious)], Any) == "done"
        assert jail.call(["attempt", "unix"], Any) == "done"


@enclosed
def test_network_processes_and_signals_are_refused(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server, Jail(ENTRY, limits=QUICK, read=[tmp_path]) as jail:
        port = str(server.getsockname()[1])
        assert jail.call(["attempt", "tcp", port], Any) == REFUSED
        for what in ("udp", "unix", "fork", "posix_spawn", "exec", "death", "shm"):
            assert jail.call(["attempt", what], Any) == REFUSED, what
        for what in ("signal", "ptrace"):
            assert jail.call(["attempt", what, str(os.getpid())], Any) == REFUSED, what
        assert jail.call(["attempt", "list", str(tmp_path)], Any) == "done"
        assert jail.call(["attempt", "write", str(tmp_path / "new")], Any) == REFUSED
        for what in ("thread", "scratch"):
            assert jail.call(["attempt", what], Any) == "done", what
        server.settimeout(0.0)
        with pytest.raises(BlockingIOError):
            server.accept()


def test_a_child_dies_with_its_parent_and_the_next_run_cleans_up() -> None:
    program = (
        f"import tempfile, time; tempfile.tempdir = {tempfile.tempdir!r}\n"
        f"from orchestrator.shared.isolation.jail import Jail\n"
        f"jail = Jail({ENTRY!r}); jail.start(); print(jail.pid, flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        assert alive(child)
        parent.kill()
    wait_until_gone([child])  # where no process reaps orphans it stays as a zombie
    place = Path(str(tempfile.tempdir))
    assert list(place.glob(f"{PREFIX}*"))
    from orchestrator.shared import scratch

    scratch._swept.clear()
    with Scratch() as fresh:
        assert list(place.iterdir()) == [fresh.path]


@pytest.mark.parametrize(("share", "seconds", "ends"), [(1.0, 1.5, False), (0.0, 1.5, True), (1.0, 60.0, True)])
def test_what_waits_for_a_processor_has_more_time_but_not_for_ever(
    monkeypatch: pytest.MonkeyPatch, share: float, seconds: float, ends: bool
) -> None:
    monkeypatch.setattr(jail_module, "processor_wait", lambda pid: share * time.monotonic())
    with Jail(ENTRY, "x", limits=Limits(time=0.5)) as jail:
        jail.start()
        if ends:  # before the sleep does
            with pytest.raises(ChildError) as error:
                jail.call(["sleep", seconds], Any)
            assert error.value.reason == "time"
        else:
            jail.call(["sleep", seconds], Any)


@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="the system does not tell")
def test_the_system_tells_how_long_a_process_waits_for_a_processor() -> None:
    busy = "import os, time\nos.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\nwhile True: pass"
    children = [subprocess.Popen([sys.executable, "-c", busy]) for _ in range(3)]
    try:
        before = processor_wait(children[0].pid)
        while processor_wait(children[0].pid) < before + 0.2:
            assert children[0].poll() is None
            time.sleep(0.05)
        assert processor_wait(os.getpid()) < time.monotonic()
    finally:
        for child in children:
            child.kill()
            child.wait()
    assert processor_wait(2**22 + 1) == 0.0
