"""Which elements and attributes XML files may have: schemas as a small grammar.

A line of a grammar is a type: ``name | children | attributes``.

Children are a sequence of tags, each with ``?``, ``*`` or ``+`` as in a regular expression; ``(A|B)`` is a choice,
``ANY`` allows whatever is well-formed. A tag is of the type of its name, or of the one behind a colon. Attributes are
``name``, ``name:kind`` or ``name:kind*`` for a list; ``!`` makes one compulsory; ``a/b/c`` is a choice of words;
``@name`` takes over the attributes of a line, ``*`` allows attributes that the grammar does not have.
"""

import functools
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from lxml import etree

_XSI = "{http://www.w3.org/2001/XMLSchema-instance}"
_PARTICLE = re.compile(r"([A-Za-z0-9.]+)(?::([A-Za-z0-9.]+))?")
_DOUBLE = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?|-?INF|NaN", re.ASCII)
_INTEGER = re.compile(r"[+-]?\d+", re.ASCII)
_YEAR = r"-?\d{4,}-(0[1-9]|1[0-2])-(0[1-9]|[12]\d|3[01])"
_PATTERNS = {
    "boolean": re.compile(r"true|false|0|1"),
    "double": _DOUBLE,
    "hex": re.compile(r"([0-9a-fA-F]{2})*"),
    "version3": re.compile(r"3[.](0|[1-9][0-9]*)([.](0|[1-9][0-9]*))?(-.+)?"),
    "date": re.compile(
        _YEAR + r"T(([01]\d|2[0-3]):[0-5]\d:[0-5]\d(\.\d+)?|24:00:00(\.0+)?)(Z|[+-](0\d|1[0-3]):[0-5]\d|[+-]14:00)?",
        re.ASCII,
    ),
}
_RANGES = {
    **{f"int{n}": (-(1 << (n - 1)), (1 << (n - 1)) - 1) for n in (8, 16, 32, 64)},
    **{f"uint{n}": (0, (1 << n) - 1) for n in (8, 16, 32, 64)},
    "natural": (0, None),
}
_LONGEST_INTEGER = 400


@dataclass(frozen=True)
class _Attribute:
    kind: str
    needed: bool
    many: bool


@dataclass(frozen=True)
class _Type:
    """Children by tag with their types (None: anything goes), their order as a pattern, and the attributes."""

    children: dict[str, str] | None
    order: re.Pattern[str]
    wanted: str
    attributes: dict[str, _Attribute]
    open: bool


@functools.cache
def _grammar(text: str) -> dict[str, _Type]:
    lines = {line.split(" |")[0].strip(): line for line in text.strip().splitlines()}
    cells = {name: _cells(line) for name, line in lines.items()}
    return {
        name: _type(children, _attributes(attributes, cells))
        for name, (children, attributes) in cells.items()
        if not name.startswith("@")
    }


def _cells(line: str) -> tuple[str, str]:
    """Children and attributes of a line; a choice has bars of its own, without blanks around them."""
    parts = [p.strip() for p in f" {line} ".replace(" |", " | ").split(" | ")]
    return parts[1], parts[2] if len(parts) > 2 else ""


def _attributes(text: str, cells: dict[str, tuple[str, str]]) -> dict[str, _Attribute]:
    found: dict[str, _Attribute] = {}
    for word in text.split():
        if word.startswith("@"):
            found |= _attributes(cells[word][1], cells)
        elif word != "*":
            name, _, kind = word.rstrip("!").partition(":")
            found[name] = _Attribute(kind.rstrip("*"), word.endswith("!"), kind.endswith("*"))
    return found | ({"*": _Attribute("", False, False)} if "*" in text.split() else {})


def _type(children: str, attributes: dict[str, _Attribute]) -> _Type:
    free = attributes.pop("*", None) is not None
    if children == "ANY":
        return _Type(None, re.compile(""), "", attributes, free)
    types = {tag: kind or tag for tag, kind in _PARTICLE.findall(children)}
    pattern = _PARTICLE.sub(lambda m: f"(?:{m[1]};)", children).replace(" ", "")
    shown = re.sub(r":[A-Za-z0-9.]+", "", children)
    return _Type(types, re.compile(pattern), shown, attributes, free)


@dataclass
class Fault:
    """Faults of one kind: the first place, what is wrong there, and how many there are."""

    element: etree._Element  # the first that has it
    message: str
    count: int = 0


def attributes_of(grammar: str, kind: str) -> frozenset[str]:
    """Return the attributes that a grammar has for a type."""
    return frozenset(_grammar(grammar)[kind].attributes)


def grammar_faults(root: etree._Element, grammar: str, name_of: Callable[[str], str] = str) -> list[Fault]:
    """Return what is wrong with elements and attributes; equal faults of one kind of element are one.

    ``name_of``: what the grammar calls a tag.
    """
    types = _grammar(grammar)
    faults: dict[tuple[str, str], Fault] = {}
    waiting: list[tuple[etree._Element, str]] = [(root, name_of(str(root.tag)))]
    while waiting:
        element, kind = waiting.pop()
        described = types[kind]
        for key, message in _faults(element, described, name_of):
            fault = faults.get((kind, key))
            if fault is None:
                fault = faults[kind, key] = Fault(element, message)
            fault.count += 1
        children = described.children
        if children is not None:
            named = [(c, name_of(c.tag)) for c in reversed(element) if isinstance(c.tag, str)]
            waiting += [(child, children[name]) for child, name in named if name in children]
    return list(faults.values())


def _faults(element: etree._Element, kind: _Type, name_of: Callable[[str], str]) -> Iterator[tuple[str, str]]:
    """Key and message of each fault of an element itself."""
    tag = name_of(str(element.tag))
    for name, value in element.attrib.items():
        attribute = kind.attributes.get(str(name))
        if attribute is not None:
            wrong = _value_fault(str(value), attribute)
            if wrong:
                yield f"@{name} value", f"{name} of <{tag}> must be {wrong}, but is {str(value)[:80]!r}"
        elif not kind.open and not str(name).startswith(_XSI):
            yield f"@{name}", f"<{tag}> must not have the attribute `{name}`, but has it"
    for name, attribute in kind.attributes.items():
        if attribute.needed and name not in element.attrib:
            yield f"@{name} missing", f"<{tag}> must have the attribute `{name}`, but has not"
    if kind.children is None:
        return
    found = [name_of(child.tag) for child in element if isinstance(child.tag, str)]
    strange = next((t for t in found if t not in kind.children), None)
    if strange is not None:
        yield f"<{strange}>", f"<{tag}> must not have a child <{strange}>, but has one"
    elif not kind.order.fullmatch("".join(f"{t};" for t in found)):
        few = ", ".join(dict.fromkeys(found)) or "none"
        yield "order", f"the children of <{tag}> must be `{kind.wanted or 'none'}` in this order, but are {few}"
    if any((text or "").strip() for text in (element.text, *(child.tail for child in element))):
        yield "text", f"<{tag}> must have no text of its own, but has"


def _value_fault(text: str, attribute: _Attribute) -> str:
    """What the value must be; empty when it is."""
    kind = attribute.kind
    if not kind:
        return ""
    for word in text.split() if attribute.many else [text.strip(" \t\r\n")]:
        wrong = _word_fault(word, kind)
        if wrong:
            return f"a list, each {wrong}" if attribute.many else wrong
    return ""


def _word_fault(word: str, kind: str) -> str:
    pattern = _PATTERNS.get(kind)
    if pattern is not None:
        return "" if pattern.fullmatch(word) else _WORDS[kind]
    if kind in _RANGES:
        low, high = _RANGES[kind]
        if not _INTEGER.fullmatch(word) or len(word) > _LONGEST_INTEGER:
            return "an integer"
        inside = low <= int(word) and (high is None or int(word) <= high)
        return "" if inside else f"an integer from {low} to {'any' if high is None else high}"
    words = kind.split("/")
    return "" if word in words else f"one of {', '.join(words)}"


_WORDS = {
    "boolean": "true or false",
    "double": "a number",
    "hex": "hexadecimal digits, two for each byte",
    "version3": "a version of FMI 3",
    "date": "a date and time such as 2024-05-01T12:00:00Z",
}
