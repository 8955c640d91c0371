"""A communication step, be it 1 or 100 ms long, changes nothing but how often inputs may change."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pyfmu_sources.axis import axis_equations
from pyfmu_sources.drivetrain import drivetrain, equations
from pyfmu_sources.laws.parameter_rows import Parameter, with_values
from pyfmu_sources.train import train_equations
from pyfmu_sources.train import train_steps as train
from pyfmu_sources.train.train_transition import prepare
from tests.plants.test_every_row_acts import law_of, size_of
from tests.support import independent_plant as truth
from tests.support.compiled_plants import compiled_plant

TIGHT = 1e-3
STEPS = (5e-3, 0.02, 0.05, 0.1)
REQUESTS = (30.0, -20.0, 10.0)  # N.m, of 0.1 s each
CLOSE = 1e-6  # of the motion's size
# Of the adapter, which cuts a step where a request arrives.
OF_INPUT = ("effects.input_delay.delay", "effects.torque_saturation.limit")


def values_of(row: Parameter, rows: tuple[Parameter, ...], more: float) -> dict[str, float]:
    """The values that switch a row on; torques are ``more`` times as large."""
    found = law_of(row, rows) | {row.name: size_of(row)}
    units = {entry.name: entry.unit for entry in rows}
    return {name: value * more if units[name] == "N.m" else value for name, value in found.items()}


def axis_run(values: dict[str, float], step: float, more: float) -> tuple[float, ...]:
    """The end of 0.3 s of the axis in communication steps."""
    plant, p = compiled_plant("servo_axis"), with_values(axis_equations.DEFAULTS, values)
    x = plant.start(0.1, -1.0, 30.0, p)
    mode = plant.initial_mode(x, p, REQUESTS[0])
    for u in REQUESTS:
        for _ in range(round(0.1 / step)):
            x, mode = plant.advance(x, mode, p, more * u, 0.0, step)
    return x


def drivetrain_run(values: dict[str, float], step: float, more: float) -> tuple[float, ...]:
    plant, p = compiled_plant("drivetrain"), with_values(equations.DEFAULTS, values)
    x = plant.consistent_start((0.1, -1.0, 0.02, -0.25, 30.0, 0.02, -0.25, 0.0), p)
    mode, table = plant.initial_mode(x, p), plant.prepare(p, step)
    for u in REQUESTS:
        for _ in range(round(0.1 / step)):
            x, mode = plant.advance(x, mode, p, more * u, 0.0, step, table)
    return x


def train_run(values: dict[str, float], step: float, more: float) -> tuple[float, ...]:
    p = with_values(train_equations.DEFAULTS, values)
    x = (0.1, -1.0, 0.05, -0.5, 0.02, -0.25, 30.0)
    mode, table = train_equations.initial_mode(x, p, 0.0), prepare(p, step)
    for u in REQUESTS:
        for _ in range(round(0.1 / step)):
            x, mode = train.advance(x, mode, p, more * u, 0.0, step, table)
    return x


@pytest.mark.parametrize(
    ("run", "rows", "more"),
    [
        (axis_run, axis_equations.PARAMETERS, 1.0),
        (axis_run, axis_equations.PARAMETERS, 100.0),
        (drivetrain_run, equations.PARAMETERS, 1.0),
        (train_run, train_equations.PARAMETERS, 1.0),
    ],
    ids=["axis", "strong axis", "drivetrain", "two stages"],
)
def test_every_row_of_a_plant_is_right_in_every_step(run, rows, more):
    wrong, moved = [], 0
    for row in rows:
        if row.name in OF_INPUT:
            continue
        values = values_of(row, rows, more)
        tight = np.array(run(values, TIGHT, more))
        tight[np.abs(tight) > 1e200] = 0.0  # a request that nobody follows
        for step in STEPS:
            found = np.array(run(values, step, more))
            found[np.abs(found) > 1e200] = 0.0
            off = np.abs(found - tight) / (1.0 + np.abs(tight))
            if np.isnan(found).any():  # the FMU refuses the step
                continue
            moved += 1
            if off.max() > CLOSE:
                wrong.append((row.name, step, off.max()))
    assert wrong == []
    assert moved > 0.95 * len(STEPS) * (len(rows) - len(OF_INPUT))  # a lower stop above the upper one chatters


@pytest.mark.parametrize("step", [0.01, 0.02, 0.04])
def test_a_strong_pendulum_on_the_axis_falls_alike_in_every_step(step):
    """Runge-Kutta steps of the axis once ignored gravity: 60 per cent were missing in steps of 40 ms."""
    plant, p = compiled_plant("servo_axis"), axis_equations.DEFAULTS._replace(gravity_load_amplitude=2000.0)
    x, mode = plant.start(0.0, 0.0, 0.0, p), 1
    for _ in range(round(0.24 / step)):
        x, mode = plant.advance(x, mode, p, 600.0, 0.0, step)
    assert x[1] == pytest.approx(-9.8383584239, abs=1e-8)


def near(value: float, factor: float) -> st.SearchStrategy[float]:
    return st.floats(-1.0, 1.0).map(lambda share: value * factor**share)


LINEAR = st.fixed_dictionaries({name: near(truth.NOMINAL[name], 3.0) for name in truth.MISMATCHED})
# Of the independent simulator, with what the plant calls it.
NAMES = {
    "T0": ("load_torque.torque", -40.0, 40.0), "grav": ("gravity_load.amplitude", -80.0, 80.0),
    "grav_ph": ("gravity_load.phase", -3.0, 3.0), "qd": ("quadratic_drag.coefficient", 0.0, 5.0),
    "ks": ("spring_load.stiffness", -50.0, 300.0), "ks3": ("spring_load.cubic", 0.0, 300.0),
    "ks_x": ("spring_load.angle", -0.3, 0.3), "dv_m": ("directional_friction.motor.difference", -0.1, 0.1),
    "dv_l": ("directional_friction.load.difference", -0.8, 0.8), "rip": ("torque_ripple.amplitude", -4.0, 4.0),
    "rip_n": ("torque_ripple.cycles_per_rev", 1.0, 12.0), "rip2": ("torque_ripple.second.amplitude", -2.0, 2.0),
    "rip3": ("torque_ripple.third.amplitude", -2.0, 2.0), "J3": ("extra_resonance.inertia", 0.1, 2.0),
    "w3": ("extra_resonance.frequency", 10.0, 120.0), "z3": ("extra_resonance.damping_ratio", 0.0, 0.3),
}  # fmt: skip
SETS = st.fixed_dictionaries({}, optional={name: st.floats(low, high) for name, (_, low, high) in NAMES.items()})
counted = [0]


@settings(max_examples=200, deadline=None, derandomize=True)
@given(LINEAR, SETS, st.sampled_from([0.0, 0.01, 0.05]))
def test_any_parameters_move_as_the_independent_simulator_moves_them(linear, effects, alpha):
    u = np.repeat([80.0, -60.0, 20.0], 2)
    _, made = truth.make_record(
        effects | {"alpha": alpha}, rate=20.0, mismatch=0.0, noise=(0.0, 0.0), counts=None, contact="dead_zone", u=u,
        linear=linear, substeps=1000,
    )  # fmt: skip
    own = {f"effects.{NAMES[name][0]}": value for name, value in effects.items()}
    p, scale = with_values(equations.parameters(alpha=alpha, **linear), own), np.abs(made["states"]).max(axis=0)[:5]
    for step, stride in ((0.05, 1), (0.01, 5), (0.1, 0)):
        plant = compiled_plant("drivetrain")
        x, table = plant.consistent_start((0.0,) * 8, p), plant.prepare(p, step)
        mode = plant.initial_mode(x, p)
        for n in range(len(u)):
            if stride == 0 and n % 2 == 1:
                continue
            assert np.abs(np.array(x[:5]) - made["states"][n, :5]).max() < CLOSE * (1.0 + scale.max()), (step, n)
            for _ in range(max(stride, 1)):
                x, mode = plant.advance(x, mode, p, float(u[n]), 0.0, step, table)
        counted[0] += 1
    if counted[0] % 30 == 0:  # plain Python, on a tenth
        y, flanks = drivetrain.consistent_start((0.0,) * 8, p), drivetrain.initial_mode(x, p)
        z, table = y, drivetrain.prepare(p, 0.05)
        compiled = flanks
        for torque in u:
            y, flanks = drivetrain.advance(y, flanks, p, float(torque), 0.0, 0.05, table)
            z, compiled = plant.advance(z, compiled, p, float(torque), 0.0, 0.05, table)
        assert y == z
        assert math.isfinite(y[0])
