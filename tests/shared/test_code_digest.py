"""The digest of a compiled function: the same for the same content, another for whatever changes the machine code."""

import math
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import njit

from orchestrator.shared.code_digest import digest_of

FAR_BELOW = "def inner(x):\n    return {far} * math.sin(x)\n"
OUTER = """
def make(table):
    called = njit({options})(inner)
    def outer(x):
        return called(x) + SCALE * table[0] + {own}
    return outer
"""


def made(far: str = "2.0", own: str = "1.0", scale: float = 3.0, table: Any = (1.0, 2.0), options: str = "") -> str:
    """The digest of a function that reaches a constant, a closure, a global and another compiled function."""
    space: dict[str, Any] = {"math": math, "njit": njit, "SCALE": scale}
    exec(FAR_BELOW.format(far=far) + OUTER.format(own=own, options=options), space)
    digest = digest_of(space["make"](table))
    assert digest is not None
    return digest


def test_the_same_content_has_the_same_digest() -> None:
    assert made() == made()


@pytest.mark.parametrize(
    "change",
    [
        {"far": "2.5"}, {"own": "1.5"}, {"scale": 3.5}, {"scale": 3}, {"table": (1.5, 2.0)}, {"table": (1.0, 2.0, 3.0)},
        {"table": np.array([1.0, 2.0])}, {"options": "fastmath=True"},
    ],
    ids=str,
)  # fmt: skip
def test_whatever_changes_the_machine_code_changes_the_digest(change: dict[str, Any]) -> None:
    assert made(**change) != made()


def test_a_named_tuple_is_known_by_its_fields() -> None:
    def digest(*fields: str) -> str | None:
        kind = NamedTuple("Kind", [(name, float) for name in fields])
        return digest_of(lambda x: kind(x, x))

    assert digest("a", "b") == digest("a", "b") is not None
    assert digest("a", "b") != digest("b", "a")


def test_options_of_the_function_itself_change_its_digest() -> None:
    def twice(x: float) -> float:
        return 2.0 * x

    digests = {digest_of(njit(**options)(twice)) for options in ({}, {"fastmath": True}, {"error_model": "numpy"})}
    assert len(digests) == 3
    assert None not in digests


def test_arrays_count_by_their_content() -> None:
    assert made(table=np.array([1.0, 2.0])) == made(table=np.array([1.0, 2.0]))
    assert made(table=np.array([1.0, 2.0])) != made(table=np.array([1.0, 2.1]))


def test_functions_that_call_each_other_end() -> None:
    space: dict[str, Any] = {}
    exec("def even(n):\n    return n == 0 or odd(n - 1)\ndef odd(n):\n    return n != 0 and even(n - 1)\n", space)
    assert digest_of(space["even"]) != digest_of(space["odd"])


def test_what_is_not_known_to_stay_has_no_digest() -> None:
    space: dict[str, Any] = {"thing": object()}
    exec("def uses(x):\n    return x + thing.size\n", space)
    function = space["uses"]
    assert isinstance(function, FunctionType)
    assert digest_of(function) is None
