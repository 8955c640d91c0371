"""What names of units mean beyond doubt, so that the exponents, factors and offsets of a description can be checked."""

import re
from dataclasses import dataclass

from orchestrator.shared.units import ATOMS, BASES, EXPONENTS, KnownUnit, parse_unit

_TOLERANCE = 0.01  # of a factor or an offset: rounded ones are right, wrong ones are off by more
_DOUBTFUL = frozenset(("F", "g", "in", "nm", "t", "U"))  # names that may mean two things
_WORDS = re.compile(r"[A-Za-z_]+")


def known_unit(name: str) -> KnownUnit | None:
    """What a name such as ``N.m.s/rad`` means; None when that is not certain."""
    certain = all(word in ATOMS and word not in _DOUBTFUL for word in _WORDS.findall(name))
    unit = parse_unit(name) if certain else None
    return None if unit is None or unit.dimension[BASES.index("count")] else unit


def dimension_of(name: str) -> dict[str, int] | None:
    """Exponents of SI base units by name, angles left out; None when it is not understood."""
    unit = known_unit(name)
    return None if unit is None else dict(zip(EXPONENTS[:-1], unit.dimension, strict=False))


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

    def reverse(self) -> "Conversion":
        return self if self.inverse else Conversion(1.0 / self.factor, -self.offset / self.factor)


def lacks_angle(name: str, rad: int) -> bool:
    """Whether an angle, or a rate of one, is declared without an exponent of rad.

    Stiffness and damping per rad are often written without it, and revolutions are counted by some.
    """
    known = known_unit(name)
    if known is None or rad or not name.startswith(("rad", "deg")):
        return False
    exponents = dict(zip(EXPONENTS, known.dimension, strict=False))
    return exponents.pop("rad") == 1 and not any(e for base, e in exponents.items() if base != "s")


def base_conversion(name: str, exponents: dict[str, int]) -> Conversion | None:
    """From a unit to the SI base units, by its name; None where that is not certain, or the exponents are others."""
    known = known_unit(name)
    if known is None or known.dimension[:-1] != tuple(exponents.values()) or not any(known.dimension):
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
