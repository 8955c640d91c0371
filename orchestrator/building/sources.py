"""Which source files an FMU is made of, and the fingerprints by which a stale FMU is recognised."""

import ast
import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from orchestrator.errors import FmuError
from orchestrator.shared.equation_files import SOURCES, closure, module_name
from orchestrator.shared.version import __version__
from pyfmu_sources.hybrid.syntax import parse_python

HERE = Path(__file__).parent
SUFFIX = "_slave"
# Not themselves slaves, although their names end so.
BASES = ("plant_slave", "sampled_slave")
PLACEHOLDER = "{00000000-0000-0000-0000-000000000000}"
"""Stands for a GUID in C until the content that it follows from is known."""


@dataclass(frozen=True)
class Recipe:
    """What one FMU is made from: model name, adapter module and class, start values that differ."""

    name: str
    module: str
    class_name: str
    starts: Mapping[str, float] = field(default_factory=dict)


@cache
def catalogue() -> dict[str, Recipe]:
    """Return the recipe of every adapter ``*_slave.py`` in a room of ``pyfmu_sources``, by the name of its class."""
    recipes = {}
    for path in sorted(SOURCES.rglob(f"*{SUFFIX}.py"), key=lambda path: path.stem):
        if path.stem in BASES:
            continue
        classes = [node.name for node in parse_python(path.read_bytes()).body if isinstance(node, ast.ClassDef)]
        recipes[classes[-1]] = Recipe(classes[-1], module_name(path), classes[-1])
    return recipes


def recipe_of(name: str) -> Recipe:
    """Return the recipe called ``name``."""
    try:
        return catalogue()[name]
    except KeyError:
        raise FmuError(f"`name` must be one of {', '.join(catalogue())}, but is {name!r}") from None


def recipes_of(names: Sequence[str] | None) -> list[Recipe]:
    """Return the recipes of these names (default: all)."""
    return [recipe_of(name) for name in (catalogue() if names is None else names)]


def digest(parts: Iterable[bytes]) -> str:
    """Return a SHA-256 of ``parts``, 64 hexadecimal digits, in which their borders count."""
    total = hashlib.sha256()
    for part in parts:
        total.update(len(part).to_bytes(8, "little") + part)
    return total.hexdigest()


def fingerprint(recipe: Recipe, *made_with: str) -> str:
    """Return 64 hexadecimal digits that change whenever a build would: by sources, builder, start values or tools."""
    options = {
        "name": recipe.name,
        "class": recipe.class_name,
        "starts": {name: float(value).hex() for name, value in sorted(recipe.starts.items())},
        "version": __version__,
        "made with": made_with,
    }
    named = [part for path in closure(recipe.module) for part in (path.name.encode(), path.read_bytes())]
    return digest([json.dumps(options, sort_keys=True).encode(), _builder_digest().encode(), *named])


@cache
def _builder_digest() -> str:
    """Return a digest of all files of this room, and of the design of the start values."""
    files = sorted(path for path in HERE.rglob("*") if path.is_file() and path.suffix != ".pyc")
    design = HERE.parent / "plants" / "design.py"
    return digest(part for path in (*files, design) for part in (path.name.encode(), path.read_bytes()))
