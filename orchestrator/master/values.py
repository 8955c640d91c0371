"""Values of variables: what fits where, and what to say of what does not."""

import difflib
import math

from orchestrator.master.protocol import Value, Variable
from orchestrator.shared.numbers import exact_text

_INT32 = -(2**31), 2**31 - 1
"""Whole numbers that every type of them can hold, save for those that a variable's limits say are longer."""

BOOLEANS: dict[Value, bool] = {"true": True, "false": False, True: True, False: False}
"""Booleans as tables and command lines write them: as words, and as 1 and 0, which are equal to the last two."""


def nearest(name: str, known: list[str]) -> str:
    """Return a hint such as ``; did you mean 'theta_m'?``, or nothing when no name is near."""
    close = difflib.get_close_matches(name, known, n=1)
    return f"; did you mean {close[0]!r}?" if close else ""


def types_fit(source: Variable, target: Variable) -> bool:
    """Return whether a value of ``source`` is one of ``target``: the same type, or an Integer into a Real."""
    if source.type == "Enumeration" and target.type == "Enumeration":
        return not source.items or not target.items or source.items == target.items
    return source.type == target.type or (source.type == "Integer" and target.type == "Real")


def coerce_value(variable: Variable, value: Value) -> tuple[Value | None, str | None]:
    """Return ``value`` as ``variable`` takes it, or ``None`` and what is wrong with it."""
    kind = variable.type
    if kind == "String":
        return (value, None) if isinstance(value, str) else (None, f"must be a string, but is {value!r}")
    if kind == "Boolean":
        known = BOOLEANS.get(value)
        return (known, None) if known is not None else (None, f"must be true or false, but is {value!r}")
    if kind == "Enumeration" and isinstance(value, str):
        literals = dict(variable.items)
        if value not in literals:
            return None, f"must be one of {', '.join(literals)}, but is {value!r}{nearest(value, list(literals))}"
        return literals[value], None
    low, high = variable.minimum, variable.maximum
    widest = (low is None or low >= _INT32[0]) and (high is None or high <= _INT32[1])
    if not _is_number(value, whole=kind != "Real") or (kind != "Real" and widest and not _fits(value)):
        need = "a finite number" if kind == "Real" else "an integer of 32 bits" if widest else "a whole number"
        return None, f"must be {need}, but is {_short(value)}"
    assert not isinstance(value, str)
    if (low is not None and value < low) or (high is not None and value > high):
        bounds = [None if bound is None else exact_text(bound) for bound in (low, high)]
        text = (
            f"must be at least {bounds[0]}"
            if high is None
            else f"must be at most {bounds[1]}"
            if low is None
            else f"must lie in [{bounds[0]}, {bounds[1]}]"
        )
        return None, f"{text}, but is {value!r}"
    if kind == "Enumeration" and variable.items and value not in dict(variable.items).values():
        numbers = ", ".join(f"{number} ({name})" for name, number in variable.items)
        return None, f"must be one of {numbers}, but is {value!r}"
    return (float(value) if kind == "Real" else int(value)), None


def _is_number(value: Value, whole: bool) -> bool:
    if isinstance(value, (bool, str)):
        return False
    if isinstance(value, int):
        return abs(value) <= 2**1000
    return math.isfinite(value) and (not whole or value.is_integer())


def _fits(value: Value) -> bool:
    """Whether a number is within 32 bits."""
    return not isinstance(value, str) and _INT32[0] <= value <= _INT32[1]


def _short(value: Value) -> str:
    text = repr(value) if not isinstance(value, int) or abs(value) < 2**1000 else "an integer of hundreds of digits"
    return text if len(text) <= 80 else f"{text[:77]}..."
