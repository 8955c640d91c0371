"""What a unit measures in a record; angles, shares and counts are kinds of their own."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from orchestrator.shared import units
from orchestrator.shared.units import dimension_of

TURN = 2.0 * math.pi
ANGLES = {"rad": 1.0, "deg": math.pi / 180.0, "arcmin": math.pi / 10800.0, "turns": TURN}
"""Units in which angles are shown [rad]."""


@dataclass(frozen=True)
class RecordUnit:
    """What a unit measures (a key of ``SI``; empty: what no column of a record is in) and its factor to SI.

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
_DIMENSIONS = {
    "time": dimension_of(second=1),
    "angle": dimension_of(radian=1),
    "length": dimension_of(meter=1),
    "torque": dimension_of(kilogram=1, meter=2, second=-2),
    "force": dimension_of(kilogram=1, meter=1, second=-2),
    "speed": dimension_of(radian=1, second=-1),
    "velocity": dimension_of(meter=1, second=-1),
    "current": dimension_of(ampere=1),
    "voltage": dimension_of(kilogram=1, meter=2, second=-3, ampere=-1),
    "share": dimension_of(),
    "counts": dimension_of(count=1),
}
_KINDS = {dimension: kind for kind, dimension in _DIMENSIONS.items()}


def parse_unit(text: str, kinds: Sequence[str] = ()) -> RecordUnit | None:
    """Return what ``text`` means, or None where it is no known unit.

    ``kinds``: keys of ``SI`` that are sought, for texts with two meanings (``nm``, ``1/min``).
    """
    unit = units.parse_unit(text, frozenset(_DIMENSIONS[kind] for kind in kinds))
    if unit is None:
        return None
    kind = _KINDS.get(unit.dimension, "")
    return RecordUnit(kind, 100.0 * unit.factor if kind == "share" else unit.factor)


def angle_unit(texts: Sequence[str]) -> str:
    """Return the unit of ``ANGLES`` that the first of some texts of units means which is an angle's; else rad."""
    angles = [unit for text in texts if text and (unit := parse_unit(text, ("angle",))) and unit.kind == "angle"]
    known = (name for name, factor in ANGLES.items() if angles and math.isclose(factor, angles[0].factor))
    return next(known, "rad")
