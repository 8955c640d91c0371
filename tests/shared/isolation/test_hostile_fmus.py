"""What hostile FMUs do under the commands: a part of the matrix that ``benchmarks/hostile_fmus.py`` runs in full."""

from pathlib import Path

import pytest

from orchestrator.shared.isolation.walls import support
from tests.support.c_fmu import have_compiler
from tests.support.hostile_fmus import BEHAVIOURS, World, verdict

pytestmark = [
    pytest.mark.skipif(not have_compiler(), reason="there is no C compiler"),
    pytest.mark.skipif(bool(support().not_enforced), reason="this kernel has no walls"),
]
SOME = [
    ("simulate", "load", "exit"),
    ("simulate", "step", "segv"),
    ("simulate", "step", "hang"),
    ("simulate", "step", "nan"),
    ("simulate", "step", "daemon"),
    ("simulate", "step", "delete"),
    ("sweep", "step", "exit"),
    ("sweep", "step", "flood_descriptors"),
    ("sweep", "step", "read"),
    ("check", "step", "forge"),
    ("check", "step", "flood_descriptors"),
    ("check", "step", "fork_bomb"),
    ("check", "step", "deep_folders"),
    ("check", "step", "fifo"),
    ("ssp", "step", "segv"),
    ("ssp", "step", "write"),
    ("diagnose", "step", "quick_exit"),
]


def test_the_matrix_is_whole() -> None:
    assert len(BEHAVIOURS) >= 55


@pytest.mark.parametrize(("kind", "place", "action"), SOME)
def test_it_is_contained(tmp_path: Path, kind: str, place: str, action: str) -> None:
    world = World(tmp_path / "world")
    try:
        assert verdict(world, kind, place, action, 3.0) == []
    finally:
        world.close()


def test_the_world_notices_harm(tmp_path: Path) -> None:
    world = World(tmp_path / "world")
    try:
        assert world.harm() == []
        world.precious.write_text("yours")
        (world.folder / "temporary" / "left").touch()
        assert len(world.harm()) == 2
    finally:
        world.close()
