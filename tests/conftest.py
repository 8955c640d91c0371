"""Fixtures that all areas share."""

from pathlib import Path

import pytest

from orchestrator.building.build import ensure_built


@pytest.fixture(scope="session")
def fmus() -> dict[str, Path]:
    """The three FMUs of the project, built once: model name to path."""
    return ensure_built(["Drivetrain", "LqrController", "KalmanEstimator"])
