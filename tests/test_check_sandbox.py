"""The limits of the child process, with children of our own instead of FMUs."""

import os
import sys
import time
from pathlib import Path

import pytest

from orchestrator.checking.sandbox import Ending, Limits, run_child

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the limits are those of Linux")
QUICK = Limits(time=1.0, memory=128 << 20, output=1 << 20, total=20.0)


def child(tmp_path: Path, limits: Limits, *arguments: str) -> tuple[Ending, list[bytes]]:
    work = tmp_path / "work"
    work.mkdir()
    lines: list[bytes] = []
    ending = run_child("tests.support.child_programs", list(arguments), work, limits, lines.append)
    return ending, lines


def test_lines_arrive_and_the_exit_code_too(tmp_path: Path) -> None:
    ending, lines = child(tmp_path, QUICK, "talk")
    assert (ending.reason, ending.code, ending.left) == ("exit", 3, False)
    assert lines == [b"one", b"two"]


def test_silence_ends_at_the_time_limit_and_talking_prolongs_it(tmp_path: Path) -> None:
    began = time.monotonic()
    ending, lines = child(tmp_path, QUICK, "slow")
    assert ending.reason == "time"
    assert len(lines) == 4
    assert 2.0 < time.monotonic() - began < 10.0


def test_the_total_time_holds_for_talkers(tmp_path: Path) -> None:
    ending, _ = child(tmp_path, Limits(time=5.0, total=1.0), "forever")
    assert ending.reason == "time"


def test_memory_is_limited(tmp_path: Path) -> None:
    ending, _ = child(tmp_path, QUICK, "eat")
    assert ending.reason == "memory"


def test_files_are_limited(tmp_path: Path) -> None:
    _, lines = child(tmp_path, QUICK, "write")
    assert lines == [b"File too large"]
    assert (tmp_path / "work" / "large").stat().st_size <= QUICK.output


def test_signals_are_told(tmp_path: Path) -> None:
    ending, _ = child(tmp_path, QUICK, "abort")
    assert ending.describe() == "the process was ended by SIGABRT"


def test_the_memory_of_the_parent_is_not_the_childs(tmp_path: Path) -> None:
    large = b"x" * (2 * QUICK.memory)
    ending, _ = child(tmp_path, QUICK, "abort")
    assert len(large) > QUICK.memory
    assert ending.reason == "signal"


def test_grandchildren_are_killed_and_told(tmp_path: Path) -> None:
    ending, lines = child(tmp_path, Limits(), "fork")
    assert ending.left
    orphan = int(lines[0])
    deadline = time.monotonic() + 5.0
    while _alive(orphan) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not _alive(orphan)


def _alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"


def test_secrets_and_the_repository_are_kept_from_the_child(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MY_ACCESS_TOKEN", "secret")
    monkeypatch.setenv("HARMLESS", "yes")
    _, lines = child(tmp_path, QUICK, "environment")
    names, path, temporary = (line.decode() for line in lines)
    assert "HARMLESS" in names.split()
    assert "MY_ACCESS_TOKEN" not in names.split()
    assert str(Path(__file__).parents[1]) not in path.split(os.pathsep)
    assert temporary == str(tmp_path / "tmp")
