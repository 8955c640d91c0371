"""Torque balances along the exact, event-located motion: nothing is missing with an effect, and much without it."""

import numpy as np
import pytest

from orchestrator.diagnosis.data.signals import prepare_signals, smooth
from orchestrator.diagnosis.model.interface import ModelPoint
from orchestrator.diagnosis.model.plant_effects import effect_parameters
from orchestrator.diagnosis.model.torque_balance import TorqueBalance
from orchestrator.diagnosis.report.simulation import RunSignals, Simulation
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.plants.known.drivetrain import PLANT as DRIVETRAIN
from orchestrator.records.model_file import default_model
from orchestrator.records.record import record_from_columns

SETTINGS = DiagnosisSettings()
MODEL = default_model()
STEP = 0.005

# Effect -> values in the plant's table. Sizes change the motion; the balance must still close.
EFFECTS = {
    "backlash@shaft": {"alpha": 0.01},
    "coulomb_friction@motor": {"effects.coulomb_friction.motor.torque": 1.0},
    "coulomb_friction@load": {"effects.coulomb_friction.load.torque": 4.0},
    "load_dependent_friction@motor": {"effects.load_dependent_friction.motor.coefficient": 0.1},
    "input_delay@actuator": {"effects.input_delay.delay": 0.0123},
    "drive_filter@actuator": {"effects.drive_filter.time_constant": 0.03},
    "torque_saturation@actuator": {"effects.torque_saturation.limit": 30.0},
    "rate_limit@actuator": {"effects.rate_limit.rate": 120.0},
    "hardening_stiffness@shaft": {"effects.hardening_stiffness.cubic": 3e6},
    "torque_ripple@motor": {
        "effects.torque_ripple.amplitude": 1.0, "effects.torque_ripple.cycles_per_rev": 6.0,
        "effects.torque_ripple.phase": 0.4,
    },
    "load_torque@load": {"effects.load_torque.torque": 4.0},
    "gravity_load@load": {"effects.gravity_load.amplitude": 6.0, "effects.gravity_load.phase": 0.7},
    "extra_resonance@load": {
        "effects.extra_resonance.inertia": 0.6, "effects.extra_resonance.frequency": 25.0,
        "effects.extra_resonance.damping_ratio": 0.03,
    },
    "quadratic_drag@load": {"effects.quadratic_drag.coefficient": 1.0},
    "spring_load@load": {"effects.spring_load.stiffness": 20.0, "effects.spring_load.angle": 0.1},
    "varying_inertia@load": {"effects.varying_inertia.amplitude": 1.0, "effects.varying_inertia.phase": 0.3},
    "shaft_hysteresis@shaft": {"effects.shaft_hysteresis.torque": 20.0, "effects.shaft_hysteresis.twist": 0.005},
    "directional_friction@motor": {"effects.directional_friction.motor.difference": 0.1},
    "sensor_offset@load": {"effects.sensor_offset.load.offset": 0.01},
}  # fmt: skip


def requests(size=2400, seed=5):
    rng = np.random.default_rng(seed)
    time = STEP * np.arange(size)
    lines = (0.3, 0.7, 1.3, 2.1)
    return sum(rng.uniform(8.0, 25.0) * np.sin(2 * np.pi * f * time + rng.uniform(0, 6.0)) for f in lines)


def exact_record(values):
    """A record of the event-located plant without noise, and its parameters."""
    p = DRIVETRAIN.extend_values(MODEL.values)
    for name, value in values.items():
        p[DRIVETRAIN.index(name)] = value
    u = requests()
    signals = RunSignals(STEP, u, np.zeros((u.size, 2)), np.ones(2), 1.0, 10.0)
    angles = Simulation(DRIVETRAIN, p, signals).run(np.zeros(8), slice(0, u.size))
    columns = {"time": STEP * np.arange(u.size), "u": u, "theta_m": angles[:, 0], "theta_l": angles[:, 1]}
    return record_from_columns(columns, "exact"), p


def left_at(balance, p):
    """Rms of what is missing over that of what drives, at each body, within the band and away from the ends."""
    missing, inner = balance.balance(p), slice(6 * balance.size // 10, -balance.size // 20)  # the start is forgotten
    driving = balance.reference_signals(ModelPoint.nominal(balance.parameters))
    shares = []
    for n, cutoff in enumerate(balance.cutoffs):
        rows = balance.active[n][inner] > 0.0
        left, whole = (smooth(values[n], balance.step, cutoff)[inner][rows] for values in (missing, driving))
        shares.append(float(np.sqrt(np.mean(left**2) / np.mean(whole**2))))
    return np.array(shares)


@pytest.mark.parametrize("label", sorted(EFFECTS))
def test_the_balance_closes_with_the_effect_and_not_without(label):
    record, p = exact_record(EFFECTS[label])
    balance = TorqueBalance(MODEL, prepare_signals(record, None, SETTINGS.band), SETTINGS.balance)
    closed, without = left_at(balance, p), left_at(balance, balance.nominal)
    assert np.max(closed) < 0.05
    assert np.max(without) > 3.0 * np.max(closed)


def test_the_balance_of_the_plain_plant_closes():
    record, p = exact_record({})
    balance = TorqueBalance(MODEL, prepare_signals(record, None, SETTINGS.band), SETTINGS.balance)
    assert np.max(left_at(balance, p)) < 2e-3


def test_a_hidden_load_closes_the_motors_balance():
    record, p = exact_record({"effects.coulomb_friction.load.torque": 2.0})
    one = record.without_load_encoder()
    balance = TorqueBalance(MODEL, prepare_signals(one, None, SETTINGS.band), SETTINGS.balance)
    assert balance.hides_load
    assert balance.channels == ("motor",)
    assert left_at(balance, p)[0] < 0.05
    assert "sensor_offset@load" not in balance.effects


def test_values_of_effects_reach_the_plants_table():
    record, _ = exact_record({})
    balance = TorqueBalance(MODEL, prepare_signals(record, None, SETTINGS.band), SETTINGS.balance)
    ripple = balance.effects["torque_ripple@motor"]
    named = effect_parameters(DRIVETRAIN, ripple, (0.3, 0.4, 6.0))
    assert named["effects.torque_ripple.amplitude"] == pytest.approx(0.5)
    assert named["effects.torque_ripple.phase"] == pytest.approx(np.arctan2(0.4, 0.3))
    point = ModelPoint.nominal(balance.parameters).with_effect("torque_ripple@motor", (0.3, 0.4, 6.0))
    assert balance.values_at(point)[DRIVETRAIN.index("effects.torque_ripple.cycles_per_rev")] == 6.0
    friction = ModelPoint.nominal(balance.parameters).with_effect("coulomb_friction@motor", (1.0, -5.0))
    place = DRIVETRAIN.index("presliding.motor")
    assert balance.values_at(friction)[place] == -5.0
    assert balance.physical_values(friction)[place] == balance.nominal[place]


def test_the_first_effect_that_has_a_value_sets_it():
    record, _ = exact_record({"effects.coulomb_friction.motor.torque": 1.0})
    balance = TorqueBalance(MODEL, prepare_signals(record, None, SETTINGS.band), SETTINGS.balance)
    loaded = ModelPoint.nominal(balance.parameters).with_effect("load_dependent_friction@motor", (0.1, -6.0))
    both = loaded.with_effect("coulomb_friction@motor", (0.0, -9.0))
    alone, beside = balance.residuals([loaded, both])
    np.testing.assert_array_equal(alone, beside)


def test_only_what_makes_the_drive_late_is_alone():
    record, _ = exact_record({})
    effects = TorqueBalance(MODEL, prepare_signals(record, None, SETTINGS.band), SETTINGS.balance).effects
    assert "drive_filter@actuator" in effects["input_delay@actuator"].excludes
    assert "late_load@log" not in effects["input_delay@actuator"].excludes
    assert not effects["late_load@log"].excludes
