"""What is asked of a compiled module by its name is there: no linter sees through ``compile_module("module").name``."""

import ast
import importlib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FILES = [
    path for room in ("orchestrator", "benchmarks", "tests", "tools") for path in sorted((ROOT / room).rglob("*.py"))
]


def module_of(node: ast.AST) -> str | None:
    """The module of a call ``compile_module("module")``, else None."""
    match node:
        case ast.Call(func=ast.Name("compile_module"), args=[ast.Constant(str() as name)]):
            return name
    return None


def names_of(tree: ast.Module) -> Iterator[tuple[str, str, int]]:
    """Every (module, name, line) that is taken from a compiled module, or from a variable that holds one."""
    functions = [node for node in tree.body if isinstance(node, (ast.FunctionDef, ast.ClassDef))]
    outside = [node for node in tree.body if node not in functions]
    held = _held(outside)
    for body in ([*outside], *([function] for function in functions)):
        known = held | _held(body)
        for node in (node for part in body for node in ast.walk(part)):
            match node:
                case ast.Attribute(value=ast.Name(variable), attr=name) if variable in known:
                    yield known[variable], name, node.lineno
                case ast.Attribute(value=value, attr=name) if module := module_of(value):
                    yield module, name, node.lineno


def _held(body: list[ast.stmt]) -> dict[str, str]:
    """The variables that hold a compiled module, and its name."""
    held = {}
    for node in (node for part in body for node in ast.walk(part)):
        match node:
            case ast.Assign(targets=[ast.Name(variable)], value=value) if module := module_of(value):
                held[variable] = module
            case ast.Assign(targets=[ast.Tuple(targets)], value=ast.Tuple(values)):
                pairs = zip(targets, values, strict=False)
                held |= {t.id: m for t, v in pairs if isinstance(t, ast.Name) and (m := module_of(v))}
    return held


TAKEN = {
    path.relative_to(ROOT).as_posix(): found
    for path in FILES
    if "compile_module(" in (text := path.read_text(encoding="utf-8")) and (found := list(names_of(ast.parse(text))))
}


@pytest.mark.parametrize("file", TAKEN)
def test_names_taken_from_compiled_modules_exist(file: str) -> None:
    missing = [
        f"line {line}: {module}.{name}"
        for module, name, line in TAKEN[file]
        if not hasattr(importlib.import_module(f"pyfmu_sources.{module}"), name)
    ]
    assert missing == []


def test_the_places_are_seen() -> None:
    modules = {module for found in TAKEN.values() for module, _, _ in found}
    assert {"equations", "drivetrain", "servo_axis", "laws.port", "laws.drive", "closed_loop"} <= modules
    wrong = ast.parse(
        'def f():\n    s, n = compile_module("equations"), 1\n'
        '    return s.rates, s.ratez, compile_module("drivetrain").x'
    )
    assert [name for _, name, _ in names_of(wrong)] == ["rates", "ratez", "x"]
