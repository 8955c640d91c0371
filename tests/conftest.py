"""Fixtures that all areas share, and the order in which files run."""

from pathlib import Path

import pytest

from orchestrator.building.build import ensure_built

LONG = ("test_readme.py", "test_contributing.py", "test_notebooks.py", "test_public_api.py")  # minutes each


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let the longest tests begin first: no core must wait for them at the end."""
    items.sort(key=lambda item: item.path.name not in LONG)


@pytest.fixture(scope="session")
def fmus() -> dict[str, Path]:
    """The three FMUs of the project, built once: model name to path."""
    return ensure_built(["Drivetrain", "LqrController", "KalmanEstimator"])
