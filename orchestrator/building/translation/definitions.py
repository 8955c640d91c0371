"""A translated function, and the slave whose method it may be."""

from __future__ import annotations

import ast
from dataclasses import dataclass, field
from typing import Any

from orchestrator.building.translation.kinds import Kind


@dataclass
class Owner:
    """The slave whose method is translated: its class, the kinds of its attributes, how many variables it has."""

    cls: Any
    attributes: dict[str, Kind]
    variables: int


@dataclass
class Function:
    """A translated function."""

    name: str
    c: str
    module: str
    line: int
    parameters: list[tuple[str, Kind]]
    returns: Kind
    defaults: dict[str, ast.expr]
    owned: bool
    mutated: set[str] = field(default_factory=set)
    by_address: set[str] = field(default_factory=set)
    faults: bool = False
    head: str = ""
    body: list[str] = field(default_factory=list)
    comment: str = ""

    @property
    def text(self) -> str:
        lines = "\n".join(f"    {line}" if line else "" for line in self.body)
        return f"{comment_of(self.comment)}{self.head}\n{{\n{lines}\n}}"


def comment_of(text: str) -> str:
    """Return a docstring as a C comment."""
    if not text:
        return ""
    lines = text.replace("``", "`").replace("*/", "* /").replace(":func:", "").replace(":mod:", "").splitlines()
    inner = "\n".join(f" * {line}".rstrip() for line in lines[1:])
    return f"/* {lines[0]}{f'{chr(10)}{inner}' if inner else ''} */\n"
