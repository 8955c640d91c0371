"""What names of units mean beyond doubt, so that the exponents, factors and offsets of a description can be checked."""

import math
import re
from dataclasses import dataclass

from orchestrator.shared.units import EXPONENTS

# Unit: factor to the base units, exponents of these. Names that may mean two things (`g`, `t`, `U`) are not among them.
_TABLE = """
1 1 | rad 1 rad | radian 1 rad | deg DEG rad | degree DEG rad | rev REV rad | sr 1 | % 0.01
kg 1 kg | m 1 m | mm 1e-3 m | cm 1e-2 m | km 1e3 m | um 1e-6 m
s 1 s | ms 1e-3 s | min 60 s | h 3600 s | A 1 A | mA 1e-3 A | K 1 K | degC 1 K | mol 1 mol | cd 1 cd
Hz 1 s-1 | rpm RPM rad s-1 | N 1 kg m s-2 | kN 1e3 kg m s-2 | J 1 kg m2 s-2 | kJ 1e3 kg m2 s-2
Pa 1 kg m-1 s-2 | kPa 1e3 kg m-1 s-2 | MPa 1e6 kg m-1 s-2 | mbar 100 kg m-1 s-2 | bar 1e5 kg m-1 s-2
W 1 kg m2 s-3 | kW 1e3 kg m2 s-3 | V 1 kg m2 s-3 A-1 | Ohm 1 kg m2 s-3 A-2
H 1 kg m2 s-2 A-2 | Wb 1 kg m2 s-2 A-1 | T 1 kg s-2 A-1
"""
_ANGLES = {"DEG": math.pi / 180.0, "REV": 2.0 * math.pi, "RPM": math.pi / 30.0}
_OFFSETS = {"degC": 273.15}
_TOLERANCE = 0.01  # of a factor or an offset: rounded ones are right, wrong ones are off by more
_MOST_POWER = 9
_FACTOR = re.compile(r"([A-Za-z%]+|1)\^?(-?[0-9]+)?")
_POWER = re.compile(r"([A-Za-z]+)(-?\d*)")


@dataclass(frozen=True)
class UnitMeaning:
    """``value in base units = factor * value + offset``; the exponents are those of ``EXPONENTS``."""

    exponents: tuple[int, ...]
    factor: float
    offset: float = 0.0


def _read_table() -> dict[str, UnitMeaning]:
    units = {}
    for entry in _TABLE.replace("\n", "|").split("|"):
        if entry.strip():
            name, factor, *powers = entry.split()
            pairs = [_POWER.fullmatch(power) for power in powers]
            found = {pair[1]: int(pair[2] or 1) for pair in pairs if pair}
            value = _ANGLES[factor] if factor in _ANGLES else float(factor)
            units[name] = UnitMeaning(tuple(found.get(e, 0) for e in EXPONENTS), value, _OFFSETS.get(name, 0.0))
    return units


_UNITS = _read_table()


def known_unit(name: str) -> UnitMeaning | None:
    """What a name such as ``N.m.s/rad`` means; None when that is not certain."""
    if name in _UNITS:
        return _UNITS[name]
    exponents, factor, sign = [0] * len(EXPONENTS), 1.0, 1
    for part in re.split(r"([/.*])", name.replace(" ", "").replace("(", "").replace(")", "") if _simple(name) else "?"):
        if part in (".", "*"):
            continue
        if part == "/":
            sign = -1
            continue
        match = _FACTOR.fullmatch(part)
        if match is None or match[1] not in _UNITS:
            return None
        power, unit = sign * int(match[2] or 1), _UNITS[match[1]]
        if abs(power) > _MOST_POWER:
            return None
        factor *= unit.factor**power
        exponents = [total + power * e for total, e in zip(exponents, unit.exponents, strict=True)]
    return UnitMeaning(tuple(exponents), factor)


def dimension_of(name: str) -> dict[str, int] | None:
    """Exponents of SI base units by name, zeros may lack, angles left out; None when it is not understood."""
    unit = known_unit(name)
    return None if unit is None else dict(zip(EXPONENTS[:-1], unit.exponents, strict=False))


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

    def reverse(self) -> "Conversion":
        return self if self.inverse else Conversion(1.0 / self.factor, -self.offset / self.factor)


def lacks_angle(name: str, rad: int) -> bool:
    """Whether an angle, or a rate of one, is declared without an exponent of rad.

    Stiffness and damping per rad are often written without it, and revolutions are counted by some.
    """
    known = known_unit(name)
    if known is None or rad or not name.startswith(("rad", "deg")):
        return False
    exponents = dict(zip(EXPONENTS, known.exponents, strict=True))
    return exponents.pop("rad") == 1 and not any(e for base, e in exponents.items() if base != "s")


def base_conversion(name: str, exponents: dict[str, int]) -> Conversion | None:
    """From a unit to the SI base units, by its name; None where that is not certain, or the exponents are others."""
    known = known_unit(name)
    if known is None or known.exponents != tuple(exponents.values()) or not any(known.exponents):
        return None
    return Conversion(known.factor, known.offset)


def display_conversion(name: str, shown: str) -> Conversion | None:
    """From a unit to the one that is shown, by their names; None where that is not certain."""
    unit, display = known_unit(name), known_unit(shown)
    if unit is None or display is None:
        return None
    if unit.exponents == display.exponents:
        return Conversion(unit.factor / display.factor, (unit.offset - display.offset) / display.factor)
    if unit.exponents == tuple(-e for e in display.exponents):
        return Conversion(1.0 / (unit.factor * display.factor), 0.0, True)
    return None
