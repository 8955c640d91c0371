"""Single steps of the plant that are hard: rigid teeth with effects, friction at the flanks, extreme parameters."""

import math
import time

import numpy as np
import pytest

from pyfmu_sources.axis import axis_equations
from pyfmu_sources.drivetrain import drivetrain, smooth_mode
from pyfmu_sources.drivetrain.equations import parameters
from pyfmu_sources.laws.backlash_models import BACKLASH_MODELS
from pyfmu_sources.laws.parameter_rows import with_values
from tests.support.compiled_plants import compiled_plant

RIGID = ("hysteresis", "rigid_impact")
RIPPLE = {"effects.torque_ripple.amplitude": 2.0, "effects.torque_ripple.cycles_per_rev": 7.0}
ECCENTRIC = {"effects.gear_eccentricity.amplitude": 1e-3, "effects.gear_eccentricity.cycles_per_rev": 1.3}
HARD = {"effects.hardening_stiffness.cubic": 5e6}
DRY_M = {"effects.coulomb_friction.motor.torque": 2.0}
DRY_L = {"effects.coulomb_friction.load.torque": 5.0}


def gear_train(model: str, effects: dict[str, float], **values: float) -> tuple[float, ...]:
    return with_values(parameters(alpha=2e-3, backlash_model=float(BACKLASH_MODELS.index(model)), **values), effects)


def run(p, torques, h, start=(0.0,) * 8, T_l=0.0, source=drivetrain):
    x = source.consistent_start(start, p)
    mode, table = source.initial_mode(x, p), source.prepare(p, h)
    states, modes = [x], [mode]
    for u in torques:
        x, mode = source.advance(x, mode, p, float(u), T_l, h, table)
        states.append(x)
        modes.append(mode)
    return np.array(states), modes


@pytest.fixture
def counted(monkeypatch):
    """Count the integration steps of the plain source."""
    calls = [0]
    step = smooth_mode.machine.runge_kutta

    def counting(*arguments):
        calls[0] += 1
        return step(*arguments)

    monkeypatch.setattr(smooth_mode.machine, "runge_kutta", counting)
    return calls


@pytest.mark.parametrize("model", RIGID)
@pytest.mark.parametrize("effects", [RIPPLE, ECCENTRIC, DRY_M, DRY_L, DRY_M | DRY_L | ECCENTRIC])
def test_rigid_teeth_with_an_effect_cost_few_steps(model, effects, counted):
    rng = np.random.default_rng(3)
    p = gear_train(model, effects)
    most = 0
    for _ in range(4):
        start = (0.0, float(rng.normal()), 0.0, float(rng.normal()), 0.0, 0.0, 0.0, 0.0)
        torques = np.repeat(rng.normal(size=20) * 60.0, 10)
        x = drivetrain.consistent_start(start, p)
        mode, table = drivetrain.initial_mode(x, p), drivetrain.prepare(p, 1e-3)
        for u in torques:
            counted[0] = 0
            x, mode = drivetrain.advance(x, mode, p, float(u), 0.0, 1e-3, table)
            most = max(most, counted[0])
        assert np.isfinite(x).all()
    assert 0 < most < 3000


@pytest.mark.parametrize("model", RIGID)
def test_a_state_beyond_a_rigid_flank_ends_in_few_steps(model, counted):
    p = gear_train(model, RIPPLE)
    x = (4.0, -1e-3, 4.0 / 3.984 - 2.05e-3, 0.03, -20.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for contact in (-1, 1):
        moved, _ = drivetrain.advance(x, (contact, 1, 1), p, -5.0, 0.0, 1e-3, drivetrain.prepare(p, 1e-3))
        assert np.isfinite(moved).all()
    assert counted[0] < 500


@pytest.mark.parametrize("model", RIGID)
@pytest.mark.parametrize("effects", [DRY_M, DRY_L, DRY_M | DRY_L | RIPPLE, ECCENTRIC])
def test_rigid_teeth_stay_on_their_flank_and_inside_the_gap(model, effects):
    p = gear_train(model, effects, tau=0.05, b_l=20.0)
    torques = 60.0 * np.cos(2.0 * np.pi * 0.8 * 1e-3 * np.arange(3000))
    states, modes = run(p, torques, 1e-3, source=compiled_plant("drivetrain"))
    error = effects.get("effects.gear_eccentricity.amplitude", 0.0)
    turns = effects.get("effects.gear_eccentricity.cycles_per_rev", 0.0)
    twist = states[:, 0] / 3.984 - states[:, 2] + error * np.sin(turns * states[:, 0])
    slope = 1.0 / 3.984 + error * turns * np.cos(turns * states[:, 0])
    contact = np.array([mode[0] for mode in modes])
    assert set(np.sign(contact)) == {-1, 0, 1}
    assert np.abs(twist).max() < 2e-3 + 1e-9
    touching = contact != 0
    assert np.abs(np.abs(twist[touching]) - 2e-3).max() < 1e-9
    assert np.abs(slope * states[:, 1] - states[:, 3])[touching].max() < 1e-9


def test_dry_friction_holds_rigid_teeth_as_one_body_until_both_break_away():
    p = gear_train("rigid_impact", DRY_M | DRY_L, tau=0.5)
    start = (3.984 * 2e-3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    states, _ = run(p, np.full(1500, 8.0), 1e-3, start=start)
    # Motor and load start together when the gear's torque exceeds both frictions: 3.984 T = 3.984 2 + 5.
    breaks = -0.5 * math.log(1.0 - (2.0 + 5.0 / 3.984) / 8.0)
    time_ = 1e-3 * np.arange(1501)
    assert np.all(states[time_ <= breaks, 3] == 0.0)
    later = time_ > breaks + 2e-3
    assert np.all(states[later, 3] > 0.0)
    assert np.abs(states[later, 1] / 3.984 - states[later, 3]).max() < 1e-12


def test_an_eccentric_rigid_gear_keeps_its_energy():
    p = gear_train("rigid_impact", ECCENTRIC, b_m=0.0, b_l=0.0, tau=1e9)
    start = (3.984 * 2e-3, 3.984 * 2.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0)
    p = with_values(p, {"alpha": 0.0, "effects.gear_eccentricity.amplitude": 0.02})
    states, _ = run(p, np.zeros(600), 2e-3, start=start)
    energy = 0.2 * states[:, 1] ** 2 + 2.8 * states[:, 3] ** 2
    assert np.abs(energy / energy[0] - 1.0).max() < 1e-9
    assert np.ptp(states[:, 1] / states[:, 3]) > 0.05


@pytest.mark.parametrize("model", ["nordin", "elastic_impact"])
def test_a_wound_hardening_shaft_raises_nothing(model):
    p = gear_train(model, HARD, c=0.5)
    x = (0.0, 0.2, 1e-3, 2.0, 20.0, 0.0, 0.0, 1e-2, 0.0, 0.0, 0.0, 0.0)
    moved, _ = drivetrain.advance(x, (0, 1, 1), p, 1.0, -9.0, 0.02, drivetrain.prepare(p, 0.02))
    assert np.isfinite(moved).all()


EXTREME = [{"J_m": 1e-9}, {"J_l": 1e-9}, {"c": 1e12}, {"k": 1e12}, {"J_m": 1e-9, "c": 1e12}, {"tau": 1e-6}, {"i": 1e12}]


@pytest.mark.parametrize("model", BACKLASH_MODELS)
@pytest.mark.parametrize("effects", [{}, RIPPLE, DRY_M | DRY_L, HARD])
def test_extreme_parameters_and_inputs_are_quick_or_refused(model, effects):
    plant = compiled_plant("drivetrain")
    run(gear_train(model, effects), [1.0], 1e-3, source=plant)
    for values in EXTREME:
        p = gear_train(model, effects, **values)
        for u in (30.0, 1e300):
            begin = time.process_time()
            states, _ = run(p, [u] * 3, 1e-3, source=plant)
            # About 10 ms a step on an idle core; the preparation comes on top.
            assert time.process_time() - begin < 0.5
            assert np.isfinite(states[0]).all()


def test_a_stiff_shaft_without_effects_has_a_result():
    p = parameters(c=1e12, alpha=0.0)
    states, _ = run(p, np.full(1000, 30.0), 1e-3)
    rigid, _ = run(parameters(alpha=0.0, backlash_model=4.0), np.full(1000, 30.0), 1e-3)
    # A damping of 1e12 leaves 4 to 5 digits less than the machine's 16 to each of a thousand steps.
    assert np.abs(states[:, :4] - rigid[:, :4]).max() < 1e-4


def test_a_single_axis_that_no_step_resolves_is_refused():
    p = axis_equations.DEFAULTS._replace(J=1e-9, b=1e12)
    x, _ = compiled_plant("servo_axis").advance((0.0, 1.0, 0.0, 0.0, 0.0), 1, p, 1.0, 0.0, 1e-3)
    assert np.isnan(x).all()
