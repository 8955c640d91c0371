"""Extreme legal values: a step has an end, in bounded work, or is refused with the reason; it never hangs."""

import math

import pytest

from pyfmu_sources.adapters.slave_base import TOO_STIFF
from pyfmu_sources.axis.servo_axis_slave import ServoAxis
from pyfmu_sources.drivetrain import smooth_mode
from pyfmu_sources.drivetrain.drivetrain_slave import MODEL, Drivetrain
from pyfmu_sources.train.two_stage_train_slave import TwoStageTrain

STEP, STEPS = 1e-3, 10
EXTREMES = (
    {"J_m": 1e-9},
    {"c": 1e12},
    {"J_m": 1e-9, "c": 1e12},
    {"J_l": 1e-9, "k": 1e-9},
    {"tau": 1e-6},
    {"J_m": 1e-9, "effects.coulomb_friction.motor.torque": 1e12},
    {"c": 1e12, "effects.hardening_stiffness.cubic": 1e12},
    {"effects.hardening_stiffness.cubic": 1e12, "effects.hardening_stiffness.sharpness": 100.0},
    {"effects.gear_eccentricity.amplitude": 1e12},
    {"effects.gear_eccentricity.amplitude": 1e12, "effects.gear_eccentricity.lever_arm": 0.0},
)
AXIS = (
    {"J": 1e-9},
    {"b": 1e12},
    {"J": 1e-9, "effects.coulomb_friction.motor.torque": 1e12},
    {"effects.gravity_load.amplitude": 1e12},
)
TRAIN = (
    {"J_s": 1e-9},
    {"J_m": 1e-9, "J_s": 1e-9, "J_l": 1e-9},
    {"c_1": 1e12},
    {"J_s": 1e-9, "c_2": 1e12},
    {"k_1": 0.0, "c_1": 0.0, "k_2": 0.0, "c_2": 0.0},
    {"k_1": 1e12, "k_2": 1e-9},
    {"i_1": 1e-9},
    {"i_1": 1e12, "i_2": 1e12},
    {"tau": 1e-6},
    {"b_s": 1e12},
    {"alpha_1": 1e12, "alpha_2": 1e-12},
    {"J_s": 1e-9, "effects.coulomb_friction.shaft.torque": 1e12},
    {"effects.coulomb_friction.load.torque": 1e-12},
)
TOO_FAST = "the fastest rate of the train must be at most 1e7 1/s"
REASONS = (
    "must be one that can be resolved",
    "must stay finite",
    "must stay within 1e13 rad",
    "must be off where `backlash_model` is",
)


def stepped(slave, values, inputs, model=None):
    """Run some steps; return the messages of refusals, empty when there is none."""
    said = []
    slave.say = lambda status, message: said.append(message)
    read = [n for n, v in enumerate(slave.table) if v.causality == "output" and v.type == "Real"]
    references = {variable.name: n for n, variable in enumerate(slave.table)}
    slave.setup_experiment(0.0, None, None)
    slave.set_real([references[name] for name in values], list(values.values()))
    if model is not None:
        slave.set_integer([MODEL], [model])
    slave.enter_initialization_mode()
    slave.set_real([references[name] for name in inputs], list(inputs.values()))
    slave.exit_initialization_mode()
    for n in range(0 if said else STEPS):
        if not slave.do_step(n * STEP, STEP):
            break
        outputs = slave.get_real(read)
        assert all(map(math.isfinite, outputs))
    return said


@pytest.fixture
def work(monkeypatch):
    """The number of integration steps that are taken."""
    count = [0]
    step = smooth_mode.machine.runge_kutta

    def counted(*arguments):
        count[0] += 1
        return step(*arguments)

    monkeypatch.setattr(smooth_mode.machine, "runge_kutta", counted)
    return count


# Half of them hold every pair of values, torque and model; the whole runs at night.
CASES = [
    pytest.param(
        values, torque, model, id=f"{'-'.join(values)}-{torque:g}-{model}",
        marks=[pytest.mark.night] if (k + n + model) % 2 else [],
    )
    for k, values in enumerate(EXTREMES) for n, torque in enumerate((1.0, 1e12)) for model in range(1, 7)
]  # fmt: skip


@pytest.mark.parametrize(("values", "torque", "model"), CASES)
def test_a_drivetrain_of_extreme_values_ends_or_says_why_not(values, torque, model, work):
    said = stepped(Drivetrain(instance_name="a"), values, {"u": torque, "T_l": 0.0}, model)
    assert all(any(reason in text for reason in REASONS) for text in said), said
    assert work[0] <= STEPS * (smooth_mode.machine.MAX_STEPS + STEP * smooth_mode.machine.MAX_STEPS_PER_SECOND)


@pytest.mark.parametrize("torque", [1.0, 1e12])
@pytest.mark.parametrize("values", AXIS, ids="-".join)
def test_so_does_an_axis(values, torque):
    said = stepped(ServoAxis(instance_name="a"), values, {"u": torque})
    assert all(any(reason in text for reason in REASONS) for text in said), said


@pytest.mark.parametrize("torque", [1.0, 1e12])
@pytest.mark.parametrize("values", TRAIN, ids="-".join)
def test_so_do_two_stages(values, torque):
    said = stepped(TwoStageTrain(instance_name="a"), values, {"u": torque, "T_l": 0.5 * torque})
    assert all(any(reason in text for reason in (*REASONS, TOO_FAST)) for text in said), said


@pytest.mark.parametrize(("inertia", "begins"), [(1e-9, False), (1e-6, True)])
def test_a_train_that_is_too_stiff_at_any_step_does_not_begin(inertia, begins):
    """Else a host that shortens the steps that are discarded takes hours for a second."""
    said = stepped(TwoStageTrain(instance_name="a"), {"J_s": inertia}, {"u": 0.0, "T_l": 0.0})
    assert begins == (not any(TOO_FAST in text for text in said))
    if not begins:
        (text,) = said
        assert text.startswith("fmi2ExitInitializationMode")
        assert "make the inertias (`J_m`, `J_s`, `J_l`) larger" in text


def test_a_stiff_shaft_without_effects_is_exact_and_not_refused(work):
    assert not stepped(Drivetrain(instance_name="a"), {"J_m": 1e-9, "c": 1e12}, {"u": 1.0, "T_l": 0.0}, 1)
    assert work[0] == 0
    assert "too many internal steps" in TOO_STIFF


@pytest.mark.parametrize("kind", [Drivetrain, ServoAxis, TwoStageTrain])
@pytest.mark.parametrize("name", ["u", "T_l"])
def test_a_torque_without_meaning_is_refused_by_name(kind, name):
    torques = {"u": 0.0, "T_l": 0.0}
    (said,) = stepped(kind(instance_name="a"), {}, torques | {name: 1e300})
    assert said == f"`{name}` must be within [-1e+12, 1e+12], but is 1e+300; ignored"


def test_a_motion_without_meaning_is_refused_with_the_cure():
    free = {"J_l": 1e-6, "k": 0.0, "c": 0.0, "b_l": 0.0}
    (said,) = stepped(Drivetrain(instance_name="a"), free, {"u": 0.0, "T_l": 1e12})
    assert "theta_" in said
    assert "must stay within 1e13 rad" in said
    assert "`u` and `T_l`" in said
