"""The project's Python sources and what they parse to, which several tests read."""

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted(path for package in ("orchestrator", "pyfmu_sources") for path in (ROOT / package).rglob("*.py"))


@cache
def tree_of(path: Path) -> ast.Module:
    """Return what a file parses to."""
    return ast.parse(path.read_text(encoding="utf-8"))


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    """Return all that a file parses to: walking a tree anew for each test took most of their time."""
    return tuple(ast.walk(tree_of(path)))
