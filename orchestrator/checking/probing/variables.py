"""The variables of an FMU as probes see them, and their values: whether they are equal, and how they are shown."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

_LONGEST = 60
_EQUAL = 1e-9
_SINGLE = 1e-6


@dataclass(frozen=True)
class ProbedVariable:
    """A variable as the model description has it."""

    name: str
    reference: int
    base: str  # suffix of the functions that access it, such as "Real" or "Int32"
    causality: str
    variability: str
    initial: str | None
    start: tuple[Any, ...] | None  # its values at the start, None when the description has none
    minimum: float | None
    maximum: float | None
    nominal: float | None
    size: int = 1  # number of its values at the initial dimensions
    clocks: tuple[int, ...] = ()  # value references of its clocks; it is accessed while one of them ticks
    intermediate: bool = False  # whether it can be accessed in intermediate updates
    # its dimensions: a size, or minus one less the value reference of the parameter that has it
    extents: tuple[int, ...] = ()
    items: tuple[int, ...] = ()  # the values of an enumeration; empty for other types
    most_bytes: int | None = None  # of a binary, None where the description does not say
    has_format: bool = False  # whether a binary has a type that says what its bytes mean

    def resize(self, sizes: Mapping[int, int]) -> "ProbedVariable":
        """The variable after structural parameters have changed."""
        lengths = (e if e >= 0 else sizes.get(-1 - e, 1) for e in self.extents)
        return replace(self, size=math.prod(lengths))

    @property
    def real(self) -> bool:
        return self.base in ("Real", "Float32", "Float64")

    @property
    def limits(self) -> tuple[float, float]:
        """The smallest and the largest value that the description allows; infinite where it names none."""
        low, high = self.minimum, self.maximum
        least = -math.inf if low is None or math.isnan(low) else low
        return least, math.inf if high is None or math.isnan(high) else high

    @property
    def numeric(self) -> bool:
        """Whether its values are numbers, Boolean ones left out."""
        return self.real or "Int" in self.base

    @property
    def key(self) -> tuple[str, int]:
        """What aliases share: the type and the value reference."""
        return self.base, self.reference

    @property
    def labels(self) -> list[str]:
        return [self.name] if self.size == 1 else [f"{self.name}[{i}]" for i in range(self.size)]


def shown(value: Any) -> str:
    """A value as a reader of the description knows it."""
    if isinstance(value, bytes):
        text = value.decode("utf-8", "backslashreplace")
        return f'"{text[:_LONGEST]}"'
    if isinstance(value, bool):
        return "true" if value else "false"
    return "null" if value is None else f"{value:.9g}" if isinstance(value, float) else str(value)


def finite(value: Any) -> bool:
    """Whether a value is no NaN and no infinity."""
    return not isinstance(value, float) or math.isfinite(value)


def equal(v: ProbedVariable, a: Sequence[Any], b: Sequence[Any], tolerance: float = _EQUAL) -> bool:
    """Whether values of a variable are equal, numbers but for a relative tolerance."""
    if v.base == "Float32":
        tolerance = max(tolerance, _SINGLE)
    for x, y in zip(a, b, strict=True):
        if isinstance(x, float) and isinstance(y, float):
            if x == x and y == y and abs(x - y) > tolerance * max(abs(x), abs(y)):  # noqa: PLR0124 (NaN is none)
                return False
        elif x != y and x is not None:  # a text that is null is a finding already
            return False
    return True


def by_variable(variables: Sequence[ProbedVariable], row: Sequence[Any]) -> dict[ProbedVariable, tuple[Any, ...]]:
    """The values of a row, which stand one variable after the other."""
    found = {}
    at = 0
    for v in variables:
        found[v] = tuple(row[at : at + v.size])
        at += v.size
    return found


def values_text(values: Sequence[Any]) -> str:
    """The first few values of a variable, as a reader of the description knows them."""
    text = ", ".join(map(shown, values[:4]))
    return text if len(values) <= 4 else f"{text}, …"
