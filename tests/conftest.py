"""Fixtures that all areas share, and the order in which files run."""

import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from orchestrator.building.build import ensure_built

LONG = ("test_readme.py", "test_contributing.py", "test_notebooks.py", "test_public_api.py")  # minutes each
EARLY = 0.8  # share of the run over which they are spread


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Spread the longest tests over the first part of the run: each worker begins some of them early."""
    long = [item for item in items if item.path.name in LONG]
    items[:] = [item for item in items if item.path.name not in LONG]
    spacing = EARLY * len(items) / max(len(long), 1)
    for place, item in reversed(list(enumerate(long))):
        items.insert(int(place * spacing), item)


@pytest.fixture(scope="session", autouse=True)
def _temporary_files_end_with_the_run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep what tests, and tools of others that they run, leave in the temporary directory from staying there."""
    folder = tmp_path_factory.mktemp("tmp")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TMPDIR", str(folder))
        patch.setattr(tempfile, "tempdir", None)
        yield
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(scope="session")
def fmus() -> dict[str, Path]:
    """The three FMUs of the project, built once: model name to path."""
    return ensure_built(["Drivetrain", "LqrController", "KalmanEstimator"])
