"""Result directories: whole or not at all, whatever happens."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from orchestrator.errors import OutputError
from orchestrator.output import staged

ROOT = Path(__file__).resolve().parents[1]


def test_files_appear_together_at_the_end(tmp_path):
    with staged(tmp_path / "out") as directory:
        (directory / "a.txt").write_text("a")
        assert not (tmp_path / "out" / "a.txt").exists()
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["a.txt"]


def test_an_error_leaves_nothing(tmp_path):
    def fail():
        with staged(tmp_path / "x" / "out") as directory:
            (directory / "a.txt").write_text("a")
            raise ValueError("bad")

    with pytest.raises(ValueError, match="bad"):
        fail()
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path):
    with pytest.raises(OutputError, match="No space left on device"), staged(tmp_path / "out"):
        raise OSError(28, "No space left on device")
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_process_left_is_cleared_away(tmp_path):
    code = (
        "import os, signal, sys; from pathlib import Path; from orchestrator.output import staged\n"
        f"with staged(Path({str(tmp_path)!r})) as d: (d / 'a').write_text('a'); os.kill(os.getpid(), signal.SIGKILL)"
    )
    subprocess.run([sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": str(ROOT)}, check=False)
    assert len(list(tmp_path.iterdir())) == 1
    with staged(tmp_path) as mine, staged(tmp_path) as other:
        assert sorted(tmp_path.iterdir()) == sorted([mine, other])
    assert list(tmp_path.iterdir()) == []
