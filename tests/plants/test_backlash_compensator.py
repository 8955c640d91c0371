"""The law of the compensator, sample by sample."""

import numpy as np
import pytest
from control import c2d, ss

from orchestrator.plants.design import DrivetrainValues, six_state_model
from pyfmu_sources.controllers.backlash_compensator import (
    CROSS,
    HOLD,
    PLAIN,
    CrossingState,
    Gap,
    Train,
    Tuning,
    WantedMotion,
    act,
    crossing_time,
    derive_reference,
    hold,
    lead_after,
    start_state,
)
from pyfmu_sources.controllers.gap_traversal import Traversal, go_on, plan
from pyfmu_sources.controllers.lqr import control

GAINS = (-124.680427, 127.392214, 725.091101, 3.38145167, 1.72123183)
TRAIN = Train(0.4, 5.6, 0.1, 1.0, 3.984, 1.0 / 3300.0, 5e-3)
TUNING = Tuning(0.1, 0.85, 300.0, 3e-4, 1e-3)
NO_PLAN = Traversal(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def standing(phase, flank, lead, samples=0, traversal=NO_PLAN):
    """A state under a reference that stands still."""
    return CrossingState(phase, flank, samples, lead, 0.0, 0.0, traversal, 0.0)


def draw_estimate(rng, way=None):
    """A state near a flank; ``way`` [rad] sets the twist."""
    theta_l = rng.uniform(-1.0, 1.0)
    twist = rng.uniform(-0.03, 0.03) if way is None else way
    return (3.984 * (theta_l + twist), rng.normal(), theta_l, 0.2 * rng.normal(), rng.normal(), rng.normal())


@pytest.mark.parametrize("gap", [Gap(0.0, 0.0), Gap(0.02, 0.006), Gap(0.02, 1.0), Gap(-0.02, -1.0)])
def test_without_a_known_gap_it_is_the_plain_lqr(gap):
    rng = np.random.default_rng(1)
    state = standing(HOLD, 1, 0.0)
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
        state, u = act(start_state(x, 0.0, 3.984), reference, 0.0, x, Gap(0.02, 1e-4), GAINS, TRAIN, TUNING)
        assert (state.phase, state.flank) == (HOLD, flank)
        assert u == control(reference, 0.0, shifted, GAINS, 3.984, 1.0 / 3300.0, 300.0)


def test_it_pushes_or_plans_where_the_teeth_have_parted():
    """A torque away from the flank that is held, without contact, would only open the gap."""
    rng = np.random.default_rng(3)
    planned = 0
    for _ in range(300):
        flank = rng.choice([-1, 1])
        x = draw_estimate(rng, way=flank * rng.uniform(0.001, 0.015))
        gap = Gap(0.02, 1e-4)
        state, u = act(standing(HOLD, int(flank), 0.0), x[2] + 0.1 * flank, 0.0, x, gap, GAINS, TRAIN, TUNING)
        assert state.phase == CROSS or u * state.flank >= 0.0
        planned += state.phase == CROSS
    assert 20 < planned < 280


def test_a_flank_that_is_lost_beyond_mid_gap_is_approached_anew():
    for way, phase in ((0.01, HOLD), (-0.001, CROSS)):
        x = (3.984 * way, 0.0, 0.0, 0.0, 0.0, 0.0)
        state, _ = act(standing(HOLD, 1, 0.0), 0.1, 0.0, x, Gap(0.02, 1e-4), GAINS, TRAIN, TUNING)
        assert (state.phase, state.flank) == (phase, 1)


def test_teeth_that_may_not_touch_yet_are_approached_further():
    """Until the aim is at the upper end of the interval: the torque of the LQR would slam them."""
    for aim, phase in ((0.0230, CROSS), (0.0245, HOLD)):
        x = (3.984 * 0.0205, 0.4, 0.0, 0.0, 0.0, 0.0)
        state = standing(CROSS, 1, 0.0, 1, go_on(aim - 1e-4, 0.1, 255.0))
        state, u = act(state, 0.5, 0.0, x, Gap(0.02, 2e-3), GAINS, TRAIN, TUNING)
        assert (state.phase, state.flank) == (phase, 1)
        assert abs(u) < 20.0 or phase == HOLD


def test_a_flank_in_front_of_the_interval_makes_it_the_plain_lqr_until_the_teeth_part():
    """A half-gap that is told too wide would push on and on: the load ran away."""
    x = (3.984 * 0.010, 0.0, 0.0, 0.0, 0.0, 0.0)
    state = standing(CROSS, 1, 0.0, 1, go_on(0.026, 0.1, 255.0))
    for way, phase in ((0.010, PLAIN), (0.012, PLAIN), (-0.001, CROSS), (0.012, CROSS)):
        x = (3.984 * way, 0.0, 0.0, 0.0, 0.0, 0.0)
        state, u = act(state, 0.1, 0.0, x, Gap(0.02, 1e-4), GAINS, TRAIN, TUNING)
        assert state.phase == phase
        if phase == PLAIN:
            assert u == control(0.1, 0.0, x, GAINS, 3.984, 1.0 / 3300.0, 300.0)


def test_a_flank_within_the_interval_is_held():
    x = (3.984 * 0.015, 0.0, 0.0, 0.0, 0.0, 0.0)
    state = standing(CROSS, 1, 0.0, 1, go_on(0.031, 0.1, 255.0))
    state, _ = act(state, 0.1, 0.0, x, Gap(0.02, 3e-3), GAINS, TRAIN, TUNING)
    assert state.phase == HOLD


def test_the_way_behind_a_plan_goes_on_at_the_speed_that_is_wanted_now():
    """A crossing that began for a small error, at a fifth of the speed, does not stay so slow."""
    x = (3.984 * 0.0150, 0.0, 0.0, 0.0, 0.0, 0.0)
    state = standing(CROSS, 1, 0.0, 1, go_on(0.0150, 0.019, 255.0))
    state, _ = act(state, 0.5, 0.0, x, Gap(0.02, 2e-3), GAINS, TRAIN, TUNING)
    assert (state.traversal.way, state.traversal.end_speed) == pytest.approx((0.015019, 0.095))


def test_too_quick_for_a_plan_it_brakes_and_does_not_turn_round():
    """Only the speed is to be had: a way at which to be would pull it back through the gap."""
    state = standing(CROSS, 1, 0.0)
    for n, speed in enumerate((3.0, 2.7, 2.4, 0.1)):
        x = (3.984 * (0.012 + 0.001 * n), 3.984 * speed, 0.0, 0.0, 0.0, 0.0)
        state, u = act(state, 0.5, 0.0, x, Gap(0.02, 1e-4), GAINS, TRAIN, TUNING)
        assert state.phase == CROSS
        assert u == -300.0 if speed > 1.0 else state.traversal.third > 0.0


@pytest.mark.parametrize("share", [0.95, 1.0, 1.05], ids="motor {:g}".format)
@pytest.mark.parametrize("tau", [5e-4, 1e-3, 5e-3, 1.0], ids="drive {:g}".format)
def test_a_drive_as_quick_as_the_samples_lands_softly_too(tau, share):
    apart = six_state_model(DrivetrainValues(tau=tau, J_m=0.4 * share, k=0.0, c=0.0))
    sampled = c2d(ss(*apart, 0), 5e-5)
    A, B = sampled.A, sampled.B
    x = np.array([-0.02 * 3.984, 0.0, 0.0, 0.0, 0.0, 0.0])
    state = start_state(tuple(x), 0.0, 3.984)
    train = TRAIN._replace(tau=tau)
    samples = 0
    while x[0] / 3.984 - x[2] < 0.02:
        if samples % 20 == 0:
            state, u = act(state, 0.25, 0.0, tuple(x), Gap(0.02, 1e-4), GAINS, train, TUNING)
        x = A @ x + B[:, 0] * u
        samples += 1
        assert samples < 10_000
    assert x[1] / 3.984 - x[3] < 2.5 * TUNING.impact_speed
    assert samples * 5e-5 < 1.5 * crossing_time(0.02, train, TUNING)


def test_a_crossing_begins_only_if_the_load_would_be_ahead_when_left_alone():
    for load_torque, phase in ((0.0, CROSS), (2000.0, HOLD)):
        x = (3.984 * 0.021, 0.0, 0.0, 0.0, load_torque, load_torque / 3.984)
        state, _ = act(standing(HOLD, 1, 0.05), -0.05, 0.0, x, Gap(0.02, 1e-4), GAINS, TRAIN, TUNING)
        assert state.phase == phase


def test_a_crossing_turns_back_only_while_it_speeds_up():
    going = plan((-0.02, 0.0, 0.0), 0.019, 0.1, 255.0, TRAIN.tau, TRAIN.J_m * TRAIN.i)
    for samples, flank in ((5, -1), (round(going.first / 1e-3) - 1, 1), (25, 1)):
        x = (3.984 * (0.5 - 0.01), 0.0, 0.5, 0.0, 0.0, 0.0)
        state = standing(CROSS, 1, 0.5, samples, going)
        state, _ = act(state, 0.0, 0.0, x, Gap(0.02, 1e-4), GAINS, TRAIN, TUNING)
        assert (state.phase, state.flank) == (CROSS, flank)


def test_on_the_motion_that_is_asked_for_the_request_is_what_this_motion_needs():
    """Shaft wound by what the load needs, motor torque for both, and its change through the drive's lag."""
    r = WantedMotion(0.4, 0.7, 3.0, -20.0)
    shaft = 5.0 + 5.6 * 3.0 + 1.0 * 0.7
    torque = 3.984 * (0.4 * 3.0 + 0.1 * 0.7) + shaft / 3.984
    change = 3.984 * (0.4 * -20.0 + 0.1 * 3.0) + (5.6 * -20.0 + 1.0 * 3.0) / 3.984
    for tau in (5e-3, 1.0):
        x = (3.984 * (0.4 + shaft / 3300.0), 3.984 * 0.7, 0.4, 0.7, 5.0, torque)
        assert hold(r, x, GAINS, TRAIN._replace(tau=tau), TUNING) == pytest.approx(torque + tau * change)


def test_acceleration_and_jerk_follow_from_the_speed():
    once = twice = 0.0
    lag, step = 0.01, 1e-4
    for n in range(5000):
        speed = 2.0 * n * step + 1.5 * (n * step) ** 2
        once += step / (step + lag) * (speed - once)
        twice += step / (step + lag) * (once - twice)
    found = derive_reference(0.0, speed, once, twice, lag)
    assert found.jerk == pytest.approx(3.0, rel=0.01)
    assert found.acceleration == pytest.approx(2.0 + 3.0 * n * step, rel=0.01)


def test_the_lead_is_that_of_a_load_on_its_own():
    r = WantedMotion(0.1, 0.2, 0.3, 0.4)
    x = (0.0, 0.0, 0.15, 0.5, 2.8, 0.0)
    alone = 0.15 + 0.5 * 0.2 - 0.5 * 0.2**2 * (1.0 * 0.5 + 2.8) / 5.6
    asked = 0.1 + 0.2 * 0.2 + 0.3 * 0.2**2 / 2.0 + 0.4 * 0.2**3 / 6.0
    assert lead_after(0.2, r, x, TRAIN) == pytest.approx(alone - asked)


@pytest.mark.parametrize("tau", [1e-3, 5e-3, 0.05, 0.3, 1.0])
@pytest.mark.parametrize("alpha", [2e-3, 0.02, 0.1])
def test_the_rough_time_of_a_crossing_is_near_that_of_its_plan(alpha, tau):
    train = TRAIN._replace(tau=tau)
    t = plan((-alpha, 0.0, 0.0), alpha, 1e-3, 0.85 * 300.0, tau, 0.4 * 3.984)
    assert crossing_time(alpha, train, TUNING) == pytest.approx(t.first + t.second + t.third, rel=0.12)


def test_the_end_of_a_plan_leaves_two_deviations_to_the_flank():
    x = (-3.984 * 0.0205, 0.0, 0.0, 0.0, 0.0, 0.0)
    for deviation in (0.0, 1e-4, 1e-3):
        state, _ = act(standing(HOLD, -1, -1.0), 1.0, 0.0, x, Gap(0.02, deviation), GAINS, TRAIN, TUNING)
        assert (state.phase, state.flank) == (CROSS, 1)
        assert state.traversal.end_way == pytest.approx(0.02 - 2.0 * deviation - 3e-4)
        assert state.traversal.end_speed == pytest.approx(0.095)


def test_without_torque_for_plans_it_is_the_shifted_lqr_on_the_wanted_flank():
    rng = np.random.default_rng(4)
    tuning = TUNING._replace(torque_share=0.0)
    flanks = set()
    for _ in range(200):
        x, reference = draw_estimate(rng), rng.uniform(-1.0, 1.0)
        state, u = act(standing(HOLD, 1, 0.0), reference, 0.0, x, Gap(0.02, 1e-4), GAINS, TRAIN, tuning)
        shifted = (x[0] - state.flank * 3.984 * 0.02, *x[1:])
        assert u == control(reference, 0.0, shifted, GAINS, 3.984, 1.0 / 3300.0, 300.0)
        flanks.add(state.flank)
    assert flanks == {-1, 1}


def test_at_the_reference_it_stays_on_its_flank_while_at_rest():
    """A landing shoves the load: what its speed asks for is no reason to cross."""
    for error, speed, phase in ((2e-4, 0.0, HOLD), (2e-3, 0.0, CROSS), (2e-4, 0.1, CROSS)):
        x = (3.984 * 0.0205, 0.0, 0.0, 0.05, 0.0, 0.0)
        state = standing(HOLD, 1, 0.01)
        state, _ = act(state, -error, -speed, x, Gap(0.02, 1e-4), GAINS, TRAIN, TUNING)
        assert state.phase == phase
