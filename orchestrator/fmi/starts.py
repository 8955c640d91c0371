"""Numbers and start values as model descriptions write them."""

import math

from orchestrator.master.protocol import Value


def number(text: str | None) -> float | None:
    """Return the number that a text is."""
    return None if text is None else float(text)


def start_value(kind: str, text: str | None, name: str) -> Value | None:
    """Return a start value."""
    if text is None or kind == "String":
        return text
    if kind == "Boolean":
        return text in {"true", "1"}
    value = float(text) if kind == "Real" else int(text)
    if not math.isfinite(value):
        raise ValueError(f"the start value of {name!r} is {text}")
    return value
