"""Python modules as the translator reads them: syntax tree, names as Python resolved them, places."""

from __future__ import annotations

import ast
import importlib
import io
import sys
import tokenize
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

from orchestrator.building.translation.kinds import Kind, KindError, is_type, kind_of
from orchestrator.errors import FmuError
from orchestrator.shared.equation_files import PACKAGE, module_name, read_imports
from pyfmu_sources.hybrid.syntax import parse_expression, parse_python

# Their classes are the runtime's business.
NOT_TRANSLATED = ("adapters.slave_base", "adapters.sampled_slave")


@dataclass(frozen=True)
class ModuleSource:
    """One module."""

    name: str
    path: Path
    tree: ast.Module
    module: ModuleType
    functions: dict[str, ast.FunctionDef] = field(repr=False)
    remarks: dict[int, str] = field(repr=False)
    whole_lines: frozenset[int] = field(repr=False)

    def refuse(self, node: ast.AST, message: str) -> NoReturn:
        """Raise for what is outside the subset, with file and line."""
        raise FmuError(f"{self.path}:{getattr(node, 'lineno', 1)}: {message}")

    def comments(self, node: ast.stmt) -> list[str]:
        """Return the comments right above a statement and at its first line."""
        line = node.lineno - 1
        above: list[str] = []
        while line in self.whole_lines:
            above.insert(0, self.remarks[line])
            line -= 1
        if node.lineno in self.remarks:
            above.append(self.remarks[node.lineno])
        return [text for text in above if not text.startswith("noqa")]

    def value(self, name: str) -> Any:
        return vars(self.module)[name]

    def has(self, name: str) -> bool:
        return name in vars(self.module)

    def annotation(self, node: ast.expr | None, place: ast.AST) -> Kind:
        if node is None:
            self.refuse(place, "parameters and results must have type annotations")
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            node = parse_expression(node.value)
        try:
            evaluated = eval(compile(ast.Expression(node), str(self.path), "eval"), vars(self.module))
            return kind_of(evaluated)
        except (NameError, AttributeError, TypeError) as error:
            self.refuse(place, f"the annotation `{ast.unparse(node)}` cannot be evaluated: {error}")
        except KindError as error:
            self.refuse(place, f"{error}")

    def imports(self) -> Iterator[str]:
        """Yield the full names of the modules that it imports from, base classes of slaves apart."""
        if not self.module.__name__.startswith(f"{PACKAGE}."):
            return  # a kernel
        names = (module_name(path) for path in read_imports(Path(self.module.__file__ or "")))
        yield from (f"{PACKAGE}.{name}" for name in names if name not in NOT_TRANSLATED)

    def aliases(self) -> Iterator[tuple[str, Kind]]:
        """Yield names of tuples and lists that this module gives, in order."""
        for node in self.tree.body:
            names = [node.name] if isinstance(node, ast.ClassDef) else []
            if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                names = [node.targets[0].id]
            for name in names:
                if is_type(vars(self.module).get(name)):
                    try:
                        yield name, kind_of(self.value(name))
                    except KindError:
                        continue


@cache
def read_source(name: str) -> ModuleSource:
    """Return the module of this full name."""
    try:
        module = sys.modules.get(name) or importlib.import_module(name)
        path = Path(module.__file__ or "")
        content = path.read_bytes()
        tree = parse_python(content)
    except (ImportError, OSError, SyntaxError) as error:
        raise FmuError(f"the source {name} cannot be read: {error}") from None
    functions = {node.name: node for node in tree.body if isinstance(node, ast.FunctionDef)}
    remarks, whole = _remarks(content)
    short = name.removeprefix(f"{PACKAGE}.") if name.startswith(f"{PACKAGE}.") else name.partition("[")[0]
    return ModuleSource(short, _relative_path(path), tree, module, functions, remarks, whole)


def _remarks(content: bytes) -> tuple[dict[int, str], frozenset[int]]:
    """Return the comments by line, and the lines that are nothing else."""
    found: dict[int, str] = {}
    whole: set[int] = set()
    for token in tokenize.tokenize(io.BytesIO(content).readline):
        if token.type == tokenize.COMMENT:
            found[token.start[0]] = token.string.lstrip("# ").replace("*/", "* /")
            if not token.line[: token.start[1]].strip():
                whole.add(token.start[0])
    return found, frozenset(whole)


def _relative_path(path: Path) -> Path:
    try:
        return path.relative_to(Path.cwd())
    except ValueError:
        return path


def docstring(node: ast.AST) -> str:
    """Return a docstring without indentation, or nothing."""
    assert isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module)
    return ast.get_docstring(node) or ""
