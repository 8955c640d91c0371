"""Conversions from what an MDF file holds to values: which are refused, and the one that is done here."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

FORMULA_4, FORMULA_3 = 3, 10  # conversion types of the two versions
RANGES_4 = 6


def has_formula(conversion: Any, version: str) -> bool:
    """Return whether a conversion, or one that it refers to, is a formula: a file's text is never run."""
    formula = FORMULA_4 if version >= "4" else FORMULA_3
    return any(one.conversion_type == formula for one in _walk(conversion))


def maps_ranges(conversion: Any, version: str) -> bool:
    """Return whether a conversion is a table from ranges to values."""
    return version >= "4" and getattr(conversion, "conversion_type", None) == RANGES_4


def hides_ranges(conversion: Any, version: str) -> bool:
    """Return whether a conversion to texts refers to a table from ranges to values."""
    return version >= "4" and any(one.conversion_type == RANGES_4 for one in list(_walk(conversion))[1:])


def apply_ranges(raw: NDArray[Any], conversion: Any) -> NDArray[np.float64]:
    """Return the values of a table of ranges (ASAM MDF 4, `cc_type` 6) for what a channel holds.

    Both ends of a range belong to it for whole numbers, the lower end alone for others. Of whole numbers asammdf finds
    the upper end of a range alone, and puts those beyond the table into its last range (8.8.28).
    """
    count = (conversion.val_param_nr - 1) // 3
    lower, upper, physical = (
        np.array([conversion[f"{part}_{k}"] for k in range(count)], dtype=float) for part in ("lower", "upper", "phys")
    )
    place = np.searchsorted(lower, raw, side="right") - 1
    inside = raw <= upper[place] if raw.dtype.kind in "iu" else raw < upper[place]
    return np.where((place >= 0) & inside, physical[place], conversion.default)


def _walk(conversion: Any) -> Iterator[Any]:
    """Yield a conversion and those that it refers to, such as the scale beside a text for `not available`."""
    if getattr(conversion, "conversion_type", None) is not None:
        yield conversion
        for one in (getattr(conversion, "referenced_blocks", None) or {}).values():
            yield from _walk(one)
