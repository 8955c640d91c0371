"""Which channel of a file is which column of a record, where the file does not use the format's own names."""

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from orchestrator.errors import RecordError
from orchestrator.records.columns import COLUMNS, MEANINGS, OPTIONAL, Column
from orchestrator.records.formats.source import Head
from orchestrator.records.units import parse_unit

_GREEK = str.maketrans({"θ": " theta ", "φ": " phi ", "ϕ": " phi ", "τ": " tau ", "ω": " omega ", "α": " alpha "})
_ANGLE = frozenset(
    [
        "theta",
        "th",
        "phi",
        "angle",
        "ang",
        "pos",
        "position",
        "winkel",
        "lage",
        "encoder",
        "enc",
        "q",
        "stellung",
        "istposition",
    ]
)
_MOTOR = frozenset(
    (
        "m",
        "mot",
        "motor",
        "drive",
        "antrieb",
        "input",
        "motorside",
        "primary",
    )
)
_LOAD = frozenset(
    [
        "l",
        "load",
        "last",
        "output",
        "out",
        "abtrieb",
        "arm",
        "link",
        "joint",
        "gelenk",
        "table",
        "tisch",
        "loadside",
        "secondary",
    ]
)
_TORQUE = frozenset(
    (
        "u",
        "torque",
        "trq",
        "tq",
        "moment",
        "drehmoment",
        "tau",
        "drehmomentsollwert",
        "kraft",
        "force",
    )
)
_CURRENT = frozenset(
    (
        "current",
        "curr",
        "strom",
        "iq",
    )
)
_ASKED = frozenset(
    [
        "ref",
        "set",
        "cmd",
        "command",
        "commanded",
        "soll",
        "sollwert",
        "sp",
        "setpoint",
        "target",
        "demand",
        "request",
        "req",
        "desired",
    ]
)
_FOUND = frozenset(
    (
        "act",
        "actual",
        "ist",
        "istwert",
        "meas",
        "measured",
        "fb",
        "feedback",
    )
)
_SPEED = frozenset(
    ["speed", "velocity", "vel", "omega", "w", "dq", "rpm", "drehzahl", "geschwindigkeit", "acc", "acceleration"]
)
_OTHER = frozenset(
    [
        "err",
        "error",
        "dev",
        "deviation",
        "lag",
        "temp",
        "temperature",
        "limit",
        "lim",
        "max",
        "min",
        "abs",
        "std",
        "raw",
        "status",
        "ff",
    ]
)
_TIME = frozenset(
    [
        "time",
        "t",
        "zeit",
        "timestamp",
        "datetime",
        "date",
        "uhrzeit",
        "elapsed",
        "zeitstempel",
        "stamp",
        "timestamps",
        "seconds",
    ]
)
_SAMPLE = frozenset(
    [
        "sample",
        "samples",
        "index",
        "idx",
        "no",
        "nr",
        "k",
        "n",
        "counter",
        "cycle",
        "row",
        "samplenumber",
        "number",
        "zeile",
    ]
)
_FUSED = re.compile(r"(theta|phi|th|q|pos|angle|ang|winkel|enc)(m|mot|motor|l|load|last)")


@dataclass(frozen=True)
class Choice:
    """The place of a column's channel; ``assumed`` says how it was recognised, empty where it was named."""

    place: int
    assumed: str = ""
    numbered: bool = False


def choose(
    heads: Sequence[Head],
    columns: Mapping[str, Column],
    source: str,
    skip: Sequence[str] = (),
    rated: bool = False,
    torque_needed: bool = True,
) -> dict[str, Choice]:
    """Return the channel of each column of a record: named, of the same name, or recognised without doubt.

    Args:
        heads: channels of the file.
        columns: what the model file says of columns.
        source: file name, for messages.
        skip: columns that are not looked for.
        rated: whether a time can be made of the rows, so that none is needed.
        torque_needed: whether two angles without a torque are refused.

    Returns:
        The choice of each column that was found, by name.

    Raises:
        RecordError: a column is missing or ambiguous; the message says what to write in the model file.
    """
    found: dict[str, Choice] = {}
    names = [name for name in COLUMNS if name not in skip]
    for name in names:
        wanted = columns.get(name, Column()).name
        places = _called(heads, wanted or name)
        if len(places) > 1:
            raise RecordError(
                f"{source}: column `{wanted or name}` must appear once, but appears {len(places)} times: say "
                f'`[columns.{name}] name = "#{places[0] + 1}"` to take the first of them'
            )
        if places:
            found[name] = Choice(places[0])
        elif wanted:
            raise RecordError(
                f"{source}: column `{wanted}` of `[columns.{name}] name` must be there, but is not; there is "
                f"{_listed(heads)}{_near(wanted, heads)}"
            )
    for name in names:
        if name not in found:
            choice = _recognised(name, heads, {c.place for c in found.values()}, source)
            if choice is not None:
                found[name] = choice
            elif name not in OPTIONAL and not (name == "time" and rated) and (name != "u" or torque_needed):
                raise RecordError(_missing(name, heads, source))
    if "u" in names and "u" not in found and "theta_l" not in found:
        raise RecordError(_missing("u", heads, source))
    return found


def _called(heads: Sequence[Head], name: str) -> list[int]:
    """Return the places of channels called ``name``; ``#3`` is the third."""
    if re.fullmatch(r"#\d{1,6}", name) and not any(head.name == name for head in heads):
        place = int(name[1:]) - 1
        return [place] if 0 <= place < len(heads) else []
    exact = [n for n, head in enumerate(heads) if name in (head.full, head.name)]
    return exact or [n for n, head in enumerate(heads) if head.full.lower() == name.lower() != ""]


def _recognised(name: str, heads: Sequence[Head], taken: set[int], source: str) -> Choice | None:
    scores = {n: _score(name, head) for n, head in enumerate(heads) if n not in taken}
    best = max(scores.values(), default=0)
    if best <= 0:
        return None
    places = [n for n, score in scores.items() if score == best]
    if len(places) > 1:
        if name in OPTIONAL:
            return None
        first, second = (heads[n].full or heads[n].name for n in places[:2])
        raise RecordError(
            f"{source}: `{first}` and `{second}` both look like {MEANINGS[name]}: say `[columns.{name}] name = "
            f'"{first}"` (or the other) in the model file (`model`)'
        )
    head = heads[places[0]]
    return Choice(places[0], f"`{head.full or head.name}` taken as {name}", name == "time" and best == 1)


def _words_of(text: str) -> list[str]:
    """Return the words of a channel's name, in lower case."""
    plain = text.translate(_GREEK)
    plain = re.sub(r"([a-zäöü])([A-Z])", r"\1 \2", plain)
    words = [word for word in re.split(r"[^A-Za-zäöüÄÖÜß]+", plain.lower()) if word]
    parts: list[str] = []
    for word in words:
        fused = _FUSED.fullmatch(word)
        parts += fused.groups() if fused is not None else (word,)
    return parts


def _score(name: str, head: Head) -> int:
    """Return how much a channel looks like a column; 0: not at all."""
    words = set(_words_of(head.name))
    unit = parse_unit(head.unit)
    kind = unit.kind if unit is not None else ""
    if head.kind == "stamp":
        return 3 if name == "time" else 0
    if name == "time":
        return _time_score(words, kind)
    if words & (_SPEED | _OTHER) or kind in ("time", "speed", "velocity", "voltage") or not head.name:
        return 0
    if name == "u":
        return _torque_score(words, kind, bool(head.unit))
    if kind not in ("", "angle", "counts", "length") or (head.unit and not kind) or words & (_ASKED | _TORQUE):
        return 0
    side, other = (_MOTOR, _LOAD) if name == "theta_m" else (_LOAD, _MOTOR)
    looks = bool(words & _ANGLE) or kind in ("angle", "counts")
    if not looks or words & (other - side):
        return 0
    if words & side:
        return 3
    return 1 if name == "theta_m" else 0


def _time_score(words: set[str], kind: str) -> int:
    if kind not in ("", "time") or (words & (_ANGLE | _TORQUE | _SPEED | _OTHER)):
        return 0
    if words & _TIME or kind == "time":
        return 3 if words & _TIME else 2
    return 1 if words and words <= _SAMPLE else 0


def _torque_score(words: set[str], kind: str, has_unit: bool) -> int:
    if kind not in ("", "torque", "force", "share", "current") or (has_unit and not kind) or words & (_LOAD - {"l"}):
        return 0
    torque = bool(words & _TORQUE) or kind in ("torque", "force") or ("m" in words and bool(words & _ASKED))
    current = bool(words & _CURRENT) or kind in ("current", "share")
    if not (torque or current):
        return 0
    if words & _ANGLE:
        return 0
    score = 4 if torque else 1
    return score + (3 if words & _ASKED else -1 if words & _FOUND else 1 if torque else 0)


def _listed(heads: Sequence[Head]) -> str:
    names = ",".join(head.full or head.name for head in heads)
    plain = "".join(c if c.isprintable() else "?" for c in names)
    return f"`{plain if len(plain) <= 100 else plain[:97] + '...'}`"


def _near(name: str, heads: Sequence[Head]) -> str:
    close = difflib.get_close_matches(name, [head.full or head.name for head in heads], 1, 0.6)
    return f"; did you mean `{close[0]}`?" if close else ""


def _missing(name: str, heads: Sequence[Head], source: str) -> str:
    if heads and all(re.fullmatch(r"#\d+", head.name) for head in heads):
        return (
            f"{source}: column `{name}` must be there, but the file has no names (the first row must hold names): say "
            f'`[columns.{name}] name = "#{min(COLUMNS.index(name) + 1, len(heads))}"`, by number, in the model file '
            "(`model`)"
        )
    rate = ", or `rate = ...` [Hz] where rows are uniform and there is none" if name == "time" else ""
    return (
        f"{source}: column `{name}` must be there ({MEANINGS[name]}), but the file has {_listed(heads)}: say "
        f'`[columns.{name}] name = "..."`{rate} in the model file (`model`)'
    )
