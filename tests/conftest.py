"""Fixtures that all areas share, and the order in which files run."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from orchestrator.building.build import ensure_built

# What a busy computer takes longer for is no failure.
settings.register_profile("any computer", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any computer")

LONG = ("test_readme.py", "test_contributing.py", "test_notebooks.py", "test_public_api.py")  # minutes each


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest tests first in the part of each worker: the run does not wait for one of them at its end.

    Those that share a slow fixture go to one worker, which makes it once: ``@pytest.mark.slow(shares="fixture")``.
    """
    workers = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    minutes = [item for item in items if item.path.name in LONG]
    slow = [item for item in items if item.get_closest_marker("slow") and item not in minutes]
    early = minutes + slow
    together: dict[object, list[pytest.Item]] = {}
    for item in early:
        together.setdefault(_work_of(item), []).append(item)
    parts: list[list[pytest.Item]] = [[] for _ in range(workers)]
    for place, group in enumerate(together.values()):
        parts[place % workers] += group
    long = set(early)
    others = iter([item for item in items if item not in long])
    size = -(-len(items) // workers)
    items[:] = [item for part in parts for item in (*part, *islice(others, max(0, size - len(part))))]
    items += others


def _work_of(item: pytest.Item) -> object:
    """Return what tests have in common that are run by one worker: the test itself where that is nothing."""
    marker = item.get_closest_marker("slow")
    shared = marker.kwargs.get("shares") if marker else None
    return (item.path, shared) if shared else item


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
