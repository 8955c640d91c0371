"""Compiled sources in the user's cache: what is damaged there is written anew."""

from pathlib import Path

import pytest

from orchestrator.plants import compiled as module
from orchestrator.shared.equation_files import SOURCES, module_name
from orchestrator.shared.numba_cache import ALGEBRA, UNCOUNTED


@pytest.mark.parametrize("damage", [b"", b"raise SystemExit\n", b"\xff\xfe"])
def test_a_damaged_source_is_not_imported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, damage: bytes) -> None:
    monkeypatch.setattr(module, "cache_directory", lambda _: tmp_path)
    copied = module._copy_source.__wrapped__
    path = copied("drivetrain")
    intact = path.read_bytes()
    path.write_bytes(damage)
    assert copied("drivetrain") == path
    assert path.read_bytes() == intact


def test_references_are_counted_where_a_module_makes_lists_or_calls_one_that_does() -> None:
    listing = {module_name(path) for path in SOURCES.rglob("*.py") if "list[" in path.read_text(encoding="utf-8")}
    adapters = {name for name in listing if name.endswith(("_slave", "_base", "_state"))}
    assert set(module.LISTING) == listing - adapters
    assert module._options("equations") == {**ALGEBRA, **UNCOUNTED}
    assert module._options("linear_mode") == module._options("drivetrain") == {}
