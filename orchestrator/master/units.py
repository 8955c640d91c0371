"""Whether two units measure the same quantity, and the conversion between them."""

import math
from collections.abc import Mapping

from orchestrator.master.protocol import Unit

_NONE = (0, 0, 0, 0, 0, 0, 0, 0)
_ANGLE = (0, 0, 0, 0, 0, 0, 0, 1)
_SPEED = (0, 0, -1, 0, 0, 0, 0, 1)
_TORQUE = (1, 2, -2, 0, 0, 0, 0, 0)
_TIME = (0, 0, 1, 0, 0, 0, 0, 0)
_INERTIA = (1, 2, 0, 0, 0, 0, 0, 0)

KNOWN = {
    unit.name: unit
    for unit in (
        Unit("1", _NONE),
        Unit("%", _NONE, 0.01),
        Unit("rad", _ANGLE),
        Unit("mrad", _ANGLE, 1e-3),
        Unit("deg", _ANGLE, math.pi / 180.0),
        Unit("rad/s", _SPEED),
        Unit("deg/s", _SPEED, math.pi / 180.0),
        Unit("rpm", _SPEED, math.pi / 30.0),
        Unit("N.m", _TORQUE),
        Unit("mN.m", _TORQUE, 1e-3),
        Unit("kN.m", _TORQUE, 1e3),
        Unit("kg.m2", _INERTIA),
        Unit("g.cm2", _INERTIA, 1e-7),
        Unit("s", _TIME),
        Unit("ms", _TIME, 1e-3),
    )
}


def resolve(name: str, declared: Mapping[str, Unit]) -> Unit:
    """Return the unit called ``name``: as declared, else a well-known one, else a mere name.

    Args:
        name: as the model writes it.
        declared: units of the model by name.

    Returns:
        The unit.
    """
    unit = declared.get(name)
    if unit is None or unit.exponents is None:
        return KNOWN.get(name, Unit(name))
    return unit


def conversion(source: Unit | None, target: Unit | None) -> tuple[float, float] | None:
    """Return ``(factor, offset)`` with ``target value = factor * source value + offset``.

    A side without a unit takes the other's. ``None`` is returned when the two do not measure the same quantity.

    Args:
        source: unit of what is sent; None: none is declared.
        target: unit of what is received; None: none is declared.

    Returns:
        Factor and offset, or None.
    """
    if source is None or target is None or source.name == target.name:
        return _same_name(source, target)
    if source.exponents is None or target.exponents is None or source.exponents != target.exponents:
        return None
    return _ratio(source, target)


def _same_name(source: Unit | None, target: Unit | None) -> tuple[float, float] | None:
    if source is None or target is None or source.exponents is None or target.exponents is None:
        return 1.0, 0.0
    return _ratio(source, target) if source.exponents == target.exponents else None


def _ratio(source: Unit, target: Unit) -> tuple[float, float]:
    return source.factor / target.factor, (source.offset - target.offset) / target.factor
