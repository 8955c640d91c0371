"""Names say what they name: none of the words of docs/naming.md, few functions named by participles."""

import ast
import re
from pathlib import Path

import pytest

from tests.support.sources import ROOT, SOURCES, nodes_of
from tools.readability import is_participle, levels

RULES = (ROOT / "docs" / "naming.md").read_text(encoding="utf-8").partition("## Words that are not names")[2]
NO_NAMES = frozenset(re.search(r"```text\n(.+?)\n```", RULES, re.DOTALL)[1].split())
LARGEST_SHARE = 0.03  # of participles among the names of functions


def names(path, nodes):
    """Names of the module, its classes and functions, and their parameters, with their lines."""
    yield 1, path.stem
    for node in nodes:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            yield node.lineno, node.name
        elif isinstance(node, ast.arg):
            yield node.lineno, node.arg


def riddles(path, nodes):
    return [f"{path.name}:{n} {name}" for n, name in names(path, nodes) if name.strip("_").lower() in NO_NAMES]


def test_words_that_are_not_names_are_read_from_the_page():
    assert {"told", "found", "of_many", "subject"} <= NO_NAMES


def test_names_are_no_riddles():
    assert not [name for path in SOURCES for name in riddles(path, nodes_of(path))]


def test_no_product_name_looks_like_a_test():
    known = [(path, name) for path in SOURCES for _, name in names(path, nodes_of(path))]
    assert not [f"{path.relative_to(ROOT)}: {name}" for path, name in known if name.startswith("test_")]


def test_riddles_are_found():
    nodes = ast.walk(ast.parse("def kept(found):\n    pass\n\nclass Subject:\n    def _own(self):\n        pass\n"))
    found = {text.split()[1] for text in riddles(Path("finer.py"), nodes)}
    assert found == {"finer", "kept", "found", "Subject", "_own"}


def test_few_functions_are_named_by_participles():
    kinds = (ast.FunctionDef, ast.AsyncFunctionDef)
    functions = [node.name for path in SOURCES for node in nodes_of(path) if isinstance(node, kinds)]
    assert sum(map(is_participle, functions)) <= LARGEST_SHARE * len(functions)


@pytest.mark.parametrize("name", ["filtered_signal", "_told", "kept", "moving", "built_up"])
def test_participles_are_told_from_other_words(name):
    assert is_participle(name)


@pytest.mark.parametrize("name", ["filter_signal", "read_record", "_feed", "spring_torque", "run", "timing_of", "step"])
def test_verbs_and_nouns_are_no_participles(name):
    assert not is_participle(name)


def test_levels_count_blocks_and_not_elif():
    (function,) = ast.parse("def f(x):\n for a in x:\n  if a:\n   pass\n  elif x:\n   pass\n  else:\n   a = 1").body
    assert levels(function) == 2
