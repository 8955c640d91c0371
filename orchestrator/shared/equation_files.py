"""The files of ``pyfmu_sources`` that hold the equations: by name (``laws.friction``), and which import which."""

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pyfmu_sources
from orchestrator.errors import FmuError
from pyfmu_sources.hybrid.syntax import parse_python

PACKAGE = pyfmu_sources.__name__
SOURCES = Path(pyfmu_sources.__file__).parent
RUNTIME = "pythonfmu"  # lies in the package of an FMU, and not in the sources


def module_name(path: Path) -> str:
    """Return the name of a file's module: ``laws.friction``; of a package, ``laws``."""
    words = path.relative_to(SOURCES).with_suffix("").parts
    return ".".join(words[:-1] if words[-1] == "__init__" else words)


@cache
def closure(name: str) -> tuple[Path, ...]:
    """Return the file of a module and those of all that it imports, directly or not, sorted by name."""
    found: dict[str, Path] = {}
    place = SOURCES.joinpath(*name.split("."))
    waiting = [place / "__init__.py" if place.is_dir() else place.with_suffix(".py")]
    while waiting:
        path = waiting.pop()
        if module_name(path) not in found:
            found[module_name(path)] = path
            waiting += read_imports(path)
    return tuple(found[name] for name in sorted(found))


def members(name: str) -> dict[str, bytes]:
    """Return content by name in the package of an FMU (``laws/friction.py``) of all that a module is made of."""
    return {path.relative_to(SOURCES).as_posix(): path.read_bytes() for path in closure(name)}


@cache
def read_imports(path: Path) -> tuple[Path, ...]:
    """Return the files that a source imports from beside it, with those of the packages that they lie in."""
    return tuple(_imports(path))


def _statements(block: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Yield the statements of a block and of the blocks within, without a look at expressions."""
    for node in block:
        yield node
        for inner in (node, *getattr(node, "handlers", ()), *getattr(node, "cases", ())):
            for name in ("body", "orelse", "finalbody"):
                yield from _statements(getattr(inner, name, []))


def _imports(path: Path) -> Iterator[Path]:
    for node in _statements(parse_python(path.read_bytes()).body):
        if isinstance(node, ast.Import) and any(_is_ours(alias.name) for alias in node.names):
            raise FmuError(f"{path}:{node.lineno}: {_MESSAGE}, but is `{ast.unparse(node)}`")
        if not isinstance(node, ast.ImportFrom):
            continue
        if node.level == 0:
            if _is_ours(node.module or ""):
                raise FmuError(f"{path}:{node.lineno}: {_MESSAGE}, but is `{ast.unparse(node)}`")
            continue
        base = path.parents[node.level - 1]
        words = node.module.split(".") if node.module else []
        if words[:1] == [RUNTIME]:
            continue
        place = base.joinpath(*words)
        targets = [place / f"{alias.name}.py" for alias in node.names] if place.is_dir() else [place.with_suffix(".py")]
        for target in targets:
            if not target.is_file() or not target.is_relative_to(SOURCES):
                raise FmuError(f"{path}:{node.lineno}: {_MESSAGE}, but `{ast.unparse(node)}` finds no {target.name}")
            yield target
            inner = [folder for folder in target.parents if folder != SOURCES and folder.is_relative_to(SOURCES)]
            yield from (folder / "__init__.py" for folder in inner)


_MESSAGE = "an import of the sources must be relative (`from .laws.friction import f`) and of a module"


def _is_ours(module: str) -> bool:
    return module.split(".", maxsplit=1)[0] == PACKAGE
