"""Every file that fuzzing found to end in a traceback, a hang or more than a line."""

from pathlib import Path

import pytest

from tests.support.fuzz_targets import TARGETS, seeds

FILES = sorted((Path(__file__).parent / "fuzz_findings").iterdir())


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.name)
def test_what_fuzzing_found_is_read_or_refused(path: Path) -> None:
    TARGETS[path.name.partition("-")[0]](path.read_bytes())


@pytest.mark.parametrize("target", [t for t in TARGETS if t not in ("record", "archive", "description")])
def test_good_files_are_accepted(target: str) -> None:
    for data in seeds(target).values():
        assert TARGETS[target](data)
