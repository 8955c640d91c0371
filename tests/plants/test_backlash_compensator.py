"""The law of the compensator, sample by sample."""

import numpy as np
import pytest

from pyfmu_sources.backlash_compensator import CROSS, HOLD, CrossingState, Gap, Train, Tuning, act, start_state
from pyfmu_sources.gap_traversal import Traversal
from pyfmu_sources.lqr import control

GAINS = (-124.680427, 127.392214, 725.091101, 3.38145167, 1.72123183)
TRAIN = Train(0.4, 5.6, 0.1, 1.0, 3.984, 1.0 / 3300.0, 5e-3)
TUNING = Tuning(0.1, 0.85, 300.0, 2.0, 3e-4, 1e-3)
NO_PLAN = Traversal(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def draw_estimate(rng, way=None):
    """A state near a flank; ``way`` [rad] sets the twist."""
    theta_l = rng.uniform(-1.0, 1.0)
    twist = rng.uniform(-0.03, 0.03) if way is None else way
    return (3.984 * (theta_l + twist), rng.normal(), theta_l, 0.2 * rng.normal(), rng.normal(), rng.normal())


@pytest.mark.parametrize("gap", [Gap(0.0, 0.0), Gap(0.02, 0.006), Gap(0.02, 1.0)])
def test_without_a_known_gap_it_is_the_plain_lqr(gap):
    rng = np.random.default_rng(1)
    state = CrossingState(HOLD, 1, 0, 0.0, NO_PLAN)
    for _ in range(200):
        x, reference = draw_estimate(rng), rng.uniform(-1.0, 1.0)
        state, u = act(state, reference, 0.0, x, gap, GAINS, TRAIN, TUNING)
        assert u == control(reference, 0.0, x, GAINS, 3.984, 1.0 / 3300.0, 300.0)


def test_it_holds_with_the_lqr_of_the_motor_less_the_half_gap():
    rng = np.random.default_rng(2)
    for flank in (-1, 1):
        x = (3.984 * (0.3 + 0.021 * flank), 0.0, 0.3, 0.0, rng.normal(), rng.normal())
        reference = 0.3 + 0.1 * flank
        shifted = (x[0] - flank * 3.984 * 0.02, *x[1:])
        state, u = act(start_state(x, 3.984), reference, 0.0, x, Gap(0.02, 1e-4), GAINS, TRAIN, TUNING)
        assert (state.phase, state.flank) == (HOLD, flank)
        assert u == control(reference, 0.0, shifted, GAINS, 3.984, 1.0 / 3300.0, 300.0)


def test_it_pushes_or_plans_where_the_teeth_have_parted():
    """A torque away from the flank that is held, without contact, would only open the gap."""
    rng = np.random.default_rng(3)
    planned = 0
    for _ in range(300):
        x, flank = draw_estimate(rng, way=rng.uniform(-0.015, 0.015)), rng.choice([-1, 1])
        gap = Gap(0.02, 1e-4)
        state, u = act(
            CrossingState(HOLD, int(flank), 0, 0.0, NO_PLAN), x[2] + 0.1 * flank, 0.0, x, gap, GAINS, TRAIN, TUNING
        )
        assert state.phase == CROSS or u * state.flank >= 0.0
        planned += state.phase == CROSS
    assert 20 < planned < 280


def test_a_crossing_begins_only_if_the_torque_is_still_wanted_at_its_end():
    """The load falls back towards the reference by itself: what is wanted now is not wanted after the crossing."""
    for load_torque, phase in ((0.0, CROSS), (2000.0, HOLD)):
        x = (3.984 * 0.021, 0.0, 0.0, 0.0, load_torque, load_torque / 3.984)
        state, _ = act(CrossingState(HOLD, 1, 0, -400.0, NO_PLAN), -0.05, 0.0, x, Gap(0.02, 1e-4), GAINS, TRAIN, TUNING)
        assert state.phase == phase


def test_the_end_of_a_plan_leaves_two_deviations_to_the_flank():
    x = (-3.984 * 0.0205, 0.0, 0.0, 0.0, 0.0, 0.0)
    for deviation in (0.0, 1e-4, 1e-3):
        state, _ = act(
            CrossingState(HOLD, -1, 0, 50.0, NO_PLAN), 1.0, 0.0, x, Gap(0.02, deviation), GAINS, TRAIN, TUNING
        )
        assert (state.phase, state.flank) == (CROSS, 1)
        assert state.traversal.end_way == pytest.approx(0.02 - 2.0 * deviation - 3e-4)
        assert state.traversal.end_speed == 0.1


def test_without_torque_for_plans_it_is_the_shifted_lqr_on_the_wanted_flank():
    rng = np.random.default_rng(4)
    tuning = TUNING._replace(torque_share=0.0)
    flanks = set()
    for _ in range(200):
        x, reference = draw_estimate(rng), rng.uniform(-1.0, 1.0)
        state, u = act(
            CrossingState(HOLD, 1, 0, 0.0, NO_PLAN), reference, 0.0, x, Gap(0.02, 1e-4), GAINS, TRAIN, tuning
        )
        shifted = (x[0] - state.flank * 3.984 * 0.02, *x[1:])
        assert u == control(reference, 0.0, shifted, GAINS, 3.984, 1.0 / 3300.0, 300.0)
        flanks.add(state.flank)
    assert flanks == {-1, 1}


def test_at_the_reference_it_stays_on_its_flank_while_at_rest():
    """A landing shoves the load: what its speed asks for is no reason to cross."""
    for error, speed, phase in ((2e-4, 0.0, HOLD), (2e-3, 0.0, CROSS), (2e-4, 0.1, CROSS)):
        x = (3.984 * 0.0205, 0.0, 0.0, 0.05, 0.0, 0.0)
        state = CrossingState(HOLD, 1, 0, -30.0, NO_PLAN)
        state, _ = act(state, -error, -speed, x, Gap(0.02, 1e-4), GAINS, TRAIN, TUNING)
        assert state.phase == phase
