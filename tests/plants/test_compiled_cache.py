"""Compiled sources in the user's cache: what is damaged there is written anew."""

from pathlib import Path

import pytest

from orchestrator.plants import compiled as module


@pytest.mark.parametrize("damage", [b"", b"raise SystemExit\n", b"\xff\xfe"])
def test_a_damaged_source_is_not_imported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, damage: bytes) -> None:
    monkeypatch.setattr(module, "cache_directory", lambda _: tmp_path)
    copied = module._copied_source.__wrapped__
    path = copied("drivetrain")
    intact = path.read_bytes()
    path.write_bytes(damage)
    assert copied("drivetrain") == path
    assert path.read_bytes() == intact
