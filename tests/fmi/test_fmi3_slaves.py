"""FMUs of FMI 3.0 as slaves, without event mode: every type, arrays, statuses, both loops."""

from pathlib import Path

import numpy as np
import pytest

import orchestrator.master.session as session_module
from orchestrator.api.simulate import simulate
from orchestrator.errors import FmuError, SlaveError
from orchestrator.fmi.instances import fmu_instance, make_slave
from orchestrator.fmi.model_description import read_description
from orchestrator.master.algorithms import Adaptive, GaussSeidel, Iterated, Jacobi
from orchestrator.master.protocol import RunEndedError
from orchestrator.master.result import MACHINE_CODE, PYTHON, Recording
from orchestrator.master.session import Session
from orchestrator.master.signals import Sine, Square
from orchestrator.master.system import Connection, SignalSource, System
from tests.support.c_fmu import have_compiler
from tests.support.typed3_fmu import build_typed3_fmu

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")

NAMES = ("y[1]", "y[2]", "m", "k", "g", "c", "r", "d", "o")
RECORD = tuple(f"{instance}.{name}" for instance in "ab" for name in NAMES)


@pytest.fixture(scope="module")
def typed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_typed3_fmu(tmp_path_factory.mktemp("typed3"))


def system(path: Path) -> System:
    """Two in a chain that feeds back: every type is sent and received in both directions."""
    pairs = ("y[1] u[2]", "m n", "k w", "g f", "c b", "r e", "d s", "o h")
    ends = [pair.split() for pair in pairs]
    connections = [Connection(f"{a}.{s}", f"{b}.{t}") for a, b in ("ab", "ba") for s, t in ends if (b, t) != ("a", "w")]
    sources = [SignalSource(f"{name}.u[1]", Sine(3.0, 5.0)) for name in "ab"]
    sources += [SignalSource("a.w", Square(1.0, 0.02, offset=2.0))]
    start = {"e": 2, "n": 1, "h": 3, "s": 1, "f": 0.25, "p[3]": 0.5, "label": "x"}
    instances = (fmu_instance("a", path, start), fmu_instance("b", path, {"p[2]": 7.0}))
    return System(instances, tuple(connections), tuple(sources))


def run(path: Path, kind: type, compiled: bool, stop: float = 0.03) -> Recording:
    with Session(system(path), RECORD, kind(1e-3, compiled=compiled), stop) as session:
        session.run()
        return session.run()


@pytest.mark.parametrize("kind", [GaussSeidel, Jacobi])
def test_every_type_has_the_same_bits_in_machine_code(typed: Path, kind: type, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session_module, "COMPILED_FROM", 0)
    quick, slow = run(typed, kind, True), run(typed, kind, False)
    assert (quick.statistics.loop, slow.statistics.loop) == (MACHINE_CODE, PYTHON)
    assert quick.values.tobytes() == slow.values.tobytes()
    for name in RECORD:
        assert np.ptp(quick[name]) > 0.0, name
    assert set(np.unique(quick["a.r"])) == {1.0, 2.0, 3.0}


def test_elements_of_arrays_are_set_one_by_one_and_the_others_stay(typed: Path) -> None:
    slave = make_slave("a", typed)
    slave.set({"p[2]": 5.0, "label": "here"})
    assert slave.get(["p[1]", "p[2]", "p[3]", "label", "p[2]"]) == [1.0, 5.0, 3.0, "here", 5.0]
    slave.set({"p[3]": 6.0})
    assert slave.get(["p[3]", "p[2]", "p[1]"]) == [6.0, 5.0, 1.0]
    slave.begin(0.0, None, None)
    buffer = np.array([4.0])
    slave.sends(["u[2]"], buffer)()
    assert slave.get(["u[1]", "u[2]"]) == [0.0, 4.0]
    slave.start()
    slave.terminate()
    slave.reset()
    slave.set({"p[1]": 9.0})
    assert slave.get(["p[1]", "p[2]", "p[3]"]) == [9.0, 2.0, 3.0]
    slave.close()


@pytest.mark.parametrize(
    ("name", "value"), [("n", 128), ("n", -129), ("w", -1), ("h", 65536), ("s", 40000), ("b", 2), ("e", "four")]
)
def test_values_that_a_type_cannot_hold_are_refused(typed: Path, name: str, value: int) -> None:
    both = System((fmu_instance("a", typed),))
    taken, text = both.start_value(f"a.{name}", value)
    assert taken is None
    assert text is not None
    assert text.startswith("must ")


def scenario(
    folder: Path, *macros: str, algorithm: str = "gauss_seidel", step: float = 0.01, saves: bool = True
) -> Path:
    build_typed3_fmu(folder, *macros, saves=saves)
    path = folder / "run.toml"
    path.write_text(
        f'stop = 1.0\nrecord = ["a.y[1]", "a.m"]\n[master]\nalgorithm = "{algorithm}"\nstep = {step}\n'
        '[instances.a]\nfmu = "Typed.fmu"\n[[sources]]\nto = "a.u[1]"\nkind = "constant"\nvalue = 1.0\n'
        '[[sources]]\nto = "a.u[2]"\nkind = "constant"\nvalue = 1.0\n'
    )
    return path


BOTH_LOOPS = pytest.mark.parametrize("step", [0.01, 0.0004])


@BOTH_LOOPS
def test_warnings_are_counted_and_the_first_is_shown(tmp_path: Path, step: float) -> None:
    result = simulate(scenario(tmp_path, "WARNS_FROM=0.5", step=step))
    assert result["a.y[1]"][-1] == pytest.approx(2.0)
    (remark,) = result.run.remarks
    assert (remark.instance, remark.count) == ("a", round(0.5 / step))
    assert remark.text == "fmi3DoStep at t = 0.5 s returned Warning: near the limit"


@pytest.mark.parametrize(
    ("step", "algorithm"), [(0.01, "gauss_seidel"), (0.0004, "gauss_seidel"), (0.0004, "jacobi"), (0.01, "iterated")]
)
def test_a_run_that_an_fmu_ends_keeps_what_it_has(tmp_path: Path, step: float, algorithm: str) -> None:
    """The step that asks for the end has been done: its row is there, of all instances."""
    path = scenario(tmp_path, "ENDS_AT=0.7 - 1e-9", step=step, algorithm=algorithm)
    path.write_text(
        path.read_text().replace('record = ["a.', 'record = ["b.y[1]", "a.')
        + '[instances.b]\nfmu = "Typed.fmu"\n[[connections]]\nfrom = "a.y[1]"\nto = "b.u[1]"\n'
    )
    result = simulate(path)
    end = 0.7 + step
    assert result.time[-1] == pytest.approx(end)
    assert np.allclose(result["a.y[1]"], 2.0 * result.time)
    assert result["b.y[1]"][-1] == pytest.approx(end + end**2, abs=2.0 * step)
    (remark,) = result.run.remarks
    assert (remark.instance in "ab", remark.text) == (
        True,
        f"ended the run at t = {end:g} s of 1 s (fmi3DoStep, terminateSimulation)",
    )


@BOTH_LOOPS
@pytest.mark.parametrize("share", [-0.25, 0.5])
def test_a_time_other_than_asked_is_noted(tmp_path: Path, step: float, share: float) -> None:
    """Which FMI 3.0 allows: a solver of steps of its own cannot always come to where it is asked to."""
    result = simulate(scenario(tmp_path, f"STRAYS_BY={share}", step=step))
    assert result["a.y[1]"][-1] == pytest.approx(2.0)
    (remark,) = result.run.remarks
    assert (remark.instance, remark.count) == ("a", round(1.0 / step))
    text = f"fmi3DoStep from t = 0 s came to another time than asked, such steps by up to {abs(share) * step:g} s"
    assert remark.text == f"{text}: its outputs are those of its own time"


@BOTH_LOOPS
def test_a_time_that_differs_by_rounding_is_no_other(tmp_path: Path, step: float) -> None:
    assert simulate(scenario(tmp_path, "STRAYS_BY=1e-8", step=step)).run.remarks == ()


@BOTH_LOOPS
@pytest.mark.parametrize(
    ("macros", "text"),
    [
        (("FAILS_AT=0.3", "FAILS_WITH=fmi3Error"), "a: fmi3DoStep at t = 0.3.* returned Error: the solver failed"),
        (("FAILS_AT=0.3", "FAILS_WITH=fmi3Fatal"), "a: fmi3DoStep at t = 0.3.* returned Fatal: the solver failed"),
        (("FAILS_AT=0.3", "FAILS_WITH=7"), "a: fmi3DoStep at t = 0.3.* returned 7"),
        (("RETURNS_EARLY",), "a: fmi3DoStep at t = 0 s must do a whole step.* its lastSuccessfulTime is 0.0.* s"),
        (("STRAYS_BY=NAN",), "a: fmi3DoStep at t = 0 s must do a whole step.* its lastSuccessfulTime is -?nan s"),
        (("FAILS_AT=0.3", "FAILS_WITH=fmi3Discard"), "steps from t = 0.3.* must be done, but even those of"),
    ],
)
def test_a_step_that_fails_ends_the_run(tmp_path: Path, step: float, macros: tuple[str, ...], text: str) -> None:
    with pytest.raises(SlaveError, match=text):
        simulate(scenario(tmp_path, *macros, step=step))


@BOTH_LOOPS
@pytest.mark.parametrize("saves", [True, False])
def test_steps_that_are_discarded_are_done_in_shorter_ones(tmp_path: Path, step: float, saves: bool) -> None:
    result = simulate(scenario(tmp_path, f"DISCARDS_ABOVE={0.6 * step}", step=step, saves=saves))
    assert result["a.y[1]"][-1] == pytest.approx(2.0)
    (remark,) = result.run.remarks
    assert remark.count == round(1.0 / step)
    assert remark.text.startswith("the step at t = 0 s was discarded: done in shorter steps")


@pytest.mark.parametrize("algorithm", ["jacobi", "iterated", "adaptive"])
def test_other_algorithms_run_it_too(tmp_path: Path, algorithm: str) -> None:
    result = simulate(scenario(tmp_path, algorithm=algorithm))
    assert result["a.y[1]"][-1] == pytest.approx(2.0)


def test_an_instance_that_failed_is_never_called_again(tmp_path: Path) -> None:
    path = build_typed3_fmu(tmp_path, "FAILS_AT=0", "FAILS_WITH=fmi3Fatal")
    slave = make_slave("a", path)
    slave.begin(0.0, None, None)
    slave.start()
    with pytest.raises(SlaveError, match="Fatal"):
        slave.do_step(0.0, 0.1)
    for call in (lambda: slave.do_step(0.0, 0.1), slave.reset, lambda: slave.get(["m"]), slave.get_state):
        with pytest.raises(SlaveError, match="must not be called after a failure"):
            call()
    slave.close()


def test_the_end_of_the_run_is_told_from_failure(tmp_path: Path) -> None:
    slave = make_slave("a", build_typed3_fmu(tmp_path, "ENDS_AT=0"))
    slave.begin(0.0, None, None)
    slave.start()
    with pytest.raises(RunEndedError, match=r"a: fmi3DoStep at t = 0 s asked for the end of the run"):
        slave.do_step(0.0, 0.1)
    slave.close()


def test_a_binary_without_a_function_that_is_needed_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FmuError, match="must have fmi3SetString, but has not"):
        make_slave("a", build_typed3_fmu(tmp_path, "LACKS_SETSTRING"))


def test_once_per_process_holds_for_fmi_3_too(tmp_path: Path) -> None:
    path = build_typed3_fmu(tmp_path, attributes='canBeInstantiatedOnlyOncePerProcess="true"')
    first = make_slave("a", path)
    with pytest.raises(FmuError, match="may be instantiated only once per process, but is twice"):
        make_slave("b", path)
    first.close()
    make_slave("c", path).close()


def test_two_instances_of_an_fmu_for_one_per_process_run_in_processes_of_their_own(tmp_path: Path) -> None:
    build_typed3_fmu(tmp_path, attributes='canBeInstantiatedOnlyOncePerProcess="true"')
    path = tmp_path / "two.toml"
    path.write_text(
        'stop = 0.1\nrecord = ["b.y[2]", "b.m"]\n[master]\nstep = 0.01\n[instances.a]\nfmu = "Typed.fmu"\n'
        '[instances.b]\nfmu = "Typed.fmu"\n[[connections]]\nfrom = "a.y[1]"\nto = "b.u[2]"\n'
    )
    result = simulate(path)
    assert result["b.y[2]"][-1] == pytest.approx(3.0 * 0.01 * sum(0.01 * n for n in range(11)))


@pytest.mark.parametrize("algorithm", [Iterated(0.01), Adaptive(0.01, tolerance=1e-4)])
def test_states_go_back(typed: Path, algorithm: Iterated | Adaptive) -> None:
    assert read_description(typed).model.can_save_state
    sources = (SignalSource("a.u[1]", Sine(3.0, 5.0)),)
    with Session(System((fmu_instance("a", typed),), (), sources), ("a.y[1]",), algorithm, 0.1) as session:
        first = session.run().values
        assert first.tobytes() == session.run().values.tobytes()
