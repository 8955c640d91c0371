"""Whether two units measure the same quantity, and the conversion between them."""

from collections.abc import Mapping
from dataclasses import replace

from orchestrator.master.protocol import Unit, Variable
from orchestrator.shared.units import EXPONENTS, parse_unit


def resolve(name: str, declared: Mapping[str, Unit]) -> Unit:
    """Return the unit called ``name``: as declared, else a well-known one, else a mere name."""
    unit = declared.get(name)
    if unit is None or unit.exponents is None:
        return _well_known(name)
    return unit


def unit_of(variable: Variable, declared: Mapping[str, Unit]) -> Unit | None:
    """Return the unit of a variable, if it has one: of a difference where the variable is one."""
    return None if variable.unit is None else replace(resolve(variable.unit, declared), difference=variable.relative)


def _well_known(name: str) -> Unit:
    """Return a unit of the list of spellings; counts, which FMI does not know, and others are mere names."""
    known = parse_unit(name)
    if known is None or known.dimension[-1]:
        return Unit(name)
    return Unit(name, known.dimension[:-1], known.factor, known.offset)


def conversion(source: Unit | None, target: Unit | None) -> tuple[float, float] | None:
    """Return ``(factor, offset)`` with ``target value = factor * source value + offset``.

    A side without a unit takes the other's, and one that does not say whether it is a difference is what the other is.
    ``None`` is returned when the two do not measure the same quantity; nor do a difference and what is none, unless
    that changes no number.
    """
    if source is None or target is None or source.name == target.name:
        return _same_name(source, target)
    if source.exponents is None or target.exponents is None or source.exponents != target.exponents:
        return None
    return _ratio(source, target)


def describe_mismatch(source: Unit, target: Unit, origin: str = "") -> str:
    """Return what a target must have whose unit has no conversion from that of a source, which is ``origin``'s."""
    if source.exponents is not None and source.exponents == target.exponents:
        words = {True: "is a difference (relativeQuantity)", False: "is none"}
        both = f"{source.name} {words[bool(source.difference)]} and {target.name} {words[bool(target.difference)]}"
        return f"must be a difference like what feeds it, or neither, but {both}: correct relativeQuantity of one FMU"
    why = contradiction(source) or contradiction(target)
    return f"must have a unit that measures what {source.name}{origin} does, but has {target.name}{why}"


def contradiction(unit: Unit) -> str:
    """Return how the description of a unit contradicts its name, for the end of a message; or nothing."""
    known = _well_known(unit.name)
    if unit.exponents is None or known.exponents is None or unit.exponents == known.exponents:
        return ""
    pairs = zip(EXPONENTS, unit.exponents, known.exponents, strict=True)
    stated, right = zip(*((f"{name}={e}", f"{name}={k}") for name, e, k in pairs if e != k), strict=True)
    what = f"the FMU's BaseUnit of `{unit.name}` has {' '.join(stated)}"
    return f"; {what}, where its name means {' '.join(right)}: correct that in its modelDescription.xml"


def _same_name(source: Unit | None, target: Unit | None) -> tuple[float, float] | None:
    if source is None or target is None or source.exponents is None or target.exponents is None:
        return 1.0, 0.0
    return _ratio(source, target) if source.exponents == target.exponents else None


def _ratio(source: Unit, target: Unit) -> tuple[float, float] | None:
    factor, offset = source.factor / target.factor, (source.offset - target.offset) / target.factor
    kinds = {source.difference, target.difference}
    if True in kinds and offset != 0.0:
        return None if False in kinds else (factor, 0.0)
    return factor, offset
