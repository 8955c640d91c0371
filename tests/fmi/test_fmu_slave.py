"""The slave base and the adapters, without an FMU around them."""

import itertools
import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pyfmu_sources.adapters.fmu_variables import unit_exponents
from pyfmu_sources.adapters.plant_slave import U
from pyfmu_sources.adapters.slave_base import SlaveBase
from pyfmu_sources.controllers import lqr_slave
from pyfmu_sources.controllers.lqr_slave import LqrController
from pyfmu_sources.drivetrain.drivetrain_slave import (
    CONTACT,
    FIRST_PARAMETER,
    OMEGA_M,
    T_M,
    T_SHAFT,
    THETA_L,
    THETA_M,
    Drivetrain,
)
from pyfmu_sources.estimators import kalman, kalman_slave
from pyfmu_sources.estimators.kalman_slave import KalmanEstimator

OUTPUTS = [THETA_M, THETA_L, OMEGA_M, T_M, T_SHAFT]


def reference(slave: SlaveBase, name: str) -> int:
    return next(n for n, variable in enumerate(slave.table) if variable.name == name)


def started(kind: type[SlaveBase] = Drivetrain, stop: float | None = None, **starts: float) -> SlaveBase:
    slave = kind(instance_name="test")
    for name, value in starts.items():
        vr = reference(slave, name.replace("__", "."))
        (slave.set_real if vr in slave.real else slave.set_integer)([vr], [value])
    slave.setup_experiment(0.0, stop)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    assert not slave.log_queue
    return slave


def run(slave: SlaveBase, first: int, last: int, amplitude: float = 30.0) -> list[list[float]]:
    rows = []
    for n in range(first, last):
        slave.set_real([U], [amplitude * math.sin(0.03 * n)])
        assert slave.do_step(n * 1e-3, 1e-3), slave.log_queue[-1].msg
        rows.append([*slave.get_real(OUTPUTS), float(slave.get_integer([CONTACT])[0])])
    return rows


def said(slave: SlaveBase) -> tuple[str, str]:
    """Return status name and text of the only message, and forget it."""
    (message,) = slave.log_queue
    slave.log_queue.clear()
    return message.status.name, message.msg


@pytest.mark.parametrize(
    ("time", "step", "status", "text"),
    [
        (0.0, 0.0, "discard", "positive and finite"),
        (0.0, -1e-3, "discard", "positive and finite"),
        (0.0, math.nan, "discard", "positive and finite"),
        (0.0, math.inf, "discard", "positive and finite"),
        (0.5, 1e-3, "discard", "must be 0.0, but is 0.5"),
        (math.nan, 1e-3, "discard", "must be 0.0, but is nan"),
        (0.0, 3.0, "error", "stop time 2.0"),
    ],
)
def test_a_step_that_cannot_be_taken_is_refused_and_changes_nothing(
    time: float, step: float, status: str, text: str
) -> None:
    slave = started(stop=2.0, alpha=0.01)
    twin = started(stop=2.0, alpha=0.01)
    assert slave.do_step(time, step) is False
    got_status, got_text = said(slave)
    assert got_status == status
    assert text in got_text
    assert run(slave, 0, 50) == run(twin, 0, 50)


def test_a_step_outside_step_mode_is_refused() -> None:
    slave = Drivetrain(instance_name="test")
    assert slave.do_step(0.0, 1e-3) is False
    assert said(slave) == ("error", "fmi2DoStep must not be called before initialization")
    slave = started()
    slave.terminate()
    assert slave.do_step(0.0, 1e-3) is False
    assert said(slave) == ("error", "fmi2DoStep must not be called after termination")


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_inputs_that_are_not_finite_are_refused(value: float) -> None:
    slave = started()
    slave.set_real([U], [4.0])
    slave.set_real([U], [value])
    status, text = said(slave)
    assert status == "discard"
    assert text.startswith("`u` must be within")
    assert slave.get_real([U]) == [4.0]


@pytest.mark.parametrize(("name", "value"), [("J_m", 0.0), ("alpha", -1e-3), ("tau", math.nan), ("k", math.inf)])
def test_parameters_out_of_range_are_refused(name: str, value: float) -> None:
    slave = Drivetrain(instance_name="test")
    vr = reference(slave, name)
    before = slave.get_real([vr])
    slave.set_real([vr], [value])
    status, text = said(slave)
    assert (status, f"`{name}`" in text) == ("discard", True)
    assert slave.get_real([vr]) == before


@pytest.mark.parametrize("value", [0, 7, -1])
def test_an_enumeration_takes_its_items_only(value: int) -> None:
    slave = Drivetrain(instance_name="test")
    slave.set_integer([reference(slave, "backlash_model")], [value])
    assert said(slave)[0] == "discard"


def test_what_the_standard_forbids_to_set_is_an_error() -> None:
    slave = started()
    alpha = reference(slave, "alpha")
    for call, vr, value in [
        (slave.set_real, THETA_M, 1.0),
        (slave.set_real, alpha, 0.1),
        (slave.set_real, CONTACT, 1.0),
        (slave.set_real, 4711, 1.0),
        (slave.set_real, -1, 1.0),
        (slave.set_integer, U, 1),
        (slave.set_boolean, U, True),
        (slave.set_string, U, "x"),
    ]:
        before = slave._get_fmu_state()
        call([vr], [value])
        assert said(slave)[0] == "error"
        assert slave._get_fmu_state() == before


def test_reading_by_a_wrong_reference_is_an_error_and_never_raises() -> None:
    slave = started()
    assert math.isnan(slave.get_real([4711])[0])
    assert said(slave)[0] == "error"
    assert slave.get_integer([-1]) == [0]
    assert said(slave)[0] == "error"
    assert slave.get_boolean([U]) == [False]
    assert said(slave)[0] == "error"
    assert slave.get_string([U]) == [""]
    assert said(slave)[0] == "error"


def test_calls_out_of_order_are_errors() -> None:
    slave = Drivetrain(instance_name="test")
    slave.exit_initialization_mode()
    assert said(slave)[0] == "error"
    slave.terminate()
    assert said(slave)[0] == "error"
    slave.setup_experiment(math.nan)
    assert said(slave)[0] == "error"
    slave.enter_initialization_mode()
    slave.setup_experiment(0.0)
    assert said(slave)[0] == "error"


def test_messages_have_no_bare_percent_sign() -> None:
    slave = started()
    slave._failed("100 %", ValueError("5 %d"))
    assert said(slave)[1] == "100 %% failed: ValueError: 5 %%d"


STATES = [
    {"alpha": 0.02},
    {"alpha": 0.02, "backlash_model": 3},
    {"alpha": 0.02, "backlash_model": 4},
    {"alpha": 0.02, "backlash_model": 5},
    {"alpha": 0.02, "effects__input_delay__delay": 4.2e-3, "effects__torque_saturation__limit": 12.0},
    {"alpha": 0.01, "effects__coulomb_friction__motor__torque": 2.0, "effects__extra_resonance__inertia": 0.3},
]


@pytest.mark.parametrize("starts", STATES)
def test_a_restored_state_repeats_bit_for_bit(starts: dict[str, float]) -> None:
    slave = started(**starts)
    run(slave, 0, 137)
    state = slave._get_fmu_state()
    first = run(slave, 137, 300)
    data = slave._fmu_state_to_bytes(state)
    slave._set_fmu_state(state)
    assert run(slave, 137, 300) == first
    other = Drivetrain(instance_name="other")
    other._set_fmu_state(other._fmu_state_from_bytes(data))
    assert run(other, 137, 300) == first
    assert slave._fmu_state_to_bytes(slave._fmu_state_from_bytes(data)) == data
    assert not slave.log_queue + other.log_queue


def test_a_saved_state_is_a_copy() -> None:
    slave = started(alpha=0.02, effects__input_delay__delay=5e-3)
    run(slave, 0, 20)
    state = slave._get_fmu_state()
    before = json.dumps(state)
    run(slave, 20, 60)
    assert json.dumps(state) == before


@given(st.lists(st.floats(), min_size=1, max_size=5))
def test_serialisation_keeps_every_float(values: list[float]) -> None:
    state = {"real": values}
    back = SlaveBase._fmu_state_from_bytes(SlaveBase._fmu_state_to_bytes(state))
    assert list(map(repr, back["real"])) == list(map(repr, values))


@pytest.mark.parametrize(
    "data",
    [b"", b"\xff\xfe", b"[1]", b"{}", b'{"build": "unbuilt"}', b'{"build": "another", "phase": 2}'],
)
def test_a_state_that_is_not_ours_is_refused(data: bytes) -> None:
    slave = started(alpha=0.02)
    run(slave, 0, 20)
    before = slave._get_fmu_state()
    slave._set_fmu_state(slave._fmu_state_from_bytes(data))
    assert said(slave)[0] == "error"
    assert slave._get_fmu_state() == before


def test_input_delay_shifts_the_response_exactly() -> None:
    """A dead time that is no multiple of the step equals a request that comes later, on a finer grid."""
    delayed = started(alpha=0.01, effects__input_delay__delay=2.5e-3)
    plain = started(alpha=0.01)
    time = 0.0
    for n in range(200):
        delayed.set_real([U], [10.0 + n % 7])
        assert delayed.do_step(n * 1e-3, 1e-3)
    for k in range(400):
        asked = (k - 5) // 2
        plain.set_real([U], [10.0 + asked % 7 if k >= 5 else 0.0])
        assert plain.do_step(time, 0.5e-3)
        time += 0.5e-3
    for a, b in zip(delayed.get_real(OUTPUTS), plain.get_real(OUTPUTS), strict=True):
        assert a == pytest.approx(b, rel=1e-11, abs=1e-12)


def test_saturation_clips_the_request() -> None:
    clipped = started(effects__torque_saturation__limit=7.0)
    small = started()
    for n in range(100):
        for slave, u in ((clipped, 100.0), (small, 7.0)):
            slave.set_real([U], [u])
            assert slave.do_step(n * 1e-3, 1e-3)
    assert clipped.get_real(OUTPUTS) == small.get_real(OUTPUTS)


def test_step_sizes_that_differ_by_rounding_count_as_one() -> None:
    slave = started(alpha=0.02)
    time = 0.0
    for n in range(500):
        following = (n + 1) * 1e-3
        assert slave.do_step(time, following - time)
        time = following
    assert len(slave._known) == 1


def test_tables_list_one_value_reference_for_each_variable() -> None:
    for kind in (Drivetrain, LqrController, KalmanEstimator):
        names = [variable.name for variable in kind.table]
        assert len(set(names)) == len(names)
        for variable in kind.table:
            assert set(variable.depends_on + variable.starts_from) <= set(names)
            unit_exponents(variable.unit or "1")
    assert Drivetrain.table[FIRST_PARAMETER].name == "J_m"
    assert [v.name for v in Drivetrain.table[:9]] == [
        "u",
        "T_l",
        "theta_m",
        "theta_l",
        "omega_m",
        "omega_l",
        "T_m",
        "T_shaft",
        "contact",
    ]
    assert LqrController.table[lqr_slave.U].name == "u"
    assert LqrController.table[lqr_slave.SAMPLE_TIME].name == "sample_time"
    places = {"FIRST_A": "A_d[1,1]", "FIRST_B": "B_d[1]", "FIRST_K": "K_f[1,1]", "FIRST_S": "S_inv[1,1]"}
    for constant, name in places.items():
        assert KalmanEstimator.table[getattr(kalman_slave, constant)].name == name


@pytest.mark.parametrize(
    ("unit", "exponents"),
    [
        ("1", {}),
        ("N.m", {"kg": 1, "m": 2, "s": -2}),
        ("N.m.s2/rad2", {"kg": 1, "m": 2, "rad": -2}),
        ("rad/(N.m)", {"rad": 1, "kg": -1, "m": -2, "s": 2}),
        ("1/s", {"s": -1}),
    ],
)
def test_units_in_base_units(unit: str, exponents: dict[str, int]) -> None:
    assert unit_exponents(unit) == exponents


def test_an_unknown_unit_is_named() -> None:
    with pytest.raises(ValueError, match="furlong"):
        unit_exponents("N.furlong")


# --- Sampled slaves ---------------------------------------------------------------------------------------------


def controller() -> SlaveBase:
    return started(LqrController, **{"K[1]": 2.0, "K[3]": 3.0, "u_max": 50.0, "sample_time": 1e-3})


def test_a_controller_holds_between_samples() -> None:
    slave = controller()
    requests = []
    for n in range(8):
        slave.set_real([lqr_slave.REFERENCE], [float(n + 1)])
        assert slave.do_step(n * 0.25e-3, 0.25e-3)
        requests += slave.get_real([lqr_slave.U])
    assert requests[0] == requests[1] == requests[2] == 0.0
    assert requests[3] == requests[4] == requests[6] == pytest.approx(4.0 * (2.0 * 3.984 + 3.0))
    assert requests[7] > requests[6]


def test_a_step_over_a_sample_takes_it_with_the_held_inputs_and_warns_once() -> None:
    slave = controller()
    slave.set_real([lqr_slave.REFERENCE], [1.0])
    assert slave.do_step(0.0, 0.7e-3)
    slave.set_real([lqr_slave.REFERENCE], [2.0])
    assert slave.do_step(0.7e-3, 0.7e-3)
    status, text = said(slave)
    assert status == "warning"
    assert "divides `sample_time`" in text
    assert slave.get_real([lqr_slave.U]) == [pytest.approx(2.0 * (2.0 * 3.984 + 3.0))]
    assert slave.do_step(1.4e-3, 1.6e-3)
    assert slave._samples == 3
    assert slave.do_step(3.0e-3, 1.5e-3)
    assert not slave.log_queue


def test_an_output_read_after_inputs_were_set_takes_the_sample_anew() -> None:
    """So that hosts which step all slaves side by side see the values of those that step in order."""
    before, after = controller(), controller()
    before.set_real([lqr_slave.REFERENCE], [2.0])
    before.do_step(0.0, 1e-3)
    after.do_step(0.0, 1e-3)
    after.set_real([lqr_slave.REFERENCE], [2.0])
    assert after.get_real([lqr_slave.U]) == before.get_real([lqr_slave.U])
    after.do_step(1e-3, 0.5e-3)
    after.set_real([lqr_slave.REFERENCE], [3.0])
    assert after.get_real([lqr_slave.U]) == before.get_real([lqr_slave.U])


def test_the_estimator_slave_is_the_filter() -> None:
    slave = started(KalmanEstimator)
    names = [variable.name for variable in slave.table]
    values = {name: 0.01 * n for n, name in enumerate(names) if "[" in name}
    slave = started(KalmanEstimator, **values)
    A = tuple(tuple(values[f"A_d[{r},{c}]"] for c in range(1, 7)) for r in range(1, 7))
    B = tuple(values[f"B_d[{r}]"] for r in range(1, 7))
    K = tuple(tuple(values[f"K_f[{r},{c}]"] for c in (1, 2)) for r in range(1, 7))
    weight = (values["S_inv[1,1]"], values["S_inv[1,2]"], values["S_inv[2,2]"])
    x = (0.0,) * 6
    for n, (u, y) in enumerate(itertools.product([1.0, -2.0], [0.1, 0.2])):
        slave.set_real([kalman_slave.U, kalman_slave.THETA_M, kalman_slave.THETA_L], [u, y, -y])
        assert slave.do_step(n * 1e-3, 1e-3)
        x, e_m, e_l, square = kalman.update(x, u, y, -y, A, B, K, weight)
        outputs = slave.get_real(list(range(kalman_slave.FIRST_ESTIMATE, kalman_slave.SAMPLE_TIME)))
        assert outputs == [*x, e_m, e_l, square]


@pytest.mark.parametrize("kind", [LqrController, KalmanEstimator])
def test_sampled_slaves_repeat_from_a_saved_state(kind: type[SlaveBase]) -> None:
    slave = started(kind)
    gains = {v.name: 0.3 for v in kind.table if "[" in v.name}
    slave = started(kind, **gains)
    outputs = [n for n, v in enumerate(kind.table) if v.causality == "output"]

    def go(machine: SlaveBase) -> list[list[float]]:
        rows = []
        for n in range(5, 25):
            machine.set_real([0, 1, 2], [0.1 * n, 0.2, -0.1 * n])
            assert machine.do_step(n * 0.5e-3, 0.5e-3)
            rows.append(machine.get_real(outputs))
        return rows

    for n in range(5):
        slave.do_step(n * 0.5e-3, 0.5e-3)
    data = slave._fmu_state_to_bytes(slave._get_fmu_state())
    first = go(slave)
    other = kind(instance_name="other")
    other._set_fmu_state(other._fmu_state_from_bytes(data))
    assert go(other) == first
