"""Syntax trees that several threads ask for at once."""

import gc
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from pyfmu_sources.hybrid import syntax
from pyfmu_sources.hybrid.syntax import parse_expression, parse_python
from tests.support.sources import ROOT


class Slow:
    """Lets other threads run while it is collected."""

    def __init__(self):
        self.itself = self

    def __del__(self):
        sum(range(200))


@pytest.fixture
def eager():
    interval, threshold = sys.getswitchinterval(), gc.get_threshold()
    sys.setswitchinterval(1e-6)
    gc.set_threshold(10)
    yield
    sys.setswitchinterval(interval)
    gc.set_threshold(*threshold)


def test_threads_parse_at_the_same_time(eager):
    source = Path(syntax.__file__).read_bytes() * 5

    def parse(_):
        for _ in range(40):
            Slow()
            assert parse_python(source).body

    with ThreadPoolExecutor(8) as pool:
        list(pool.map(parse, range(8)))


def test_an_expression_is_one():
    assert parse_expression("a + 1").lineno == 1
    with pytest.raises(SyntaxError):
        parse_expression("a = 1")


def test_the_product_parses_in_one_place():
    """A lock that one caller does not take guards none of them."""
    files = [path for room in ("orchestrator", "pyfmu_sources") for path in (ROOT / room).rglob("*.py")]
    assert [path.name for path in files if "ast.parse(" in path.read_text(encoding="utf-8")] == ["syntax.py"]
