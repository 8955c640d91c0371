"""Public functions say what they take, give and raise."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("orchestrator", "pyfmu_sources")


def parsed():
    paths = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
    return {path: ast.parse(path.read_text(encoding="utf-8")) for path in paths}


TREES = parsed()


def methods_by_class():
    """Names of the methods of every class, by the class's name; that of its bases is what an override inherits."""
    classes = [node for tree in TREES.values() for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    own: dict[str, set[str]] = {}
    bases: dict[str, set[str]] = {}
    for c in classes:  # classes of one name share an entry
        own.setdefault(c.name, set()).update(f.name for f in c.body if isinstance(f, ast.FunctionDef))
        bases.setdefault(c.name, set()).update(b.id for b in c.bases if isinstance(b, ast.Name) and b.id != c.name)
    return own, bases


OWN, BASES = methods_by_class()


def inherited(name):
    found = set()
    for base in BASES.get(name, []):
        found |= OWN.get(base, set()) | inherited(base)
    return found


def raises(node):
    """Whether the function itself raises an error, rather than a function inside it or again what it caught."""
    left = list(node.body)
    while left:
        n = left.pop()
        if isinstance(n, ast.Raise) and n.exc is not None:
            return True
        if not isinstance(n, (ast.FunctionDef, ast.ClassDef, ast.Lambda)):
            left += ast.iter_child_nodes(n)
    return False


def lacking(node):
    """Which sections a function's docstring lacks."""
    text = ast.get_docstring(node) or ""
    arguments = [a.arg for a in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
    decorators = {d.id for d in node.decorator_list if isinstance(d, ast.Name)}
    gives = node.returns is not None and not (isinstance(node.returns, ast.Constant) and node.returns.value is None)
    lack = []
    if set(arguments) - {"self", "cls"} and "Args:" not in text:
        lack.append("Args")
    if gives and not decorators & {"property", "cached_property"} and "Returns:" not in text and "Yields:" not in text:
        lack.append("Returns")
    if raises(node) and "Raises:" not in text:
        lack.append("Raises")
    return lack


def room_of(path):
    """The folder below the package; the package itself for a module of its own."""
    return "/".join(path.relative_to(ROOT).parts[:2][: len(path.relative_to(ROOT).parts) - 1])


def public_functions(room):
    """Public functions and methods of a room, those aside that carry out what a base class documents."""
    for path, tree in TREES.items():
        if room_of(path) != room:
            continue
        for node in tree.body:
            inner = node.body if isinstance(node, ast.ClassDef) and not node.name.startswith("_") else [node]
            known = inherited(node.name) if isinstance(node, ast.ClassDef) else set()
            for function in inner:
                public = isinstance(function, ast.FunctionDef) and not function.name.startswith("_")
                form = public and any(isinstance(d, ast.Name) and d.id == "overload" for d in function.decorator_list)
                if public and not form and function.name not in known:
                    yield path, function


ROOMS = sorted({room_of(path) for path in TREES})


@pytest.mark.parametrize("room", ROOMS)
def test_public_functions_say_what_they_take_give_and_raise(room):
    functions = list(public_functions(room))
    wrong = [f"{path.name}:{f.lineno} {f.name}: {', '.join(lacking(f))}" for path, f in functions if lacking(f)]
    assert not wrong
