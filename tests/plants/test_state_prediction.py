"""The state that is foreseen over requests that are under way."""

import numpy as np
import pytest
from scipy.linalg import expm

from orchestrator.plants.design import DrivetrainValues, five_state_model
from pyfmu_sources.controllers.gap_traversal import move
from pyfmu_sources.controllers.state_prediction import Train, foresee, foresee_late, n_under_way, oldest_share
from pyfmu_sources.estimators.backlash_estimator_slave import BacklashEstimator
from tests.support.played_slave import play

TRAIN = Train(0.4, 5.6, 0.1, 1.0, 3.984, 1.0 / 3300.0, 5e-3)


def test_requests_under_way_are_counted_in_samples():
    assert [n_under_way(d) for d in (0.0, 0.25, 1.0, 1.5, 2.0, 64.0)] == [0, 1, 1, 2, 2, 64]
    assert [oldest_share(d) for d in (0.25, 1.0, 1.5, 2.0)] == pytest.approx([0.25, 1.0, 0.5, 1.0])


def test_in_the_gap_the_twist_moves_as_the_plans_say():
    free = TRAIN._replace(b_m=0.0, b_l=0.0)
    x = (3.984 * 0.29, 2.0, 0.3, 0.1, 0.0, -40.0)
    for u, duration in ((250.0, 3e-3), (-250.0, 5e-3)):
        found = foresee(x, u, duration, 0.02, free)
        way, speed, torque = move((-0.01, 2.0 / 3.984 - 0.1, -40.0), u, duration, 5e-3, 0.4 * 3.984)
        assert found[0] / 3.984 - found[2] == pytest.approx(way, abs=2e-6)
        assert found[1] / 3.984 - found[3] == pytest.approx(speed, abs=2e-4)
        assert found[5] == pytest.approx(torque)


def test_on_a_flank_the_shaft_acts_as_a_spring():
    for side in (-1.0, 1.0):
        model = five_state_model(DrivetrainValues(tau=5e-3, c=0.0))
        block = np.zeros((6, 6))
        block[:5, :5], block[:5, 5:] = model.A, model.B
        x = np.array([3.984 * 0.01 * side, 1.0 * side, 0.0, 0.2 * side, 20.0])
        exact = (expm(4e-3 * block) @ np.append(x, 150.0 * side))[:5]
        shifted = (x[0] + 3.984 * 0.02 * side, x[1], x[2], x[3], 0.0, x[4])
        found = foresee(shifted, 150.0 * side, 4e-3, 0.02, TRAIN)
        assert found[0] - 3.984 * 0.02 * side == pytest.approx(exact[0], abs=3e-4)
        assert found[2] == pytest.approx(exact[2], abs=1e-4)
        assert [found[1], found[3]] == pytest.approx([exact[1], exact[3]], rel=0.02)


@pytest.mark.parametrize("compliance", [0.0, 1e-12, 1e-9])
def test_teeth_of_a_rigid_shaft_meet_without_chatter(compliance):
    rigid = TRAIN._replace(compliance=compliance)
    x = (3.984 * 0.0199, 4.0, 0.0, 0.0, 0.0, 50.0)
    for n in range(20):
        x = foresee(x, 50.0, 1e-3, 0.02, rigid)
        assert x[0] / 3.984 - x[2] < 0.02 + 1e-3
        if n > 3:
            assert x[1] / 3.984 == pytest.approx(x[3], abs=1e-6)
    assert x[3] > 0.1  # the load goes along


def test_what_is_under_way_acts_in_its_order_the_oldest_for_its_rest():
    x = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    by_hand = foresee(foresee(x, 200.0, 0.5e-3, 0.02, TRAIN), -100.0, 1e-3, 0.02, TRAIN)
    assert foresee_late(x, [200.0, -100.0], 1.5, 1e-3, 0.02, TRAIN) == by_hand
    assert foresee_late(x, [], 0.0, 1e-3, 0.02, TRAIN) == x


@pytest.mark.parametrize("delay", [0.0, 0.4, 1.0, 2.5])
def test_the_estimator_lets_requests_act_late(delay):
    """Angles that say nothing leave the torque to the model alone."""
    start = {"tau": 5e-3, "noise_m": 1e6, "noise_l": 1e6, "delay": delay}
    n = np.arange(12)
    u = np.where(n > 3, 100.0, 0.0)  # held since the last sample: the request of sample 3
    played = np.column_stack([u, 0.0 * u, 0.0 * u])
    names = ("u", "theta_m", "theta_l")
    found = play(BacklashEstimator(), start, names, played, ("T_m_hat",), 1e-3)[:, 0]
    acting = np.maximum((n - 3 - delay) * 1e-3, 0.0)
    assert found == pytest.approx(100.0 * (1.0 - np.exp(-acting / 5e-3)), abs=1e-6)
