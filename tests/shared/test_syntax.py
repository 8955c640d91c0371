"""Syntax trees that several threads ask for at once."""

import gc
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from orchestrator.shared import syntax
from orchestrator.shared.syntax import parse_expression, parse_python


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
