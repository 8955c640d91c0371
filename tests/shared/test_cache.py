"""What is made once and kept."""

import os
from pathlib import Path

import pytest

from orchestrator.shared import cache


def test_bytes_are_made_once_for_a_key_and_anew_when_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(cache, "cache_directory", lambda name: tmp_path)
    made: list[bytes] = []

    def ask(*key: str) -> bytes:
        return cache.remember("a", key, lambda: made.append(b"x") or f"{key}".encode())

    assert ask("ab", "c") == ask("ab", "c") == b"('ab', 'c')"
    assert ask("a", "bc") == b"('a', 'bc')"  # the same letters, another key
    assert len(made) == 2
    for path in tmp_path.glob("*.bin"):
        path.write_bytes(path.read_bytes()[:-1] + b"?")
    assert ask("ab", "c") == b"('ab', 'c')"
    assert len(made) == 3
    assert "was damaged, and is made anew" in caplog.text
    monkeypatch.setattr(cache, "cache_directory", lambda name: tmp_path / "missing")
    assert ask("ab", "c") == b"('ab', 'c')"


def test_a_folder_forgets_the_oldest_files_above_a_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "MOST_FILES", 4)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    folder = tmp_path / "backlash-cosim" / "of_this_test"
    (folder / "sub").mkdir(parents=True)
    for n in range(7):
        (folder / f"{n}.so").touch()
        os.utime(folder / f"{n}.so", (0, 100 - n))
    assert cache.cache_directory("of_this_test") == folder
    assert sorted(path.name for path in folder.iterdir()) == ["0.so", "1.so", "2.so", "3.so", "sub"]
