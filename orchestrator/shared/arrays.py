"""Arrays of numbers: their type, and their form in JSON."""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def plain_numbers(column: Array, digits: int = 10) -> list[float | None]:
    """Return numbers as JSON holds them: rounded, and null where one is missing or not finite."""
    return [float(f"{value:.{digits}g}") if math.isfinite(value) else None for value in column.tolist()]
