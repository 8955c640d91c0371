"""The loop in machine code with FMUs in C: every numeric type, the same bits and errors as the Python loop."""

from pathlib import Path

import numpy as np
import pytest

import orchestrator.master.compiled as compiled_module
import orchestrator.master.session as session_module
from orchestrator.errors import SlaveError
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel, Jacobi
from orchestrator.master.result import MACHINE_CODE, PYTHON, Recording
from orchestrator.master.session import Session
from orchestrator.master.signals import Sine, Square
from orchestrator.master.system import Connection, SignalSource, System
from tests.support.c_fmu import have_compiler
from tests.support.mixed_fmu import build_mixed_fmu

pytestmark = pytest.mark.skipif(not have_compiler(), reason="no C compiler")

RECORD = ("b.y", "b.m", "b.c", "a.y", "a.m", "a.c", "b.u")


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_mixed_fmu(tmp_path_factory.mktemp("mixed"))


def system(path: Path) -> System:
    """Two in a chain that feeds back: every type is sent and received in both directions."""
    connections = (
        Connection("a.y", "b.u", factor=2.0, offset=0.1, quantum=1e-3),
        Connection("a.m", "b.n"),
        Connection("a.c", "b.b"),
        Connection("b.c", "a.b"),
        Connection("b.m", "a.n"),
    )
    sources = (SignalSource("a.u", Sine(3.0, 5.0)), SignalSource("b.u", Square(1.0, 0.02)))
    return System((fmu_instance("a", path), fmu_instance("b", path)), connections, sources)


def run(path: Path, kind: type, compiled: bool, stop: float = 0.03) -> Recording:
    with Session(system(path), RECORD, kind(1e-3, compiled=compiled), stop) as session:
        session.run()
        return session.run()


@pytest.mark.parametrize("kind", [GaussSeidel, Jacobi])
def test_every_type_has_the_same_bits(mixed: Path, kind: type, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session_module, "COMPILED_FROM", 0)
    quick, slow = run(mixed, kind, True), run(mixed, kind, False)
    assert (quick.statistics.loop, slow.statistics.loop) == (MACHINE_CODE, PYTHON)
    assert quick.values.tobytes() == slow.values.tobytes()
    assert np.ptp(quick["b.y"]) > 0.1
    assert set(np.unique(quick["a.c"])) == {0.0, 1.0}
    assert set(np.unique(np.diff(quick["b.m"]))) == {1.0, 3.0}


@pytest.mark.parametrize("compiled", [True, False])
def test_a_refused_integer_is_an_error_with_the_slaves_own_words(
    mixed: Path, compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session_module, "COMPILED_FROM", 0)
    with pytest.raises(SlaveError, match=r"b: fmi2SetInteger.* returned Discard: 99 and more is refused"):
        run(mixed, GaussSeidel, compiled, 0.2)


def test_without_a_compiler_the_python_loop_runs(mixed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session_module, "COMPILED_FROM", 0)
    expected = run(mixed, GaussSeidel, True)
    monkeypatch.setattr(compiled_module, "_load_loop", lambda holds_lock: None)
    found = run(mixed, GaussSeidel, True)
    assert found.statistics.loop == PYTHON
    assert found.values.tobytes() == expected.values.tobytes()
