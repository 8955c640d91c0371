"""Designs in their text form, as the command line takes them: ``NAME=SPECIFICATION`` per varied parameter."""

import re
from collections.abc import Iterable, Sequence

from orchestrator.engine.cases import Value
from orchestrator.engine.grid import Bounds, Design, Listed, Product, Randomised, Ranged, Sobol
from orchestrator.errors import ScenarioError

KINDS = ("range", "logrange", "random", "lograndom", "sobol", "logsobol")
DRAWN = frozenset({"random", "sobol"})


def parse_design(specifications: Sequence[str], samples: int, seed: int) -> Product:
    """Read a design from its text form, one ``NAME=SPECIFICATION`` per varied parameter.

    ======================== ==========================================================
    ``0.01,0.02,0.05``       these values (numbers or words)
    ``range:LOW:HIGH:COUNT`` evenly spaced, ends included; ``logrange`` for log-evenly
    ``random:LOW:HIGH``      drawn uniformly; ``lograndom`` for log-uniformly
    ``sobol:LOW:HIGH``       low-discrepancy points; ``logsobol`` for log-evenly
    ======================== ==========================================================

    Lists and ranges make a full grid. All random parameters are drawn together, ``samples`` times, and so are
    all Sobol ones; each grid point is combined with every draw.
    """
    if seed < 0:
        raise ScenarioError(f"`seed` must not be negative, but is {seed}", "seed")
    axes: list[Design] = []
    drawn: dict[str, list[Bounds]] = {kind: [] for kind in DRAWN}
    for text in specifications:
        name, body = _split(text)
        kind, _, rest = body.partition(":")
        plain = kind.removeprefix("log")
        if plain == "range":
            low, high, count = _numbers(text, rest, 3)
            axes.append(Ranged(name, low, high, int(count), kind != plain))
        elif plain in drawn:
            low, high = _numbers(text, rest, 2)
            drawn[plain].append(Bounds(name, low, high, kind != plain))
        else:
            axes.append(Listed(name, _values(text, body)))
    if drawn["random"]:
        axes.append(Randomised(tuple(drawn["random"]), samples, seed))
    if drawn["sobol"]:
        axes.append(Sobol(tuple(drawn["sobol"]), samples, seed))
    if not axes:
        raise ScenarioError("`vary` must name at least one parameter of a sweep, but is not given", "vary")
    return Product(tuple(axes))


def draws(specifications: Iterable[str]) -> bool:
    """Return whether any parameter is drawn, so that a number of samples means something."""
    return any(_split(text)[1].partition(":")[0].removeprefix("log") in DRAWN for text in specifications)


def _split(text: str) -> tuple[str, str]:
    name, equals, body = (part.strip() for part in text.partition("="))
    if not (name and equals and body):
        raise ScenarioError(f"`vary` must be NAME=SPECIFICATION, but is {text!r}", "vary")
    return name, body


def _numbers(text: str, body: str, count: int) -> list[float]:
    words = body.split(":")
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    if len(numbers) != count or (count == 3 and not numbers[2].is_integer()):
        wanted = "LOW:HIGH:COUNT" if count == 3 else "LOW:HIGH"
        raise ScenarioError(f"`vary` must have {wanted} after its kind, but is {text!r}", "vary")
    return numbers


def _values(text: str, body: str) -> tuple[Value, ...]:
    if re.fullmatch(r"[a-z]+(:[-+.\de]*)+", body):  # a kind that is none, rather than a word with colons
        known = ", ".join(KINDS)
        raise ScenarioError(f"`vary` must be a list or of a kind among {known}, but is {text!r}", "vary")
    words = [word.strip() for word in body.split(",")]
    if not all(words):
        raise ScenarioError(f"`vary` must have a value before and after each comma, but is {text!r}", "vary")
    values = tuple(_number_or_word(word) for word in words)
    if len({type(value) for value in values}) > 1:  # a column of the table has one type
        raise ScenarioError(f"`vary` must be a list of numbers or one of words, but is {text!r}", "vary")
    return values


def _number_or_word(word: str) -> Value:
    try:
        return float(word)
    except ValueError:
        return word
