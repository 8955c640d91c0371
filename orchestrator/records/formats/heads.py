"""Name and unit of a channel, where a file writes both as one: ``qm [deg]``, ``M / Nm``, ``speed_rpm``, ``posDeg``."""

import re
from collections.abc import Iterator

from orchestrator.records.formats.source import Head
from orchestrator.records.words import CURRENT, TIME, TORQUE, VOLTAGE, describes, words_of
from orchestrator.shared.units import is_unit

_SQUARE = re.compile(r"\s*\[\s*([^\[\]]*?)\s*\]\s*")
_INDEX = re.compile(r"[\d\s,:]*")  # of an element or a part of an array: `y[2]`, `y[1,2]`, `y[1:3]`
_BRACKETS = re.compile(r"(.+?)\s*[({<]\s*([^(){}<>]*?(?:\([^()]*\))?)\s*[)}>]\s*")
_APART = re.compile(r"(.+?)\s*(?:\s/\s*|/\s+|,\s+|\s+in\s+)(\S.*)")
_FRACTION = re.compile(r"([^/]+)/(\S+)")
_BORDER = re.compile(r"[_ .]|(?<=[a-zäöüß0-9])(?=[A-Z])")
# Endings that are more often a word, a side or an axis than a unit.
_WORDS = frozenset(("in", "min", "mins", "day", "days", "kp", "pa", "psi", "mol", "bar", "foot", "feet", "grade"))
# One letter is a unit only behind a word that it fits: ``t_s``, but not ``mass.s``.
_LETTERS = {
    "s": TIME, "a": CURRENT | {"i"}, "v": VOLTAGE | {"u"}, "n": TORQUE,
}  # fmt: skip
_FORCES = frozenset(("n", "mn", "kn", "lb", "lbs", "lbf", "oz", "ozf", "kgf"))
_LENGTHS = frozenset(("m", "cm", "mm", "in", "ft"))


def head_of(text: str, unit: str = "", kind: str = "number", raster: int = 0) -> Head:
    """Return a channel whose unit may be part of its name.

    What stands in brackets or behind a line is a unit, known or not, unless it only describes the channel, as in
    ``load (7)`` and ``angle (motor)``. At the end of a name only known units are.
    """
    name, written = (text, unit) if unit else _split(text)
    return Head(name, written, kind, raster, text)


def _split(text: str) -> tuple[str, str]:
    for square in _SQUARE.finditer(text):
        if not _INDEX.fullmatch(square[1]):
            return f"{text[: square.start()]} {text[square.end() :]}".strip(), square[1]
    found = [f for pattern in (_APART, _BRACKETS) if (f := pattern.fullmatch(text)) is not None]
    for holds in (is_unit, _states):
        for match in found:
            if holds(match[2].strip()) and not re.fullmatch(r"[\d.,: ]+", match[2]):
                return match[1].strip(), match[2].strip()
    fraction = _FRACTION.fullmatch(text)
    if fraction is not None and is_unit(fraction[2]) and not is_unit(fraction[1]) and not fraction[1].endswith(" 1"):
        return fraction[1], fraction[2]
    for name, ending in _endings(text):
        for written in _unit_texts(name, ending):
            if is_unit(written):
                return name, written
    return text, ""


def _states(text: str) -> bool:
    """Return whether what stands in brackets is a unit, known or not."""
    return bool(text) and (is_unit(text) or not describes(text))


def _endings(text: str) -> Iterator[tuple[str, str]]:
    """Yield name and ending at each border of words, the longest ending first; describing words behind it are cut."""
    borders = [(found.start(), found.end()) for found in _BORDER.finditer(text)]
    ends = [len(text)]
    for start, end in reversed(borders):
        if not describes(text[end:]) or is_unit(text[end:]):
            break
        ends.append(start)
    for stop in ends:
        for start, end in borders:
            if start > 0 and end < stop:
                yield (text[:start] + text[stop:]).strip(), text[end:stop]


def _unit_texts(name: str, ending: str) -> Iterator[str]:
    """Yield the texts of units that an ending may be: ``rad_s`` is ``rad/s``, ``lb_in`` is ``lb.in``."""
    plain = ending.strip("_ .")
    if plain.lower() in _WORDS or (re.match(r"[^A-Za-z%°µ0]", plain) and plain != "1/min"):
        return
    if len(plain) == 1 and plain not in "%°" and not _LETTERS.get(plain.lower(), frozenset()) & set(words_of(name)):
        return
    parts = re.split(r"[_ ]", plain)
    if len(parts) == 1:
        yield plain
        yield plain[:1].lower() + plain[1:]
    elif len(parts) == 2 and parts[1] == "s":
        yield "/".join(parts)
    elif (
        parts[1] == "per" or parts[0] in ("0.1", "0,1", "0.01", "0,01") or _is_torque([part.lower() for part in parts])
    ):
        yield " ".join(parts)


def _is_torque(parts: list[str]) -> bool:
    """Return whether two words are a force and a length."""
    return len(parts) == 2 and bool({*parts} & _FORCES) and parts[1] in _LENGTHS | _FORCES
