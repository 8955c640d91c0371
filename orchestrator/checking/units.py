"""What names of units mean beyond doubt, so that the exponents, factors and offsets of a description can be checked."""

import re
from dataclasses import dataclass

from orchestrator.master.protocol import EXPONENTS
from orchestrator.shared.units import KnownUnit, parse_unit

# kg, m, s, A, K, mol, cd (the radian is taken as dimensionless)
_SYMBOLS: dict[str, dict[str, int]] = {
    "1": {}, "rad": {}, "radian": {}, "deg": {}, "degree": {}, "rev": {}, "sr": {}, "%": {},
    "kg": {"kg": 1},
    "m": {"m": 1}, "mm": {"m": 1}, "cm": {"m": 1}, "km": {"m": 1}, "um": {"m": 1},
    "s": {"s": 1}, "ms": {"s": 1}, "min": {"s": 1}, "h": {"s": 1},
    "A": {"A": 1}, "mA": {"A": 1}, "K": {"K": 1}, "degC": {"K": 1},
    "mol": {"mol": 1}, "cd": {"cd": 1}, "Hz": {"s": -1}, "rpm": {"s": -1},
    "N": {"kg": 1, "m": 1, "s": -2}, "kN": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2}, "bar": {"kg": 1, "m": -1, "s": -2}, "kPa": {"kg": 1, "m": -1, "s": -2},
    "MPa": {"kg": 1, "m": -1, "s": -2}, "mbar": {"kg": 1, "m": -1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2}, "kJ": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3}, "kW": {"kg": 1, "m": 2, "s": -3},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "Ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2}, "Wb": {"kg": 1, "m": 2, "s": -2, "A": -1},
    "T": {"kg": 1, "s": -2, "A": -1},
}  # fmt: skip
_TOLERANCE = 0.01  # of a factor or an offset: rounded ones are right, wrong ones are off by more
_SECOND = EXPONENTS.index("s")
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


@dataclass(frozen=True)
class Conversion:
    """``value = factor * given + offset``, or ``factor / given`` where it is an inverse one."""

    factor: float
    offset: float = 0.0
    inverse: bool = False

    def __str__(self) -> str:
        offset = f" and offset {self.offset:.6g}" if self.offset else ""
        return f"factor {self.factor:.6g}{offset}{' and inverse' if self.inverse else ''}"

    def is_close(self, other: "Conversion") -> bool:
        """Whether both mean the same; roundings do not count."""
        if self.inverse != other.inverse or abs(self.factor - other.factor) > _TOLERANCE * abs(other.factor):
            return False
        return abs(self.offset - other.offset) <= _TOLERANCE * abs(other.offset) + 1e-9

    def turned_round(self) -> "Conversion":
        """The one in the other direction."""
        return self if self.inverse else Conversion(1.0 / self.factor, -self.offset / self.factor)


def known_unit(name: str) -> KnownUnit | None:
    """What a name means beyond doubt; ``min`` is a minute, but ``g`` may be a mass or an acceleration."""
    return None if dimension_of(name) is None else parse_unit(name)


def lacks_angle(name: str, rad: int) -> bool:
    """Whether an angle, or a rate of one, is declared without an exponent of rad.

    Stiffness and damping per rad are often written without it, and revolutions are counted by some.
    """
    known = known_unit(name)
    if known is None or rad or not name.startswith(("rad", "deg")):
        return False
    *others, angle, counts = known.dimension
    return angle == 1 and not counts and not any(e for place, e in enumerate(others) if place != _SECOND)


def base_conversion(name: str, exponents: dict[str, int]) -> Conversion | None:
    """From a unit to the SI base units, by its name; None where that is not certain, or the exponents are others."""
    known = known_unit(name)
    if known is None or _exponents(known) != exponents or not any(known.dimension):
        return None
    return Conversion(known.factor, known.offset)


def display_conversion(name: str, shown: str) -> Conversion | None:
    """From a unit to the one that is shown, by their names; None where that is not certain."""
    unit, display = known_unit(name), known_unit(shown)
    if unit is None or display is None:
        return None
    if unit.dimension == display.dimension:
        return Conversion(unit.factor / display.factor, (unit.offset - display.offset) / display.factor)
    if unit.dimension == tuple(-e for e in display.dimension):
        return Conversion(1.0 / (unit.factor * display.factor), 0.0, True)
    return None


def _exponents(unit: KnownUnit) -> dict[str, int]:
    return dict(zip(EXPONENTS, unit.dimension, strict=False))
