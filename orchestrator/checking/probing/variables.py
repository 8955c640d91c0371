"""The variables of an FMU as probes see them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any


@dataclass(frozen=True)
class ProbedVariable:
    """A variable as the model description has it.

    Attributes:
        base: suffix of the functions that access it, such as "Real" or "Int32".
        size: number of its values at the initial dimensions.
        start: its values at the start, None when the description has none.
        clocks: value references of its clocks; it is accessed while one of them ticks.
        intermediate: whether it can be accessed in intermediate updates.
        extents: its dimensions: a size, or minus one less the value reference of the parameter that has it.
    """

    name: str
    reference: int
    base: str
    causality: str
    variability: str
    initial: str | None
    start: tuple[Any, ...] | None
    minimum: float | None
    maximum: float | None
    nominal: float | None
    size: int = 1
    clocks: tuple[int, ...] = ()
    intermediate: bool = False
    extents: tuple[int, ...] = ()

    def resize(self, sizes: Mapping[int, int]) -> "ProbedVariable":
        """The variable after structural parameters have changed."""
        lengths = (e if e >= 0 else sizes.get(-1 - e, 1) for e in self.extents)
        return replace(self, size=math.prod(lengths))

    @property
    def real(self) -> bool:
        """Whether its values are floating point numbers."""
        return self.base in ("Real", "Float32", "Float64")

    @property
    def numeric(self) -> bool:
        """Whether its values are numbers, Boolean ones left out."""
        return self.real or "Int" in self.base

    @property
    def labels(self) -> list[str]:
        """A name for each of its values."""
        return [self.name] if self.size == 1 else [f"{self.name}[{i}]" for i in range(self.size)]


def finite(value: Any) -> bool:
    """Whether a value is no NaN and no infinity."""
    return not isinstance(value, float) or math.isfinite(value)
