"""Where a driven run leads: values of variables that are not those of the file, within their limits.

They are chosen from min, max, nominal and start alone, and are the same in every run.
"""

import math
import random
import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from orchestrator.checking.probing.variables import ProbedVariable

_SHARE = 0.1  # of the size of a start value: enough to be seen, too little to leave what a model is made for
_WIDTH = 0.1  # of the range between min and max, at most
_FAR = 100.0  # times a start value, or its size, is where limits act that it never reaches
_BITS = {f"{sign}Int{bits}": (sign, bits) for sign in ("", "U") for bits in (8, 16, 32, 64)}
_PATHS = ("/", "\\", ".", ":")  # a text with one of these may be the path of a file, or an address
Values = tuple[Any, ...]


@dataclass(frozen=True)
class Movement:
    """What a driven run changes."""

    # of parameters and start values, which are set before the run
    values: Mapping[ProbedVariable, Values] = field(default_factory=dict)
    inputs: tuple[ProbedVariable, ...] = ()  # that move in the run
    share: float = 1.0  # of their usual size by which continuous inputs move

    def of_type(self, base: str, inputs: bool) -> list[ProbedVariable]:
        """The variables of a type that are set, inputs or all others."""
        return [v for v in self.values if v.base == base and (v.causality == "input") == inputs]


def distinct(variables: Iterable[ProbedVariable]) -> list[ProbedVariable]:
    """Variables without those that are aliases of one before."""
    return list({v.key: v for v in reversed(list(variables))}.values())[::-1]


def settable(v: ProbedVariable) -> bool:
    """Whether the standard allows to set a value before or in initialisation mode."""
    if v.start is None or v.variability == "constant" or v.clocks or v.causality == "structuralParameter":
        return False
    return v.initial == "exact" or v.causality == "input"


def moved(v: ProbedVariable, base: Sequence[Any], which: int = 0) -> Values | None:
    """Other values than ``base`` within the limits, number ``which`` of several on both sides; None: there are none."""
    found = tuple(_other(v, value, which, i) for i, value in enumerate(base))
    return None if not found or any(value is None for value in found) else found


def _other(v: ProbedVariable, value: Any, which: int, element: int) -> Any:
    if v.base == "Boolean":
        return int(not value)
    if v.base == "String":
        return None if any(part in value.decode("utf-8", "replace") for part in _PATHS) else value + b"_%d" % which
    if v.base == "Binary":
        return _bytes(v, value, which)
    if v.base == "Clock":
        return None
    if v.items:
        others = [item for item in v.items if item != value]
        return others[which % len(others)] if others else None
    if v.base in _BITS or v.base == "Integer":
        return _whole(v, int(value), which)
    return _number(v, float(value), which, element)


def _bytes(v: ProbedVariable, value: bytes, which: int) -> bytes | None:
    """A byte more, behind a zero where there is room; or another last one; none where a type says what bytes mean."""
    if v.has_format:
        return None
    if v.most_bytes is None or len(value) + 1 < v.most_bytes:
        return value + bytes([0, 1 + which])
    if v.most_bytes is None or len(value) < v.most_bytes:
        return value + bytes([1 + which])
    return value[:-1] + bytes([value[-1] ^ (1 + which)]) if value else None


def _whole(v: ProbedVariable, value: int, which: int) -> int | None:
    sign, bits = _BITS.get(v.base, ("", 32))
    least, most = (0, (1 << bits) - 1) if sign == "U" else (-(1 << (bits - 1)), (1 << (bits - 1)) - 1)
    low, high = v.limits
    near = (value + 1, value - 1, value + 2, value - 2)
    fit = [x for x in near if max(low, least) <= x <= min(high, most)]
    if v.minimum is None and value >= 0:
        fit = [x for x in fit if x >= 0]  # many count something without saying so
    return fit[which % len(fit)] if fit else None


def _number(v: ProbedVariable, value: float, which: int, element: int) -> float | None:
    if not math.isfinite(value):
        return None
    low, high = v.limits
    width = high - low
    size = scale_of(v, value)
    shares = random.Random(f"{v.name} {element}")
    step = (1 if which % 2 == 0 else -1) * size * (0.7 + 0.6 * shares.random()) / (1 + which // 2)
    if math.isfinite(width):
        step = math.copysign(min(abs(step), _WIDTH * width), step)
    found = next((x for x in (value + step, value - step) if low <= x <= high and x != value), None)
    if found is not None and v.minimum is None and value > 0.0 >= found:
        return None
    if found is not None and v.base == "Float32":
        found = struct.unpack("f", struct.pack("f", found))[0]
    return found


def distant(v: ProbedVariable) -> list[Values]:
    """Values far below and far above those of the file, within the limits of a floating point variable."""
    starts = tuple(v.start or ())
    if not v.real or not starts or not all(map(math.isfinite, starts)):
        return []
    low, high = v.limits
    sizes = [max(abs(x), 10.0 * scale_of(v, x)) for x in starts]
    below = tuple(x / _FAR if x else -_FAR * size for x, size in zip(starts, sizes, strict=True))
    above = tuple(x + _FAR * size for x, size in zip(starts, sizes, strict=True))
    return [tuple(min(max(x, low), high) for x in values) for values in (below, above)]


def scale_of(v: ProbedVariable, value: float) -> float:
    """The size of a change: a tenth of a value, or of what the description says of its size."""
    low, high = v.limits
    if v.nominal:
        return _SHARE * abs(v.nominal)
    if value:
        return _SHARE * abs(value)
    return _SHARE * (min(high - low, 10.0) if math.isfinite(high - low) and high > low else 1.0)
