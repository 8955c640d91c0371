"""Sentences as HTML: angles marked so that the page's switch of units reaches them, and code."""

import math
import re

from markupsafe import Markup, escape

from orchestrator.shared.results.fields import Cell

_NUMBER = r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
_RANGE = rf"{_NUMBER}(?: (?:to|and|or|±|->|instead of) {_NUMBER})*"
# Amounts and their unit, and amounts in brackets behind it, of the same unit. What stands in a list before may have
# that unit or another: then all stays as it is.
_ANGULAR = (
    rf"(?P<list>(?<![\w.]){_NUMBER}, (?={_NUMBER}))?(?<![\w.]){_RANGE} (?P<unit>rad(?:/s2?)?)(?![\w/*^]|\.\w)"
    rf"(?: \((?:95 %: |noise |noise: )?{_RANGE}\))?"
)
_MARKS = re.compile(rf"`(?P<code>[^`\n]+)`|{_ANGULAR}")
_CODE = Markup("<code>{}</code>")
BRACKETED = re.compile(r"(?P<name>.*)\[(?P<unit>rad(?:/s2?)?)\]$", re.S)


_MARKED = Markup('<span data-unit="{}">{}</span>')


def interval_words(value: float | None, low: float | None, high: float | None) -> tuple[str, str, str]:
    """Return a value and the ends of its interval, down to the second digit of half the interval's width."""
    digits = 5
    if low is not None and high is not None and high > low:
        digits = 2 + math.ceil(math.log10(max(abs(low), abs(high)) / (0.5 * (high - low))))
    value_text, *ends = ("any size" if v is None else f"{v:.{min(max(digits, 2), 12)}g}" for v in (value, low, high))
    return value_text, ends[0], ends[1]


def mark_prose(text: str) -> Markup:
    """Return text as HTML: ``0.01 to 0.02 rad`` is an element with a unit, what is in backticks is code."""
    parts, end = [], 0
    for found in _MARKS.finditer(text):
        parts.append(escape(text[end : found.start()]))
        if found["code"]:
            parts.append(_CODE.format(found["code"]))
        else:
            parts.append(escape(found[0]) if found["list"] else _MARKED.format(found["unit"], found[0]))
        end = found.end()
    return Markup("").join([*parts, escape(text[end:])])


def mark_unit(label: str) -> Markup:
    """Return a label such as ``half-gap [rad]`` as HTML in which the unit follows the switch."""
    found = BRACKETED.match(label)
    if found is None:
        return escape(label)
    return escape(found["name"]) + Markup("[") + _MARKED.format(found["unit"], found["unit"]) + Markup("]")


def angle_attributes(value: Cell, label: str, digits: int = 6) -> Markup:
    """Return the attributes of an element that shows a number under a label that ends with an angle's unit."""
    found = BRACKETED.match(label)
    if found is None or isinstance(value, (str, bool)) or value is None:
        return Markup("")
    return Markup(' data-unit="{}" data-value="{}" data-digits="{}"').format(found["unit"], repr(float(value)), digits)
