"""Whether two units measure the same quantity, and the conversion between them."""

from collections.abc import Mapping

from orchestrator.master.protocol import Unit
from orchestrator.shared.units import parse_unit


def resolve(name: str, declared: Mapping[str, Unit]) -> Unit:
    """Return the unit called ``name``: as declared, else a well-known one, else a mere name."""
    unit = declared.get(name)
    if unit is None or unit.exponents is None:
        return _well_known(name)
    return unit


def _well_known(name: str) -> Unit:
    """Return a unit of the list of spellings; counts, which FMI does not know, and others are mere names."""
    known = parse_unit(name)
    if known is None or known.dimension[-1]:
        return Unit(name)
    return Unit(name, known.dimension[:-1], known.factor, known.offset)


def conversion(source: Unit | None, target: Unit | None) -> tuple[float, float] | None:
    """Return ``(factor, offset)`` with ``target value = factor * source value + offset``.

    A side without a unit takes the other's. ``None`` is returned when the two do not measure the same quantity.
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
