"""Angles in sentences, marked so that the page's switch of units reaches them."""

import re

from markupsafe import Markup, escape

from orchestrator.reporting.model import Cell

_NUMBER = r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?"
_RANGE = rf"{_NUMBER}(?: (?:to|and|or|±) {_NUMBER})*"
# Amounts and their unit; an interval in brackets behind it has the same unit.
ANGULAR = re.compile(rf"(?<![\w.]){_RANGE} (?P<unit>rad(?:/s2?)?)(?![\w/*^]|\.\w)(?: \((?:95 %: )?{_RANGE}\))?")
BRACKETED = re.compile(r"(?P<name>.*)\[(?P<unit>rad(?:/s2?)?)\]$", re.S)


_MARKED = Markup('<span data-unit="{}">{}</span>')


def mark_angles(text: str) -> Markup:
    """Return text as HTML in which ``0.02 rad`` or ``0.01 to 0.02 rad/s`` is an element with its unit."""
    parts, end = [], 0
    for found in ANGULAR.finditer(text):
        parts += [escape(text[end : found.start()]), _MARKED.format(found["unit"], found[0])]
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
