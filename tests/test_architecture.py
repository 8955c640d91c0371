"""Imports point one way, modules and functions stay small, public names are documented."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("orchestrator", "pyfmu_sources")
SOURCES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
MOST_LINES = 400
MOST_FUNCTION_LINES = 60

# Lower layers first; a module may import from its own layer's package and from the layers below.
LAYERS = (
    {"errors", "cores"},
    {"output", "cache"},
    {"compiled", "design", "reference", "record"},
    {"model_file"},
    {"record_plausibility"},
    {"master"},
    {"fmi"},
    {"scenario"},
    {"checking", "engine"},
    {"scenario_sweep"},
    {"paired", "estimation"},
    {"ssp", "thesis"},
    {"diagnosis", "bench"},
    {"reporting"},
    {"commands"},
    {"cli"},
    {"__main__"},
)


def layer_of(part):
    return next((n for n, names in enumerate(LAYERS) if part in names), None)


def imports(path):
    """Full names of the project's modules that a file imports, function bodies included."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def test_sources_are_found():
    assert len(SOURCES) > 30


def test_the_sources_of_the_fmus_stand_alone():
    for path in (ROOT / "pyfmu_sources").glob("*.py"):
        for name in imports(path):
            assert name.split(".")[0] not in {"orchestrator", "numpy", "scipy", "fmpy", "numba"}, f"{path}: {name}"


def test_every_part_of_the_orchestrator_has_a_layer():
    parts = {
        path.relative_to(ROOT / "orchestrator").parts[0].removesuffix(".py")
        for path in SOURCES
        if "orchestrator" in path.parts
    }
    unknown = {part for part in parts if part != "__init__" and layer_of(part) is None}
    assert not unknown


def test_imports_point_one_way():
    wrong = []
    for path in (ROOT / "orchestrator").rglob("*.py"):
        part = path.relative_to(ROOT / "orchestrator").parts[0].removesuffix(".py")
        for name in imports(path):
            words = name.split(".")
            if words[0] != "orchestrator" or len(words) < 2:
                continue
            target = words[1]
            if target == part or layer_of(target) is None or part == "__init__":
                continue
            if layer_of(target) >= layer_of(part):
                wrong.append(f"{path.relative_to(ROOT)} imports {name}")
    assert not wrong


def test_only_commands_print():
    for path in SOURCES:
        if "commands" in path.parts:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            called = isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "print"
            assert not called, f"{path} prints"


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_modules_and_functions_stay_small(path):
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) <= MOST_LINES
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            first = node.body[1] if ast.get_docstring(node) and len(node.body) > 1 else node.body[0]
            assert node.end_lineno - first.lineno < MOST_FUNCTION_LINES, f"{node.name} is too long"


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(ROOT)))
def test_public_names_are_documented(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    if path.name != "__main__.py":
        assert ast.get_docstring(tree), "the module has no docstring"
    for node in tree.body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_"):
            assert ast.get_docstring(node), f"{node.name} has no docstring"
