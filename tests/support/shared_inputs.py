"""Inputs of others, which are no part of the project: they lie in the folder that ``BACKLASH_COSIM_INPUTS`` names."""

import os
from pathlib import Path

import pytest

VARIABLE = "BACKLASH_COSIM_INPUTS"


def shared_input(name: str) -> Path:
    """Return the place of an input, or skip the test where it is absent."""
    path = Path(os.environ.get(VARIABLE, os.devnull)) / name
    if not path.exists():
        pytest.skip(f"{VARIABLE} names no folder that has {name}")
    return path
