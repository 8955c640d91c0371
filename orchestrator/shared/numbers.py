"""Numbers as text, to be copied and to be read, and arguments within their bounds."""

import math

from orchestrator.errors import ScenarioError

MISSING = "–"


def exact_text(value: float) -> str:
    """Return a number with all its digits, as TOML and the command line read it."""
    return str(int(value)) if float(value).is_integer() and abs(value) < 1e15 else repr(float(value))


def cell_text(value: float | int | str | bool | None, digits: int = 6) -> str:
    """Return a cell's text: numbers to ``digits`` significant digits, a dash for what is missing."""
    if value is None:
        return MISSING
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return _float(value, digits)
    return str(value)


def _float(value: float, digits: int) -> str:
    if not math.isfinite(value):
        return MISSING
    if value == 0.0:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if -4 <= size < max(digits, 6):
        text = f"{value:.{max(0, digits - 1 - size)}f}"
        return text.rstrip("0").rstrip(".") if "." in text else text
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa.rstrip('0').rstrip('.') if '.' in mantissa else mantissa}e{int(exponent)}"


def not_negative(name: str, value: float) -> float:
    """Return ``value``, a number that must be finite and not negative."""
    if not (math.isfinite(value) and value >= 0.0):
        raise ScenarioError(f"`{name}` must be finite and not negative, but is {value}", name)
    return value


def within(name: str, value: float, least: float, most: float) -> float:
    """Return ``value``, a number that must lie between two bounds."""
    if not least <= value <= most:
        raise ScenarioError(
            f"`{name}` must be between {exact_text(least)} and {exact_text(most)}, but is {value:g}", name
        )
    return value
