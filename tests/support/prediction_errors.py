"""Prediction errors of a model, made up."""

import numpy as np

from orchestrator.diagnosis.proof.horizons import Horizons
from tests.support.short_records import SETTINGS


def horizons(errors: list[float], squares: np.ndarray | None = None) -> Horizons:
    """Four horizons of one encoder; the third is of runs, the last of the whole part."""
    values = np.array(errors)[:, None]
    steps = tuple(np.full((40, 1), e**2) for e in errors[:3]) if squares is None else (squares,) * 3
    return Horizons(
        ("one sample", "50 ms", "500 ms", "whole part"), values, np.full((4, 1), 9.0), np.array([0.99]),
        np.array([0.01]), steps, ((),), SETTINGS.proof.horizons,
    )  # fmt: skip
