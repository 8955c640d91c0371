"""Dimensions of unit names, so that the exponents of a BaseUnit can be checked."""

import re

# kg, m, s, A, K, mol, cd (the radian is taken as dimensionless)
_SYMBOLS: dict[str, dict[str, int]] = {
    "1": {}, "rad": {}, "deg": {}, "rev": {}, "sr": {}, "%": {},
    "kg": {"kg": 1},
    "m": {"m": 1}, "mm": {"m": 1}, "cm": {"m": 1}, "km": {"m": 1}, "um": {"m": 1},
    "s": {"s": 1}, "ms": {"s": 1}, "min": {"s": 1}, "A": {"A": 1}, "K": {"K": 1}, "degC": {"K": 1},
    "mol": {"mol": 1}, "cd": {"cd": 1}, "Hz": {"s": -1}, "rpm": {"s": -1},
    "N": {"kg": 1, "m": 1, "s": -2}, "kN": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2}, "bar": {"kg": 1, "m": -1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2}, "kJ": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3}, "kW": {"kg": 1, "m": 2, "s": -3},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "Ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2}, "Wb": {"kg": 1, "m": 2, "s": -2, "A": -1},
    "T": {"kg": 1, "s": -2, "A": -1},
}  # fmt: skip
_FACTOR = re.compile(r"([A-Za-z%]+|1)\^?(-?[0-9]+)?")


def dimension_of(name: str) -> dict[str, int] | None:
    """Exponents of SI base units of a name such as ``N.m.s/rad``, zeros may lack; None when it is not understood."""
    total: dict[str, int] = {}
    sign = 1
    for part in re.split(r"([/.*])", name.replace(" ", "").replace("(", "").replace(")", "") if _simple(name) else "?"):
        if part in (".", "*"):
            continue
        if part == "/":
            sign = -1
            continue
        match = _FACTOR.fullmatch(part)
        if match is None or match[1] not in _SYMBOLS:
            return None
        power = sign * int(match[2] or 1)
        for base, exponent in _SYMBOLS[match[1]].items():
            total[base] = total.get(base, 0) + power * exponent
    return total


def _simple(name: str) -> bool:
    """One fraction bar at most; what follows it is all below the bar when it is in brackets or a single unit."""
    if name.count("/") > 1:
        return False
    below = name.partition("/")[2]
    return "(" not in name.partition("/")[0] and (below.startswith("(") or not re.search(r"[.*]", below))
