"""How a tree of Python reads: participles as names of functions, deep nesting, imports, docstrings.

python -m tools.readability orchestrator pyfmu_sources
"""

import argparse
import ast
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

_IRREGULAR = """begun bound broken brought built caught chosen drawn driven fallen fed felt found given gone grown held
hidden kept known laid left led lent lost made meant met paid risen said seen sent shown spread taken taught told thrown
understood woken won worn written"""
# Nouns, adjectives and verbs that only look like participles.
_OTHERS = """bed bearing docstring embed embedding exceed feed gearing heading need nothing proceed reading rounding
seed setting shed something spacing speed spring string succeed thing timing training warning wing"""
IRREGULAR = frozenset(_IRREGULAR.split())
NO_PARTICIPLES = frozenset(_OTHERS.split())
MOST_LEVELS = 4
_LEVELS = (ast.If, ast.For, ast.While, ast.With, ast.Try, ast.AsyncFor, ast.AsyncWith, ast.Match)


def is_participle(name: str) -> bool:
    """Tell whether the name of a function begins with a participle, as in ``filtered_signal``."""
    word = re.split(r"_|(?<=[a-z])(?=[A-Z])", name.strip("_"))[0].lower()
    if word in NO_PARTICIPLES:
        return False
    return word in IRREGULAR or bool(re.fullmatch(r"\w{2,}(ed|ing)", word))


def levels(node: ast.AST) -> int:
    """Return how deep blocks are nested in a function; ``elif`` is no level of its own."""
    deepest = 0
    for child in ast.iter_child_nodes(node):
        if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.Lambda)):
            continue
        chained = isinstance(node, ast.If) and isinstance(child, ast.If) and node.orelse == [child]
        deepest = max(deepest, levels(child) + (isinstance(child, _LEVELS) and not chained))
    return deepest


def files_of(places: Sequence[Path]) -> Iterator[tuple[Path, ast.Module]]:
    """Yield the files below ``places`` that are Python, parsed."""
    for place in places:
        for path in [place] if place.is_file() else sorted(place.rglob("*.py")):
            try:
                yield path, ast.parse(path.read_bytes())
            except (SyntaxError, ValueError):
                continue


def functions_of(tree: ast.Module) -> list[ast.FunctionDef | ast.AsyncFunctionDef]:
    """Return all functions and methods of a module."""
    return [node for node in ast.walk(tree) if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))]


def _docstring_lines(tree: ast.Module) -> int:
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef, ast.Module)
    nodes = [node for node in ast.walk(tree) if isinstance(node, kinds) and ast.get_docstring(node)]
    return sum((node.body[0].end_lineno or 0) - node.body[0].lineno + 1 for node in nodes)


def measure(places: Sequence[Path]) -> dict[str, float]:
    """Return the figures of a tree by name; shares in percent."""
    files = list(files_of(places))
    functions = [function for _, tree in files for function in functions_of(tree)]
    lines = sum(len(path.read_bytes().splitlines()) for path, _ in files)
    imports = sum(isinstance(node, (ast.Import, ast.ImportFrom)) for _, tree in files for node in ast.walk(tree))
    return {
        "files": len(files),
        "lines": lines,
        "functions": len(functions),
        "participles [%]": 100.0 * sum(is_participle(f.name) for f in functions) / max(len(functions), 1),
        "deep functions": sum(levels(f) > MOST_LEVELS for f in functions),
        "imports per file": imports / max(len(files), 1),
        "docstrings [%]": 100.0 * sum(_docstring_lines(tree) for _, tree in files) / max(lines, 1),
    }


def main() -> None:
    """Print the figures of the trees that are named, together; with ``--names`` also the names that count."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("places", nargs="+", type=Path)
    parser.add_argument("--names", action="store_true", help="list functions named by participles, and deep ones")
    arguments = parser.parse_args()
    for name, value in measure(arguments.places).items():
        print(f"{name:18} {value:10.4g}" if isinstance(value, float) else f"{name:18} {value:10,}")
    if arguments.names:
        for path, tree in files_of(arguments.places):
            for function in functions_of(tree):
                words = ["participle"] * is_participle(function.name) + ["deep"] * (levels(function) > MOST_LEVELS)
                if words:
                    print(f"{path}:{function.lineno} {function.name}: {', '.join(words)}")


if __name__ == "__main__":
    main()
