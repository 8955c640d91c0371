"""The plant against solutions that share no code with it, and at its edges."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pyfmu_sources.drivetrain import drivetrain, linear_mode
from pyfmu_sources.drivetrain.equations import NAMES, parameters
from pyfmu_sources.laws.backlash_models import BACKLASH_MODELS
from pyfmu_sources.laws.parameter_rows import with_values
from tests.support.compiled_plants import compiled_plant
from tests.support.reference_plant import ReferencePlant
from tests.support.reference_runs import linear_solution, reference_solution

H = 1e-3
SIZES = (0.002, 0.02, 0.1)
ZERO = (0.0,) * 12


def simulate(p, torques, h=H, start=ZERO, source=None, T_l=0.0):
    """States (n + 1, 8) and contacts (n + 1,) of the plant, from the plain functions unless ``source`` is given."""
    module = source or drivetrain
    x = module.consistent_start(start, p)
    mode = module.initial_mode(x, p)
    table = module.prepare(p, h)
    states, contacts = [x], [mode[0]]
    for u in torques:
        x, mode = module.advance(x, mode, p, float(u), T_l, h, table)
        states.append(x)
        contacts.append(mode[0])
    return np.array(states), np.array(contacts)


def random_torque(seed, steps=2000, hold=10, size=300.0):
    rng = np.random.default_rng(seed)
    return np.repeat(rng.uniform(-size, size, steps // hold), hold)


@pytest.mark.parametrize("alpha", SIZES)
@pytest.mark.parametrize("model", ["dead_zone", "nordin"])
def test_matches_the_event_located_reference(model, alpha):
    torque = random_torque(seed=11) + np.repeat(300.0 * np.sin(0.1 * np.arange(200)), 10)
    p = parameters(alpha=alpha, backlash_model=float(BACKLASH_MODELS.index(model)))
    states, contacts = simulate(p, torque)
    truth = reference_solution(ReferencePlant(alpha=alpha, model=model), torque[::10], 10 * H)
    assert len(np.unique(contacts)) == 3
    assert np.abs(states[::10, [0, 2]] - truth[:, [0, 2]]).max() < 1e-9


def test_without_gap_it_is_the_matrix_exponential():
    torque = random_torque(seed=12)
    truth = linear_solution(ReferencePlant(), torque, H, np.zeros(5))
    states, _ = simulate(parameters(), torque)
    assert np.abs(states[:, :5] - truth).max() / np.abs(truth).max() < 1e-12


def test_models_without_gap_agree():
    torque = random_torque(seed=13)
    plain, _ = simulate(parameters(backlash_model=0.0, alpha=0.3), torque)
    for model in ("dead_zone", "nordin"):
        same, _ = simulate(parameters(backlash_model=float(BACKLASH_MODELS.index(model)), alpha=0.0), torque)
        assert np.array_equal(same, plain)


EFFECTS = {
    "effects.coulomb_friction.motor.torque": 0.6,
    "effects.coulomb_friction.load.torque": 2.0,
    "effects.stribeck_friction.motor.coulomb": 0.3,
    "effects.stribeck_friction.motor.breakaway": 0.9,
    "effects.torque_ripple.amplitude": 0.5,
    "effects.gravity_load.amplitude": 3.0,
    "effects.hardening_stiffness.cubic": 1e5,
    "effects.gear_eccentricity.amplitude": 5e-4,
    "effects.extra_resonance.inertia": 0.8,
    "effects.quadratic_drag.coefficient": 0.3,
    "effects.load_torque.torque": 0.6,
}


@pytest.mark.parametrize("model", BACKLASH_MODELS)
def test_compiled_and_plain_source_agree(model):
    torque = random_torque(seed=14, steps=400)
    p = parameters(alpha=0.01, backlash_model=float(BACKLASH_MODELS.index(model)))
    plain, _ = simulate(p, torque)
    fast, _ = simulate(p, torque, source=compiled_plant("drivetrain"))
    assert np.abs(plain - fast).max() <= 1e-12


def test_compiled_and_plain_source_agree_with_every_effect():
    torque = random_torque(seed=15, steps=300)
    p = with_values(parameters(alpha=0.01), EFFECTS)
    plain, _ = simulate(p, torque)
    fast, _ = simulate(p, torque, source=compiled_plant("drivetrain"))
    assert np.abs(plain - fast).max() <= 1e-12


def test_the_result_does_not_depend_on_the_communication_step():
    torque = random_torque(seed=16, steps=2000, hold=100)
    for values in ({}, EFFECTS):
        p = with_values(parameters(alpha=0.01, backlash_model=2.0), values)
        fine, _ = simulate(p, torque, source=compiled_plant("drivetrain"))
        coarse, _ = simulate(p, torque[::50], h=50 * H, source=compiled_plant("drivetrain"))
        assert np.abs(fine[::50, :4] - coarse[:, :4]).max() < 1e-8


def test_zero_damping_keeps_the_energy():
    p = parameters(c=0.0, b_m=0.0, b_l=0.0, tau=1e9, alpha=0.01)
    start = (0.5, 3.0, 0.0, -2.0, 0.0, 0.0, 0.0, 0.0)
    states, contacts = simulate(p, np.zeros(5000), start=start)
    twist = states[:, 0] / 3.984 - states[:, 2]
    wound = np.where(np.abs(twist) > 0.01, np.abs(twist) - 0.01, 0.0)
    energy = 0.5 * (0.4 * states[:, 1] ** 2 + 5.6 * states[:, 3] ** 2 + 3300.0 * wound**2)
    assert set(np.unique(contacts)) == {-1, 0, 1}
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-11


def test_conservative_effects_keep_the_energy():
    p = with_values(
        parameters(c=0.0, b_m=0.0, b_l=0.0, tau=1e9),
        {
            "effects.gravity_load.amplitude": 30.0,
            "effects.gravity_load.phase": 0.4,
            "effects.hardening_stiffness.cubic": 1e6,
            "effects.hardening_stiffness.sharpness": 1.2,
            "effects.extra_resonance.inertia": 0.8,
            "effects.extra_resonance.damping_ratio": 0.0,
            "effects.torque_ripple.amplitude": 5.0,
            "effects.torque_ripple.cycles_per_rev": 7.0,
            "effects.torque_ripple.phase": -0.6,
            "effects.gear_eccentricity.amplitude": 1e-3,
            "effects.gear_eccentricity.cycles_per_rev": 2.0,
            "effects.gear_eccentricity.phase": 0.9,
        },
    )
    start = (0.3, 3.0, 0.0, -2.0, 0.0, 0.0, 0.0, 0.0)
    states, _ = simulate(p, np.zeros(1000), start=start, source=compiled_plant("drivetrain"))
    theta_m, omega_m, theta_l, omega_l, _, theta_r, omega_r = states[:, :7].T
    twist = theta_m / 3.984 - theta_l + 1e-3 * np.sin(2.0 * theta_m + 0.9)
    energy = 0.2 * omega_m**2 + 2.8 * omega_l**2 + 0.4 * omega_r**2 + 1650.0 * twist**2 + 0.25e6 * twist**4
    energy += 1.2e12 / 3300.0 / 6.0 * twist**6
    energy += -30.0 * np.cos(theta_l + 0.4) + 5.0 / 7.0 * np.cos(7.0 * theta_m - 0.6)
    energy += 0.4 * 60.0**2 * (theta_l - theta_r) ** 2
    assert np.abs(energy - energy[0]).max() < 1e-8


def free_motor(**effects):
    """A motor alone: no shaft, no drive."""
    return with_values(parameters(k=0.0, c=0.0, tau=1e9), effects)


def test_dry_friction_stops_a_motor_when_theory_says_and_holds_it():
    p = free_motor(**{"effects.coulomb_friction.motor.torque": 0.6})
    states, _ = simulate(p, np.zeros(3000), start=(0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    time = H * np.arange(3001)
    exact = (2.0 + 6.0) * np.exp(-0.25 * time) - 6.0
    stop = math.log(8.0 / 6.0) / 0.25
    moving = time < stop
    assert np.abs(states[moving, 1] - exact[moving]).max() < 1e-9
    assert np.all(states[~moving, 1] == 0.0)
    rest = 8.0 / 0.25 * (1.0 - math.exp(-0.25 * stop)) - 6.0 * stop
    assert states[-1, 0] == pytest.approx(rest, abs=1e-9)


def test_a_standing_motor_breaks_away_at_its_breakaway_torque():
    p = with_values(
        parameters(k=0.0, c=0.0, tau=1.0),
        {
            "effects.stribeck_friction.motor.coulomb": 0.6,
            "effects.stribeck_friction.motor.breakaway": 1.1,
            "effects.stribeck_friction.motor.stribeck_speed": 0.6,
        },
    )
    states, _ = simulate(p, np.full(2000, 2.0))
    time = H * np.arange(2001)
    breaks = -math.log(1.0 - 1.1 / 2.0)
    assert np.all(states[time <= breaks, 1] == 0.0)
    assert np.all(states[time > breaks + 2 * H, 1] > 0.0)


def test_quadratic_drag_slows_a_load_as_theory_says():
    p = with_values(parameters(k=0.0, c=0.0, b_l=0.0), {"effects.quadratic_drag.coefficient": 0.3})
    states, _ = simulate(p, np.zeros(2000), start=(0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0))
    exact = 4.0 / (1.0 + 4.0 * 0.3 / 5.6 * H * np.arange(2001))
    assert np.abs(states[:, 3] - exact).max() < 1e-10


def test_rigid_impact_keeps_momentum_and_reverses_the_relative_speed():
    p = parameters(b_m=0.0, b_l=0.0, tau=1e9, alpha=0.01, backlash_model=4.0, restitution=0.4)
    states, _ = simulate(p, np.zeros(20), start=(0.0, 3.984, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    relative = states[:, 1] / 3.984 - states[:, 3]
    momentum = 0.4 * 3.984 * states[:, 1] + 5.6 * states[:, 3]
    assert np.abs(momentum / momentum[0] - 1.0).max() < 1e-13
    assert relative[5] == pytest.approx(1.0, abs=1e-12)
    assert relative[15] == pytest.approx(-0.4, abs=1e-12)


def test_play_model_follows_at_the_flanks_and_stands_still_between():
    p = parameters(alpha=0.02, backlash_model=3.0)
    torque = 40.0 * np.sin(2.0 * np.pi * 0.5 * H * np.arange(4000))
    states, contacts = simulate(p, torque)
    twist = states[:, 0] / 3.984 - states[:, 2]
    inside = contacts == 0
    assert inside.any()
    assert (contacts == 1).any()
    assert np.all(states[inside, 3] == 0.0)
    assert np.abs(np.abs(twist[~inside]) - 0.02).max() < 1e-12
    assert np.abs(twist).max() < 0.02 + 1e-12


def test_teeth_never_pull_in_nordins_model():
    p = parameters(alpha=0.02, backlash_model=2.0)
    x, mode = ZERO, drivetrain.initial_mode(ZERO, p)
    table = drivetrain.prepare(p, H)
    for u in random_torque(seed=17, steps=3000):
        x, mode = drivetrain.advance(x, mode, p, float(u), 0.0, H, table)
        assert mode[0] * drivetrain.shaft_torque(x, mode, p, 0.0) >= -1e-9


def test_a_load_torque_presses_the_teeth_together_at_rest():
    for model in BACKLASH_MODELS[1:]:
        p = parameters(alpha=0.01, backlash_model=float(BACKLASH_MODELS.index(model)), b_m=5.0, b_l=50.0)
        states, contacts = simulate(p, np.full(20000, 20.0 / 3.984), T_l=20.0, source=compiled_plant("drivetrain"))
        assert contacts[-1] in (1, 2)
        assert abs(states[-1, 3]) < 1e-3


@settings(max_examples=60)
@given(
    model=st.integers(0, 5),
    alpha=st.sampled_from([0.0, 1e-15, 1e-9, 1e-3, 0.1, 10.0, 1e6]),
    c=st.sampled_from([0.0, 1e-12, 1.0, 100.0]),
    k=st.sampled_from([0.0, 1.0, 3300.0, 1e6]),
    h=st.sampled_from([1e-6, 1e-3, 0.05]),
    twist=st.floats(-0.5, 0.5),
    speed=st.floats(-20.0, 20.0),
    seed=st.integers(0, 1000),
)
def test_extreme_values_give_finite_states(model, alpha, c, k, h, twist, speed, seed):
    p = parameters(alpha=alpha, backlash_model=float(model), c=c, k=k)
    torque = random_torque(seed, steps=40, hold=4)
    start = (3.984 * twist, speed, 0.0, -speed, 0.0, 0.0, 0.0, 0.0)
    states, contacts = simulate(p, torque, h=h, start=start, source=compiled_plant("drivetrain"))
    assert np.isfinite(states).all()
    assert np.isin(contacts, (-2, -1, 0, 1, 2)).all()
    assert np.abs(states[:, 1]).max() < 1e5


def test_unknown_parameter_names_are_refused():
    with pytest.raises(KeyError, match="stiffness"):
        parameters(stiffness=1.0)
    assert len(set(NAMES)) == len(NAMES)


def test_the_search_for_events_steps_over_no_root():
    rng = np.random.default_rng(5)
    times = np.linspace(0.0, 1.0, 5001)
    found = 0
    for _ in range(500):
        series = rng.normal(size=linear_mode.TERMS + 1)
        series[0] = 0.03 * abs(series[0]) + 1e-6
        negative = np.nonzero(np.polynomial.polynomial.polyval(times, series) < 0.0)[0]
        root = linear_mode.first_root(series.tolist(), 1.0, 1e-13)
        if len(negative):
            assert root <= times[negative[0]]
            assert abs(np.polynomial.polynomial.polyval(root, series)) < 1e-12
            found += 1
    assert found > 300
