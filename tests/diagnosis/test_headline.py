"""The verdict in one sentence says no more than was looked for."""

from types import SimpleNamespace
from typing import Any

import pytest

from orchestrator.diagnosis.report.summary import headline


@pytest.mark.parametrize("verdict", ["none", "parameters"])
def test_without_a_search_nothing_is_said_of_effects(verdict: str) -> None:
    found: Any = SimpleNamespace(verdict=verdict, misses_test_data=True, largest_miss=5.93, searched=False, effects=())
    said = headline(found)
    assert "library" not in said
    assert "No effect was looked for" in said
    assert "5.93 times the noise" in said
    found.searched = True
    assert "No effect of the library is likely" in headline(found)


@pytest.mark.parametrize("verdict", ["none", "parameters"])
def test_a_hint_stands_beside_no_claim_that_nothing_is_missing(verdict: str) -> None:
    found: Any = SimpleNamespace(
        verdict=verdict, misses_test_data=False, searched=True, effects=(SimpleNamespace(label="torque_ripple@motor"),)
    )
    said = headline(found)
    assert "explains the record" in said
    assert "hint" in said
    assert "torque ripple at the motor" in said
    assert "Nothing is missing" not in said
