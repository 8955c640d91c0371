"""Structure, call order and fixed-step masters, on slaves made of functions."""

import numpy as np
import pytest

from orchestrator.errors import ConnectionMismatchError, ConvergenceError, ScenarioError, SlaveError
from orchestrator.master.algorithms import GaussSeidel, Iterated, Jacobi, step_count
from orchestrator.master.fixed_point import solve_fixed_point
from orchestrator.master.graph import components
from orchestrator.master.protocol import RunEndedError, Unit
from orchestrator.master.session import Session
from orchestrator.master.signals import Constant, Noise, Samples, Square, Step, Table
from orchestrator.master.system import Connection, Quantity, SignalSource, System
from orchestrator.master.units import conversion, resolve
from tests.support.mock_slave import instance, model, variable

DEGREE = Unit("degree", (0, 0, 0, 0, 0, 0, 0, 1), np.pi / 180.0)
RADIAN = Unit("rad", (0, 0, 0, 0, 0, 0, 0, 1))
TORQUE = Unit("N.m", (1, 2, -2, 0, 0, 0, 0, 0))

PLANT = model("Plant", variable("u", "input"), variable("y", "output"))
ESTIMATOR = model(
    "Estimator",
    variable("u", "input"),
    variable("y", "input"),
    variable("x_hat", "output"),
    feedthrough={"x_hat": ["y"]},
)
CONTROLLER = model(
    "Controller",
    variable("reference", "input"),
    variable("x_hat", "input"),
    variable("u", "output"),
    feedthrough={"u": ["reference", "x_hat"]},
)


def plant(v, time, step) -> None:
    v["y"] += step * v["u"]


def estimator(v, time, step) -> None:
    v["x_hat"] = v["y"]


def controller(v, time, step) -> None:
    v["u"] = 3.0 * (v["reference"] - v["x_hat"])


def sampled_loop(calls=None, shuffled=(2, 0, 1)) -> System:
    instances = (
        instance("plant", PLANT, plant, calls=calls),
        instance("estimator", ESTIMATOR, estimator, calls=calls),
        instance("controller", CONTROLLER, controller, calls=calls),
    )
    connections = (
        Connection("controller.u", "plant.u"),
        Connection("controller.u", "estimator.u"),
        Connection("plant.y", "estimator.y"),
        Connection("estimator.x_hat", "controller.x_hat"),
    )
    return System(
        tuple(instances[k] for k in shuffled), connections, (SignalSource("controller.reference", Constant(1.0)),)
    )


@pytest.mark.parametrize("shuffled", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
def test_order_of_a_sampled_loop_emerges_from_direct_feedthrough(shuffled) -> None:
    system = sampled_loop(shuffled=shuffled)
    assert system.execution_order() == ("plant", "estimator", "controller")
    assert system.loops() == []


def test_sampled_loop_is_exact_under_gauss_seidel() -> None:
    h, steps = 0.1, 20
    with Session(sampled_loop(), ("plant.y", "controller.u"), GaussSeidel(h), h * steps) as session:
        result = session.run()
    y, u, expected = 0.0, 0.0, [0.0]
    for _ in range(steps):
        y += h * u
        u = 3.0 * (1.0 - y)
        expected.append(y)
    np.testing.assert_allclose(result["plant.y"], expected, rtol=0, atol=1e-15)


def test_jacobi_takes_the_values_of_the_start_of_the_step() -> None:
    h, steps = 0.1, 20
    with Session(sampled_loop(), ("plant.y",), Jacobi(h), h * steps) as session:
        result = session.run()
    y, x_hat, u, expected = 0.0, 0.0, 0.0, [0.0]
    for _ in range(steps):
        y, x_hat, u = y + h * u, y, 3.0 * (1.0 - x_hat)
        expected.append(y)
    np.testing.assert_allclose(result["plant.y"], expected, rtol=0, atol=1e-15)


def test_calls_keep_to_the_contract_and_runs_repeat() -> None:
    calls: list[str] = []
    with Session(sampled_loop(calls), ("plant.y",), GaussSeidel(0.1), 0.2) as session:
        first = session.run()
        made = [c for c in calls if c.startswith("plant.")]
        calls.clear()
        second = session.run()
    np.testing.assert_array_equal(first.values, second.values)
    assert calls.count("plant.reset") == 1
    assert made[0] == "plant.begin"
    assert made.index("plant.start") < made.index("plant.do_step")
    assert made[made.index("plant.start") + 1 :] == [
        "plant.receive",
        *["plant.send", "plant.do_step", "plant.receive"] * 2,
        "plant.terminate",
    ]


def test_start_values_override_and_are_checked() -> None:
    with Session(sampled_loop(), ("plant.y",), GaussSeidel(0.1), 0.2) as session:
        assert session.run({"plant.u": 0.0})["plant.y"][0] == 0.0
        with pytest.raises(ScenarioError, match=r"\$\.plant\.u: must be a finite number"):
            session.run({"plant.u": float("nan")})
        with pytest.raises(ScenarioError, match="did you mean"):
            session.run({"plant.uu": 1.0})


def test_a_failed_slave_is_replaced_by_the_next_run() -> None:
    broken = [True]

    def step(v, time, h) -> None:
        if broken[0] and time > 0.05:
            raise SlaveError("plant: broke")

    system = System((instance("plant", PLANT, step),), (), (SignalSource("plant.u", Constant(0.0)),))
    with Session(system, ("plant.y",), GaussSeidel(0.1), 0.2) as session:
        with pytest.raises(SlaveError, match="plant: broke"):
            session.run()
        broken[0] = False
        assert len(session.run().time) == 3


# Checks -----------------------------------------------------------------------------------------------------------


def two(a_unit, b_unit, **more) -> System:
    a = model("A", variable("y", "output", unit=a_unit and a_unit.name), units=[a_unit] if a_unit else [])
    b = model("B", variable("u", "input", unit=b_unit and b_unit.name), units=[b_unit] if b_unit else [])
    constant = lambda v, t, h: v.update(y=180.0)  # noqa: E731
    instances = (instance("a", a, constant), instance("b", b, lambda v, t, h: None))
    return System(instances, (Connection("a.y", "b.u", **more),))


def test_units_are_converted() -> None:
    with Session(two(DEGREE, RADIAN, offset=1.0), ("b.u",), GaussSeidel(1.0), 1.0) as session:
        assert session.run()["b.u"][-1] == pytest.approx(np.pi + 1.0, rel=1e-15)


def test_values_are_rounded_to_the_quantum() -> None:
    with Session(two(None, None, factor=1.0 / 7.0, quantum=0.5), ("b.u",), GaussSeidel(1.0), 1.0) as session:
        assert session.run()["b.u"][-1] == 25.5


def test_units_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ConnectionMismatchError, match=r"\$\.connections\[0\]\.to: must have a unit .*degree.*N\.m"):
        two(DEGREE, TORQUE).check()
    with pytest.raises(ConnectionMismatchError, match=r"\$\.connections\[0\]\.unit"):
        two(DEGREE, RADIAN, unit="rad").check()


def test_conversion_table() -> None:
    assert conversion(resolve("rpm", {}), resolve("rad/s", {})) == (pytest.approx(np.pi / 30.0), 0.0)
    celsius = Unit("degC", (0, 0, 0, 0, 1, 0, 0, 0), 1.0, 273.15)
    kelvin = Unit("K", (0, 0, 0, 0, 1, 0, 0, 0))
    assert conversion(celsius, kelvin) == (1.0, 273.15)
    assert conversion(kelvin, celsius) == (1.0, -273.15)
    assert conversion(Unit("odd"), Unit("odd")) == (1.0, 0.0)
    assert conversion(Unit("odd"), Unit("even")) is None
    assert conversion(None, kelvin) == (1.0, 0.0)


def test_all_problems_are_listed_with_their_paths() -> None:
    system = System(
        sampled_loop().instances,
        (
            Connection("plant.y", "estimator.y"),
            Connection("plant.u", "estimator.u"),
            Connection("plant.y", "controller.u"),
            Connection("nobody.y", "controller.x_hat", quantum=-1.0),
            Connection("estimator.x_hat", "estimator.y"),
        ),
        (SignalSource("plant.y", Constant(0.0)), SignalSource("plant.u", Constant(0.0), unit="rad", at="middle")),
        order=("plant", "controller"),
    )
    found = {p.path: p.text for p in system.problems()}
    assert set(found) == {
        "$.connections[1].from",
        "$.connections[2].to",
        "$.connections[3].from",
        "$.connections[3].quantum",
        "$.connections[4].to",
        "$.sources[0].to",
        "$.sources[1].at",
        "$.master.order",
    }
    assert "of causality input" in found["$.connections[1].from"]


def test_types_are_checked() -> None:
    a = model(
        "A", variable("b", "output", start=False, kind="Boolean"), variable("n", "output", start=1, kind="Integer")
    )
    b = model("B", variable("x", "input"), variable("flag", "input", start=False, kind="Boolean"))
    instances = (instance("a", a, lambda v, t, h: None), instance("b", b, lambda v, t, h: None))
    assert System(instances, (Connection("a.n", "b.x"), Connection("a.b", "b.flag"))).problems() == []
    wrong = System(instances, (Connection("a.b", "b.x"), Connection("a.b", "b.flag", factor=2.0)))
    assert [p.path for p in wrong.problems()] == ["$.connections[0].to", "$.connections[1].to"]


def test_bounds_and_enumerations() -> None:
    kind = variable("kind", "parameter", start=1, kind="Enumeration", items=(("soft", 1), ("hard", 2)))
    size = variable("size", "parameter", minimum=0.0, maximum=2.0, unit="rad")
    system = System((instance("a", model("A", kind, size, units=[RADIAN]), lambda v, t, h: None),))
    assert system.start_value("a.kind", "hard") == (2, None)
    assert "did you mean 'soft'" in str(system.start_value("a.kind", "sft")[1])
    assert system.start_value("a.size", Quantity(90.0, "deg"))[0] == pytest.approx(np.pi / 2.0)
    assert "must lie in [0, 2]" in str(system.start_value("a.size", 2.5)[1])
    assert "must be given in a unit" in str(system.start_value("a.size", Quantity(1.0, "N.m"))[1])


@pytest.mark.parametrize(
    ("start", "stop", "step"),
    [(0, 2, 0.0), (0, 2, -1), (0, 2, np.nan), (2, 1, 0.1), (0, np.inf, 1), (0, 1, 1e-12), (0, 1, 0.3)],
)
def test_times_that_make_no_grid(start, stop, step) -> None:
    with pytest.raises(ScenarioError):
        step_count(start, stop, step)


def test_time_is_never_accumulated() -> None:
    times: list[float] = []
    system = System((instance("a", PLANT, lambda v, t, h: times.append(t)),), (), (SignalSource("a.u", Constant(0.0)),))
    with Session(system, ("a.y",), GaussSeidel(1e-3), 2.0) as session:
        session.run()
    assert times == [n * 1e-3 for n in range(2000)]


# Algebraic loops ----------------------------------------------------------------------------------------------------

GAIN = model(
    "Gain",
    variable("u", "input"),
    variable("k", "parameter"),
    variable("c", "parameter"),
    variable("y", "output"),
    feedthrough={"y": ["u"]},
)


def gain(v, time=0.0, step=0.0) -> None:
    v["y"] = v["k"] * v["u"] + v["c"]


def ring(k: float) -> System:
    instances = (instance("a", GAIN, gain, gain, k=k, c=1.0), instance("b", GAIN, gain, gain, k=k, c=2.0))
    return System(instances, (Connection("a.y", "b.u"), Connection("b.y", "a.u")))


@pytest.mark.parametrize("k", [0.5, -3.0])
def test_algebraic_loop_is_solved_also_where_plain_iteration_diverges(k: float) -> None:
    system = ring(k)
    assert system.loops() == [("a", "b")]
    with Session(system, ("a.y", "b.y"), Iterated(0.1, tolerance=1e-12), 0.3) as session:
        result = session.run()
    a, b = np.linalg.solve([[1.0, -k], [-k, 1.0]], [1.0, 2.0])
    np.testing.assert_allclose(result.values, np.tile([[a], [b]], 4), rtol=1e-10)


def test_an_instance_that_feeds_itself_is_a_loop_too() -> None:
    system = System((instance("a", GAIN, gain, gain, k=0.5, c=1.0),), (Connection("a.y", "a.u"),))
    with Session(system, ("a.y",), Iterated(0.1, tolerance=1e-12), 0.3) as session:
        np.testing.assert_allclose(session.run()["a.y"], 2.0, rtol=1e-10)


def test_a_loop_through_a_state_takes_each_step_once() -> None:
    store = model(
        "Store", variable("u", "input"), variable("x", "parameter"), variable("y", "output"), feedthrough={"y": ["u"]}
    )

    def fill(v) -> None:
        v["y"] = v["x"] + 0.2 * v["u"]

    def advance(v, time: float, step: float) -> None:
        v["x"] += step * v["u"]

    instances = (instance("a", store, advance, fill), instance("b", GAIN, gain, gain, k=0.5, c=1.0))
    system = System(instances, (Connection("a.y", "b.u"), Connection("b.y", "a.u")))
    with Session(system, ("a.y",), Iterated(0.1, tolerance=1e-13), 1.0) as session:
        found = session.run()["a.y"]
    x, expected = 0.0, [0.2 / 0.9]
    for _ in range(10):
        y = (x + 0.3) / (1.0 - 0.5 * 0.3)  # y = x + 0.1 u + 0.2 u with u = 0.5 y + 1
        x += 0.1 * (0.5 * y + 1.0)
        expected.append(y)
    np.testing.assert_allclose(found, expected, rtol=1e-10)


@pytest.mark.parametrize(("wanted", "rows"), [(0.2, 3), (0.15, 2)])
def test_a_loop_of_which_one_ends_the_run_settles_first(wanted: float, rows: int) -> None:
    """At a communication point, whose row is there, or on the way to it."""

    def ends(v, time: float, step: float) -> None:
        gain(v)
        if time + step >= wanted - 1e-9:
            raise RunEndedError("a: the end", "a", min(time + step, wanted), "as it wants")

    instances = (instance("a", GAIN, ends, gain, k=0.5, c=1.0), instance("b", GAIN, gain, gain, k=0.5, c=2.0))
    system = System(instances, (Connection("a.y", "b.u"), Connection("b.y", "a.u")))
    with Session(system, ("a.y", "b.y"), Iterated(0.1, tolerance=1e-12), 0.3) as session:
        result = session.run(allow_early_end=True)
    a, b = np.linalg.solve([[1.0, -0.5], [-0.5, 1.0]], [1.0, 2.0])
    np.testing.assert_allclose(result.values, np.tile([[a], [b]], rows), rtol=1e-10)
    assert [r.text for r in result.remarks] == [f"ended the run at t = {wanted:g} s of 0.3 s (as it wants)"]


def test_loop_without_solution_is_an_error_with_advice() -> None:
    with (
        Session(ring(1.0), ("a.y",), Iterated(0.1), 0.3) as session,
        pytest.raises(ConvergenceError, match=r"loop may have no solution|take a smaller step"),
    ):
        session.run()


def test_fixed_point_of_a_nonlinear_map() -> None:
    point = np.zeros(2)

    def sweep(x):
        point[:] = np.cos(x[0]) + 0.1 * x[1], np.exp(-x[0]) - 2.0 * x[1]
        return point.copy()

    calls = solve_fixed_point(sweep, np.array([1.0, 0.0]), 1e-12, 30, "map")
    assert calls < 15
    np.testing.assert_allclose(
        [np.cos(point[0]) + 0.1 * point[1], np.exp(-point[0]) - 2.0 * point[1]], point, atol=1e-10
    )


# Graph and signals ----------------------------------------------------------------------------------------------------


def test_components_are_sorted_and_stable() -> None:
    edges = {"e": ["a"], "a": ["b"], "b": ["c", "a"], "d": ["c"], "c": []}
    assert components(list("abcde"), edges) == [("d",), ("e",), ("a", "b"), ("c",)]


def test_signals_jump_on_the_grid() -> None:
    times = np.arange(2001) * 1e-3
    assert Step(0.3, 1.0).sample(times).argmax() == 300
    square = Square(1.0, 0.2).sample(times)
    assert list(np.flatnonzero(np.diff(square))[:3] + 1) == [100, 200, 300]
    held = Samples(np.arange(10.0), 0.1).sample(times)
    assert list(np.flatnonzero(np.diff(held)) + 1) == list(range(100, 1000, 100))
    assert Table((0.0, 0.5), (1.0, 2.0), hold=True).sample(times)[500] == 2.0
    assert Square(1.0, 0.2).breaks(0.0, 0.35) == pytest.approx([0.1, 0.2, 0.3])


def test_noise_depends_on_seed_and_period_only() -> None:
    short = Noise(0.1, 7, 1e-3).sample(np.arange(100) * 1e-3)
    long = Noise(0.1, 7, 1e-3).sample(np.arange(10_000) * 1e-3)
    np.testing.assert_array_equal(short, long[:100])
    assert long.std() == pytest.approx(0.1, rel=0.03)
    assert not np.array_equal(short, Noise(0.1, 8, 1e-3).sample(np.arange(100) * 1e-3))


def test_noise_is_added_to_what_is_connected_at_the_same_instant() -> None:
    noise = Samples(np.arange(6.0) * 100.0, 0.1)
    base = sampled_loop()
    system = System(base.instances, base.connections, (*base.sources, SignalSource("estimator.y", noise)))
    with Session(system, ("plant.y", "estimator.y"), GaussSeidel(0.1), 0.5) as session:
        result = session.run()
    np.testing.assert_allclose(result["estimator.y"] - result["plant.y"], np.arange(6.0) * 100.0, atol=1e-9)


@pytest.mark.parametrize("stop", [0.2000003, 0.205, 0.25])
def test_the_stop_time_is_on_the_grid(stop: float) -> None:
    assert step_count(0.0, 0.2 * (1.0 + 1e-9), 0.1) == 2
    with pytest.raises(ScenarioError, match="`stop` must be a whole number of steps"):
        step_count(0.0, stop, 0.1)
