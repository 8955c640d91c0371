"""Which channel of a file is which column of a record, where the file does not use the format's own names."""

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from orchestrator.errors import RecordError
from orchestrator.records import words
from orchestrator.records.columns import COLUMNS, KINDS, MEANINGS, OPTIONAL, Column
from orchestrator.records.formats.source import Head
from orchestrator.records.units import parse_unit
from orchestrator.records.words import words_of


@dataclass(frozen=True)
class Choice:
    """The place of a column's channel; ``assumed`` says how it was recognised, empty where it was named."""

    place: int
    assumed: str = ""
    numbered: bool = False


def find_channels(
    heads: Sequence[Head],
    columns: Mapping[str, Column],
    source: str,
    skip: Sequence[str] = (),
    rated: bool = False,
    torque_needed: bool = True,
) -> tuple[dict[str, Choice], dict[str, str]]:
    """Return the channel of each column of a record: named, of the same name, or recognised without doubt.

    Beside the channels stands, for each other column that must be there, a message that says what is missing.
    """
    found: dict[str, Choice] = {}
    unclear: dict[str, str] = {}
    names = [name for name in COLUMNS if name not in skip]
    for name in sorted(names, key=lambda name: not columns.get(name, Column()).name):  # what is stated comes first
        wanted = columns.get(name, Column()).name
        places = find_named(heads, wanted or name)
        if len(places) > 1:
            unclear[name] = (
                f"{source}: column `{wanted or name}` must appear once, but appears {len(places)} times: say "
                f'`[columns.{name}] name = "#{places[0] + 1}"` to take the first of them'
            )
        elif places and (other := next((n for n, one in found.items() if one.place == places[0]), "")):
            if wanted:
                unclear[name] = (
                    f"{source}: column `{wanted}` must be one column of a record, but is named for `{other}` and for "
                    f"`{name}`: name another by `[columns.{name}] name` in the model file (`model`)"
                )
        elif places:
            found[name] = Choice(places[0])
        elif wanted:
            unclear[name] = (
                f"{source}: column `{wanted}` of `[columns.{name}] name` must be there, but is not; there is "
                f"{list_names(heads)}{near(wanted, heads)}"
            )
    for name in names:
        if name in found or name in unclear:
            continue
        try:
            choice = _recognise(name, heads, {c.place for c in found.values()}, source)
        except RecordError as error:
            unclear[name] = str(error)
            continue
        if choice is not None:
            found[name] = choice
        elif name not in OPTIONAL and not (name == "time" and rated) and (name != "u" or torque_needed):
            unclear[name] = _absence_message(name, heads, source)
    if "u" in names and "u" not in found and "theta_l" not in found:
        unclear.setdefault("u", _absence_message("u", heads, source))
    return found, unclear


def find_named(heads: Sequence[Head], name: str) -> list[int]:
    """Return the places of channels called ``name``; ``#3`` is the third."""
    if re.fullmatch(r"#\d{1,6}", name) and not any(head.name == name for head in heads):
        place = int(name[1:]) - 1
        return [place] if 0 <= place < len(heads) else []
    exact = [n for n, head in enumerate(heads) if head.full == name] or [
        n for n, head in enumerate(heads) if head.name == name
    ]
    return exact or [n for n, head in enumerate(heads) if head.full.lower() == name.lower() != ""]


def recognise_time(heads: Sequence[Head], source: str) -> int | None:
    """Return the place of the time, recognised by name or unit; None: there is none, or only a sample number."""
    choice = _recognise("time", heads, set(), source)
    return None if choice is None or choice.numbered else choice.place


def _recognise(name: str, heads: Sequence[Head], taken: set[int], source: str) -> Choice | None:
    """Return the channel that looks most like a column; those in units that are not known come last."""
    free = [n for n in range(len(heads)) if n not in taken]
    for known in (True, False):
        scores = {
            n: _score(name, heads[n]) for n in free if known == (not heads[n].unit or _kind(heads[n], name) != "")
        }
        best = max(scores.values(), default=0)
        if best <= 0:
            continue
        places = [n for n, score in scores.items() if score == best]
        if len(places) == 1:
            head = heads[places[0]]
            return Choice(places[0], f"`{head.full or head.name}` taken as {name}", name == "time" and best == 1)
        if name in OPTIONAL:
            return None
        first, second = (heads[n].full or heads[n].name for n in places[:2])
        one, other = (first, f"or `{second}`") if first != second else (f"#{places[0] + 1}", f"or `#{places[1] + 1}`")
        raise RecordError(
            f"{source}: `{first}` and `{second}` both look like {MEANINGS[name]}: say `[columns.{name}] name = "
            f'"{one}"` ({other}) in the model file (`model`)'
        )
    return None


def _kind(head: Head, name: str) -> str:
    """Return what a channel's unit measures; empty: it has none, or an unknown one."""
    unit = parse_unit(head.unit, KINDS[name])
    return "" if unit is None else unit.kind or "other"


def _score(name: str, head: Head) -> int:
    """Return how much a channel looks like a column; 0: not at all."""
    found, kind = set(words_of(head.name)), _kind(head, name)
    if head.kind == "stamp":
        return 4 if name == "time" else 0
    if name == "time":
        return _time_score(found, kind)
    if found & (words.SPEED | words.OTHER) or kind in ("time", "speed", "velocity", "voltage") or not head.name:
        return 0
    if name == "u":
        return _torque_score(found, kind)
    if kind not in ("", "angle", "counts", "length") or found & (words.ASKED | words.TORQUE):
        return 0
    side, other = (words.MOTOR, words.LOAD) if name == "theta_m" else (words.LOAD, words.MOTOR)
    looks = bool(found & words.ANGLE) or kind in ("angle", "counts")
    if not looks or found & (other - side):
        return 0
    if found & side:
        return 3
    return 1 if name == "theta_m" else 0


def _time_score(tokens: set[str], kind: str) -> int:
    if kind not in ("", "time") or (tokens & (words.ANGLE | words.TORQUE | words.SPEED | words.OTHER)):
        return 0
    if tokens & words.TIME or kind == "time":
        return 3 if tokens & words.TIME else 2
    return 1 if tokens and tokens <= words.SAMPLE else 0


def _torque_score(tokens: set[str], kind: str) -> int:
    if kind not in ("", "torque", "force", "share", "current") or tokens & (words.LOAD - {"l"}):
        return 0
    torque = (
        bool(tokens & words.TORQUE) or kind in ("torque", "force") or ("m" in tokens and bool(tokens & words.ASKED))
    )
    current = bool(tokens & words.CURRENT) or kind in ("current", "share")
    if not (torque or current):
        return 0
    if tokens & words.ANGLE:
        return 0
    score = 5 if torque else 2
    return score + (3 if tokens & words.ASKED else -1 if tokens & words.FOUND else 1 if torque else 0)


def list_names(heads: Sequence[Head]) -> str:
    """Return the names of channels for a message, as far as there is room."""
    names = ",".join(head.full or head.name for head in heads)
    plain = "".join(c if c.isprintable() else "?" for c in names)
    return f"`{plain if len(plain) <= 100 else plain[:97] + '...'}`"


def near(name: str, heads: Sequence[Head]) -> str:
    """Return the question whether a name like this one was meant, or nothing."""
    close = difflib.get_close_matches(name, [head.full or head.name for head in heads], 1, 0.6)
    return f"; did you mean `{close[0]}`?" if close else ""


def _absence_message(name: str, heads: Sequence[Head], source: str) -> str:
    if heads and all(re.fullmatch(r"#\d+", head.name) for head in heads):
        return (
            f"{source}: column `{name}` must be there, but the file has no names (the first row must hold names): say "
            f'`[columns.{name}] name = "#{min(COLUMNS.index(name) + 1, len(heads))}"`, by number, in the model file '
            "(`model`)"
        )
    rate = ", or `rate = ...` [Hz] where rows are uniform and there is none" if name == "time" else ""
    return (
        f"{source}: column `{name}` must be there ({MEANINGS[name]}), but the file has {list_names(heads)}: say "
        f'`[columns.{name}] name = "..."`{rate} in the model file (`model`)'
    )
