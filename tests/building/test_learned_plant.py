"""A learned law in the slave of a plant: off it is nothing, on it is the torque that it says."""

import numpy as np
import pytest

from orchestrator.building.build import build_variant
from orchestrator.building.sources import Recipe, takes_law, with_law
from orchestrator.errors import FmuError
from pyfmu_sources.axis.servo_axis_law import ServoAxisWithLaw
from pyfmu_sources.axis.servo_axis_slave import ServoAxis
from pyfmu_sources.drivetrain.drivetrain_law import DrivetrainWithLaw
from pyfmu_sources.drivetrain.drivetrain_slave import Drivetrain
from pyfmu_sources.laws.learned_law import (
    CYCLE_L,
    CYCLE_M,
    DRIVE,
    KNOTS,
    LATER,
    LOAD_ANGLE,
    LOAD_SPEED,
    MOTOR_SPEED,
    TWIST,
    WITH_SPEED,
    law_torque,
)

ON = "effects.learned_law.on"
H = 0.005
OUTPUTS = ("theta_m", "theta_l", "omega_m", "omega_l", "T_m", "T_shaft")
AXIS_OUTPUTS = ("theta_m", "omega_m", "T_m")


def law(form, values, reach=1.0, **more):
    """Return a law with even knots over plus and minus ``reach``."""
    return {
        "form": form, "words": "test", "unit": "1", "value_unit": "N.m", "changes": {},
        "knots": np.linspace(-reach, reach, KNOTS).tolist(), "values": list(values), **more,
    }  # fmt: skip


def slave_of(base, learned=None, **starts):
    """Return an initialised slave of a class of its own, which has learned a law, if any."""
    cls = type("Test", (base,), {})
    if learned is not None:
        cls.learn(learned)
    cls.customise("Test", "test", {name.replace("__", "."): value for name, value in starts.items()})
    slave = cls(instance_name="test")
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    assert not slave.log_queue, slave.log_queue[0].msg
    return slave


def run(slave, count=200, level=30.0, outputs=OUTPUTS, first=0, T_l=0.0):
    """Return (count, outputs) of a run under steps of torque."""
    names = [variable.name for variable in slave.table]
    places = [names.index(name) for name in outputs]
    u = np.repeat(np.random.default_rng(3).uniform(-level, level, 100), 10)
    found = []
    for n in range(first, first + count):
        slave.set_real([0, 1], [float(u[n]), T_l])
        assert slave.do_step(n * H, H), slave.log_queue[-1].msg
        found.append(slave.get_real(places))
    return np.array(found)


@pytest.mark.parametrize(
    ("plain", "learning", "outputs"),
    [(Drivetrain, DrivetrainWithLaw, OUTPUTS), (ServoAxis, ServoAxisWithLaw, AXIS_OUTPUTS)],
)
def test_a_law_that_is_off_is_nothing(plain, learning, outputs):
    off = slave_of(learning, law(MOTOR_SPEED, np.linspace(-3.0, 3.0, KNOTS), dry=2.0, changes={"tau": 0.02}))
    assert np.array_equal(run(off, outputs=outputs), run(slave_of(plain), outputs=outputs))


LINE = np.linspace(-1.0, 1.0, KNOTS)
SPRING = "effects__spring_load__stiffness"


@pytest.mark.parametrize(
    ("form", "slope", "alike"),
    [
        (MOTOR_SPEED, 0.4, {"b_m": 0.4}),
        (LOAD_SPEED, 3.0, {"b_l": 3.0}),
        (LOAD_ANGLE, 40.0, {SPRING: 40.0}),
        (TWIST, 200.0, {"k": 200.0}),
    ],
)
def test_a_straight_law_is_the_physics_that_is_straight(form, slope, alike):
    """Also the torque of the shaft, of which a law of the twist is a part."""
    defaults = {variable.name: variable.start for variable in Drivetrain.table}
    wanted = {name: defaults[name.replace("__", ".")] + more for name, more in alike.items()}
    expected = run(slave_of(Drivetrain, **wanted))
    found = run(slave_of(DrivetrainWithLaw, law(form, slope * LINE), **{ON: 1}))
    without = run(slave_of(Drivetrain))
    size = np.std(expected - without, axis=0)
    off = np.max(np.abs(found - expected), axis=0)
    assert np.all(off[[0, 1, 2, 3, 5]] < 2e-3 * np.maximum(size, 1e-6)[[0, 1, 2, 3, 5]])
    assert off[4] < 1e-9  # the drive itself does not feel it


def test_a_law_of_the_drive_takes_its_share():
    """A law against the motor of a tenth of the drive's torque leaves nine tenths; of a lag and a filter, too."""
    own = {"effects.drive_filter.time_constant": 0.02}
    found = run(slave_of(DrivetrainWithLaw, law(DRIVE, 0.1 * LINE), **{ON: 1}, **own))
    expected = run(slave_of(Drivetrain, **own), level=27.0)
    assert np.allclose(found[:, :4], expected[:, :4], rtol=0.0, atol=2e-4)
    assert np.allclose(found[:, 4], expected[:, 4] / 0.9, rtol=0.0, atol=1e-9)


def test_what_was_fitted_beside_a_law_changes_with_it():
    found = run(slave_of(DrivetrainWithLaw, law(MOTOR_SPEED, 0.0 * LINE, changes={"J_l": 2.0, "b_m": -1e9}), **{ON: 1}))
    J_l = next(variable.start for variable in Drivetrain.table if variable.name == "J_l")
    expected = run(slave_of(Drivetrain, J_l=J_l + 2.0, b_m=0.0))  # no further than its bound
    assert np.allclose(found, expected, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize(("form", "place"), [(MOTOR_SPEED, "motor"), (LOAD_SPEED, "load")])
def test_dry_friction_of_a_law_sticks(form, place):
    coulomb = f"effects__coulomb_friction__{place}__torque"
    distance = {f"effects__presliding__{place}__distance": 1e-4}
    expected = run(slave_of(Drivetrain, **{coulomb: 2.0}, **distance))
    found = run(slave_of(DrivetrainWithLaw, law(form, 0.0 * LINE, dry=2.0), **{ON: 1}, **distance))
    assert np.allclose(found, expected, rtol=0.0, atol=1e-5)
    expected = run(slave_of(ServoAxis, effects__coulomb_friction__motor__torque=2.0), outputs=AXIS_OUTPUTS)
    found = run(slave_of(ServoAxisWithLaw, law(MOTOR_SPEED, 0.0 * LINE, dry=2.0), **{ON: 1}), outputs=AXIS_OUTPUTS)
    assert np.allclose(found, expected, rtol=0.0, atol=1e-6)


def test_a_spring_of_an_axis():
    expected = run(slave_of(ServoAxis, **{SPRING: 5.0}), outputs=AXIS_OUTPUTS)
    found = run(slave_of(ServoAxisWithLaw, law(LOAD_ANGLE, 5.0 * LINE), **{ON: 1}), outputs=AXIS_OUTPUTS)
    size = np.std(expected, axis=0)
    assert np.all(np.max(np.abs(found - expected), axis=0) < 1e-3 * size)


@pytest.mark.parametrize("base", [DrivetrainWithLaw, ServoAxisWithLaw])
@pytest.mark.parametrize("clock", [0.0, 7.0])
def test_a_law_begins_when_its_clock_says_so(base, clock):
    """Also within a step, and where a dead time splits steps; from then on it is there with its friction."""
    outputs = OUTPUTS if base is DrivetrainWithLaw else AXIS_OUTPUTS
    begins = law(LATER + MOTOR_SPEED, 5.0 + 0.0 * LINE, dry=1.0, since=clock + 0.3021)
    starts = {ON: 1, "effects.learned_law.clock": clock}
    for delay in (0.0, 0.0123):
        own = {"effects.input_delay.delay": delay}
        late = run(slave_of(base, begins, **starts, **own), outputs=outputs)
        never = run(slave_of(base, begins, **own), outputs=outputs)
        changed = np.flatnonzero(np.any(late != never, axis=1))
        moved = np.flatnonzero(np.any(np.abs(late - never) > 1e-7, axis=1))
        assert moved[0] == 60  # the step from 0.300 to 0.305
        assert np.max(np.abs(late - never)[changed[changed < 60]], initial=0.0) < 1e-10
        early = run(slave_of(base, {**begins, "since": clock - 1.0}, **starts, **own), outputs=outputs)
        assert np.flatnonzero(np.any(np.abs(early - never) > 1e-7, axis=1))[0] <= 1
    drift = (late - never)[61:64, outputs.index("omega_m")]
    assert np.all(drift < 0.0)  # against the motor


@pytest.mark.parametrize("form", [CYCLE_M, CYCLE_L])
def test_a_law_may_come_by_the_clock(form):
    """A pulse of 2 N.m.s once a second, the knots between the steps, slows whatever it acts on by just as much."""
    pulse = np.zeros(KNOTS)
    pulse[5] = 20.0
    cyclic = law(form, pulse, knots=np.linspace(0.0, 1.0, KNOTS).tolist(), since=-0.2037, period=1.0)
    found = run(slave_of(ServoAxisWithLaw, cyclic, **{ON: 1}), outputs=AXIS_OUTPUTS, count=400, level=0.0)[:, 1]
    values = {variable.name: variable.start for variable in ServoAxis.table}
    change = np.abs(np.diff(found))
    assert np.argmax(change) * H == pytest.approx(0.3, abs=0.02)
    assert np.argmax(change[200:]) * H == pytest.approx(0.3, abs=0.02)
    free = slave_of(ServoAxisWithLaw, cyclic, **{ON: 1, "b": 0.0})
    assert run(free, outputs=AXIS_OUTPUTS, count=100, level=0.0)[-1, 1] == pytest.approx(-2.0 / values["J"], rel=1e-9)


def test_a_law_may_grow_with_the_speed_of_the_load():
    flat = (WITH_SPEED + TWIST, 0.0, 0.0, 1.0, 0.0, *np.linspace(-1.0, 1.0, KNOTS), *(2.0 * LINE))
    assert law_torque(flat, 0.0, (0.0, -3.0, 0.0, 0.25, 0.0)) == pytest.approx(1.5)
    still = law_torque((TWIST, *flat[1:]), 0.0, (0.0, -3.0, 0.0, 0.25, 0.0))
    assert still == pytest.approx(0.5)
    assert law_torque((TWIST, *flat[1:]), 0.0, (0.0, 0.0, 0.0, 4.0, 0.0)) == pytest.approx(8.0)  # the last line goes on


def test_a_saved_state_goes_on_as_it_would_have():
    cyclic = law(CYCLE_L, 9.0 * LINE, since=0.1, period=0.7)
    begun = slave_of(DrivetrainWithLaw, cyclic, **{ON: 1})
    run(begun, 50)
    saved = DrivetrainWithLaw._fmu_state_to_bytes(begun._get_fmu_state())
    other = type(begun)(instance_name="other")
    other._set_fmu_state(DrivetrainWithLaw._fmu_state_from_bytes(saved))
    assert not other.log_queue
    assert np.array_equal(run(other, 50, first=50), run(begun, 50, first=50))


def test_knots_must_rise_where_the_law_is_on():
    cls = type("Test", (DrivetrainWithLaw,), {})
    wrong = law(LOAD_SPEED, LINE)
    wrong["knots"][4] = wrong["knots"][3]
    cls.learn(wrong)
    for on in (0, 1):
        cls.customise("Test", "test", {ON: on})
        slave = cls(instance_name="test")
        slave.setup_experiment(0.0)
        slave.enter_initialization_mode()
        slave.exit_initialization_mode()
        said = [message.msg for message in slave.log_queue]
        assert [("knot[5]` must be larger than" in text) for text in said] == [True] * on


def test_a_plant_without_an_adapter_has_no_law(tmp_path):
    recipe = Recipe("LqrController", "controllers.lqr_slave", "LqrController")
    assert not takes_law(recipe)
    with pytest.raises(FmuError, match=r"pyfmu_sources/controllers/lqr_law\.py"):
        with_law(recipe, law(DRIVE, LINE))
    with pytest.raises(FmuError, match="lqr_law"):
        build_variant("other", "LqrController", {}, tmp_path, law(DRIVE, LINE))
