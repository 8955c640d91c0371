"""What a variable takes of a value: Booleans as a sweep writes them, numbers of items, and what is refused."""

import re

import pytest

from orchestrator.master.protocol import Variable
from orchestrator.master.values import coerce_value

MODE = Variable("mode", "parameter", "Enumeration", items=(("slow", 2), ("fast", 5), ("off", -1)))
ON = Variable("on", "parameter", "Boolean")


@pytest.mark.parametrize(
    ("variable", "value", "taken"),
    [(ON, "true", True), (ON, "false", False), (ON, True, True), (MODE, "fast", 5), (MODE, 2, 2), (MODE, -1.0, -1)],
)
def test_what_is_taken(variable: Variable, value: object, taken: object) -> None:
    assert coerce_value(variable, value) == (taken, None)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("variable", "value", "said"),
    [
        (ON, 2.0, "must be true or false, but is 2.0"),
        (ON, "yes", "must be true or false, but is 'yes'"),
        (MODE, 3, r"must be the number of an item, slow \(2\), fast \(5\), off \(-1\), but is 3"),
        (MODE, 2.5, "must be the number of an item"),
        (MODE, "fats", "did you mean 'fast'"),
    ],
)
def test_what_is_refused(variable: Variable, value: object, said: str) -> None:
    taken, text = coerce_value(variable, value)  # type: ignore[arg-type]
    assert taken is None
    assert text is not None
    assert re.search(said, text)
