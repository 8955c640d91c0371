"""The size of a backlash, from either side and in either unit."""

import pytest

from orchestrator.shared.play import Play


def test_both_sizes_from_both_sides_in_both_units() -> None:
    found = Play(0.001, 4.0).to_result()
    assert found["half_gap"]["load"] == {"rad": 0.001, "arcmin": pytest.approx(3.4377, rel=1e-4)}
    assert found["half_gap"]["motor"] == {"rad": 0.004, "arcmin": pytest.approx(13.751, rel=1e-4)}
    assert found["total_play"]["load"] == {"rad": 0.002, "arcmin": pytest.approx(6.8755, rel=1e-4)}
    assert found["total_play"]["motor"]["rad"] == 0.008
    assert Play(0.001, 4.0).total == 0.002


def test_a_line_for_people() -> None:
    assert str(Play(0.01, 4.0)) == (
        "half-gap 0.01 rad (34.377 arcmin) at the load and 0.04 rad (2.2918 deg) at the motor; "
        "total play 0.02 rad (1.1459 deg) at the load and 0.08 rad (4.5837 deg) at the motor"
    )
