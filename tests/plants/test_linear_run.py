"""A model without effects runs by its transition, as the exact plant does, and no other model does."""

import numpy as np
import pytest

from orchestrator.diagnosis.report.simulation import RunSignals, Simulation
from orchestrator.plants.known.drivetrain import PLANT as DRIVETRAIN
from orchestrator.plants.known.servo_axis import PLANT as AXIS
from orchestrator.plants.linear_run import is_linear

H = 0.005
DELAY, LIMIT = "effects.input_delay.delay", "effects.torque_saturation.limit"
START = np.array([0.4, 2.0, 0.1, 0.5, 3.0, 0.0, 0.0, 0.0])


def torque(size):
    """Steps of torque [N.m] of eight samples each."""
    return np.repeat(np.random.default_rng(4).uniform(-12.0, 12.0, size // 8 + 1), 8)[:size]


def model_of(plant, values):
    p = plant.extend_values([entry.default for entry in plant.table])
    for name, value in values.items():
        p[plant.index(name)] = value
    return p


@pytest.mark.parametrize(
    ("plant", "values"),
    [
        (DRIVETRAIN, {}),
        (DRIVETRAIN, {DELAY: 2.3 * H, LIMIT: 8.0, "effects.sensor_offset.load.offset": 0.2}),
        (DRIVETRAIN, {"tau": 1e-6, "c": 0.3, DELAY: 0.4 * H}),
        (AXIS, {"tau": 0.02, DELAY: 1.6 * H}),
        (AXIS, {"tau": 0.0, DELAY: 0.5 * H}),
    ],
)
def test_it_is_the_exact_plant(plant, values):
    p, channels = model_of(plant, values), len(plant.bodies)
    signals = RunSignals(H, torque(200), np.zeros((200, channels)), np.ones(channels), 1.0, 10.0)
    start = np.where(np.isin(np.arange(8), plant.states), START, 0.0)
    quick, exact = Simulation(plant, p, signals), Simulation(plant, p, signals)
    exact.__dict__["_kernel"] = None
    assert is_linear(plant, p)
    assert quick._kernel is not None
    for part in (slice(0, 60), slice(50, 200)):
        found, wanted = (one.run(start, part)[:, :channels] for one in (quick, exact))
        assert np.max(np.abs(found - wanted)) < 1e-9 * np.max(np.abs(wanted))


@pytest.mark.parametrize(
    "values",
    [
        {"alpha": 0.004},
        {"effects.coulomb_friction.motor.torque": 0.5},
        {"effects.load_torque.torque": 1.0},
        {"effects.drive_filter.time_constant": 0.05},
        {"effects.rate_limit.rate": 200.0},
    ],
)
def test_a_model_with_an_effect_is_not_linear(values):
    assert not is_linear(DRIVETRAIN, model_of(DRIVETRAIN, values))
