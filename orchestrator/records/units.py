"""Units of the field: what a unit's text means, and its factor to SI.

Common spellings of logs are known by themselves; the rest is left to ``pint``. Angles, shares and counts have no
dimension, so their names decide.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

TURN = 2.0 * math.pi


@dataclass(frozen=True)
class RecordUnit:
    """What a unit measures (a key of ``SI``) and its factor to SI.

    Percent and counts have no factor of their own: 100 % and one revolution must be stated.
    """

    kind: str
    factor: float


SI = {
    "time": "s",
    "angle": "rad",
    "length": "m",
    "torque": "N.m",
    "force": "N",
    "speed": "rad/s",
    "velocity": "m/s",
    "current": "A",
    "voltage": "V",
    "share": "%",
    "counts": "counts",
}
_KNOWN = {
    "time": {"s": 1.0, "sec": 1.0, "seconds": 1.0, "sek": 1.0, "ms": 1e-3, "msec": 1e-3, "us": 1e-6, "µs": 1e-6},
    "angle": {
        "rad": 1.0, "radian": 1.0, "radians": 1.0, "mrad": 1e-3, "deg": TURN / 360.0, "degree": TURN / 360.0,
        "degrees": TURN / 360.0, "°": TURN / 360.0, "grad": TURN / 360.0, "gon": TURN / 400.0, "rev": TURN,
        "revs": TURN, "turn": TURN, "turns": TURN, "umdr": TURN, "u": TURN, "arcmin": TURN / 21600.0,
        "arcsec": TURN / 1296000.0,
    },
    "length": {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "cm": 1e-2},
    "torque": {"N.m": 1.0, "Nm": 1.0, "mNm": 1e-3, "mN.m": 1e-3, "cNm": 1e-2, "kNm": 1e3, "kN.m": 1e3},
    "force": {"N": 1.0, "kN": 1e3},
    "speed": {
        "rad/s": 1.0, "deg/s": TURN / 360.0, "°/s": TURN / 360.0, "rpm": TURN / 60.0, "1/min": TURN / 60.0,
        "min-1": TURN / 60.0, "min^-1": TURN / 60.0, "U/min": TURN / 60.0, "r/min": TURN / 60.0,
        "rev/min": TURN / 60.0, "rev/s": TURN, "rps": TURN, "mrad/s": 1e-3,
    },
    "velocity": {"m/s": 1.0, "mm/s": 1e-3},
    "current": {"A": 1.0, "mA": 1e-3, "Arms": 1.0, "A_rms": 1.0},
    "voltage": {"V": 1.0, "mV": 1e-3},
    "share": {"%": 1.0, "percent": 1.0, "pct": 1.0, "‰": 0.1},
    "counts": dict.fromkeys(
        ("counts", "count", "cts", "cnt", "inc", "incr", "increments", "inkr", "ticks", "pulses", "lsb"), 1.0
    ),
}  # fmt: skip
_EXACT = {text: RecordUnit(kind, factor) for kind, entries in _KNOWN.items() for text, factor in entries.items()}
# Spellings whose capitals tell nothing; where two kinds differ only by capitals, none.
_FOLDED: dict[str, RecordUnit | None] = {}
for _text, _unit in _EXACT.items():
    _folded = _text.lower()
    _FOLDED[_folded] = _unit if _FOLDED.get(_folded, _unit) == _unit else None
_DIMENSIONS = {
    "second": "time",
    "meter": "length",
    "newton * meter": "torque",
    "newton": "force",
    "meter / second": "velocity",
    "ampere": "current",
    "volt": "voltage",
}
_LONGEST = 24  # characters of a unit that pint is asked for: it evaluates expressions


@lru_cache(maxsize=256)
def parse_unit(text: str) -> RecordUnit | None:
    """Return what ``text`` means, or None where it is no unit that a record needs.

    Args:
        text: as a file or a person writes it.

    Returns:
        Quantity and factor to SI.
    """
    plain = text.strip().strip("[](){}<>").strip().replace("⋅", ".").replace("·", ".").replace("*", ".")
    if not plain or len(plain) > _LONGEST:
        return None
    plain = plain.replace("N m", "N.m").replace("N-m", "N.m").replace("º", "°").replace("μ", "µ")
    if plain in _EXACT:
        return _EXACT[plain]
    if plain.lower() in _FOLDED:
        return _FOLDED[plain.lower()]
    return _by_pint(plain.replace(".", "*"))


def _by_pint(text: str) -> RecordUnit | None:
    """Return a unit by its dimension; angular ones are told by the radians in them."""
    if any(not (c.isalnum() or c in "/*^ _µ°") for c in text) or "**" in text or text[0].isdigit():
        return None
    import pint

    registry = _registry()
    try:
        quantity = registry.Quantity(1.0, registry.parse_units(text))
        if quantity.units == registry.dimensionless:
            return None
        for si, kind in _DIMENSIONS.items():
            if quantity.check(registry.parse_units(si).dimensionality) and "radian" not in str(
                quantity.to_root_units()
            ):
                return RecordUnit(kind, float(quantity.to(si).magnitude))
        root = quantity.to_root_units()
    except (pint.PintError, ValueError, TypeError, AttributeError, OverflowError, RecursionError, AssertionError):
        return None
    angular = {"radian": "angle", "radian / second": "speed"}.get(str(root.units))
    return None if angular is None else RecordUnit(angular, float(root.magnitude))


@lru_cache(maxsize=1)
def _registry():  # type: ignore[no-untyped-def]
    import pint

    return pint.UnitRegistry()
