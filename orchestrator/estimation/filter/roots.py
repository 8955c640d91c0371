"""The first root of a cubic, by which contacts are located."""

import math


def first_root(v0: float, s0: float, v1: float, s1: float, h: float) -> float:
    """Return the first time in (0, h] at which the cubic with these end values and slopes turns negative, or -1.0."""
    c1 = h * s0
    c2 = 3.0 * (v1 - v0) - h * (2.0 * s0 + s1)
    c3 = 2.0 * (v0 - v1) + h * (s0 + s1)
    # Between its turning points the cubic is monotone, so looking there finds even a shallow dip.
    first, second = 1.0, 1.0
    square = c2 * c2 - 3.0 * c1 * c3
    if square > 0.0:
        q = -(c2 + math.sqrt(square) * (1.0 if c2 >= 0.0 else -1.0))
        one = q / (3.0 * c3) if c3 != 0.0 else 1.0
        two = c1 / q if q != 0.0 else 1.0
        first, second = min(one, two), max(one, two)
    low = 0.0
    for m in range(3):
        t = first if m == 0 else (second if m == 1 else 1.0)
        if t <= low or t > 1.0:
            continue
        value = v1 if t == 1.0 else v0 + t * (c1 + t * (c2 + t * c3))
        if value < 0.0:
            high = t
            for _ in range(45):
                t = 0.5 * (low + high)
                if v0 + t * (c1 + t * (c2 + t * c3)) < 0.0:
                    high = t
                else:
                    low = t
            return 0.5 * (low + high) * h
        low = t
    return -1.0
