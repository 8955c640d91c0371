"""Values by their variables: whether they are equal, and how they are shown."""

from collections.abc import Sequence
from typing import Any

from orchestrator.checking.probing.variables import ProbedVariable, shown

_EQUAL = 1e-9
_SINGLE = 1e-6


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
