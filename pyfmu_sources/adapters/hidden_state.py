"""The hidden state of a slave: which attributes a class declares, and how their values are copied and brought back."""

from __future__ import annotations

import sys
from functools import cache
from typing import Any


def hidden_names(cls: type) -> tuple[str, ...]:
    """Return the attributes that a class itself declares by an annotation, class variables apart."""
    own = vars(cls).get("__annotations__", {})
    return tuple(name for name, kind in own.items() if not str(kind).startswith("ClassVar"))


def hidden_type(cls: Any, name: str) -> Any:
    """Return the type that is declared for an attribute."""
    return _type_of(cls, name)


@cache
def _type_of(cls: Any, name: str) -> Any:
    home = next(base for base in cls.__mro__ if name in vars(base).get("__annotations__", {}))
    return eval(home.__annotations__[name], vars(sys.modules[home.__module__]))


def copied(value: Any) -> Any:
    """Return a value whose lists are copies; tuples hold no lists."""
    return [copied(item) for item in value] if isinstance(value, list) else value


def shaped(value: Any, kind: Any) -> Any:
    """Return lists and tuples as ``kind``, a type of the hidden state, says."""
    base = getattr(kind, "__origin__", kind)  # Annotated[list[T], N] leads to list[T], that to list
    if hasattr(kind, "__metadata__"):
        return shaped(value, base)
    if hasattr(kind, "_fields"):
        fields = list(kind.__annotations__.values())
        return kind._make([shaped(item, fields[n]) for n, item in enumerate(value)])
    kinds: tuple[Any, ...] = getattr(kind, "__args__", ())
    if base is list:
        return [shaped(item, kinds[0]) for item in value]
    if base is tuple:
        each = kinds[:1] * len(value) if kinds[-1] is Ellipsis else kinds
        return tuple(shaped(item, k) for item, k in zip(value, each))  # noqa: B905 - Python 3.9 has no `strict`
    return value
