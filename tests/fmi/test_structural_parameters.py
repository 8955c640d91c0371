"""Structural parameters of FMI 3.0: sizes of arrays, set in configuration mode, from a scenario."""

from pathlib import Path

import pytest

from orchestrator.api.scenario_sweep import sweep_scenario
from orchestrator.api.simulate import simulate
from orchestrator.errors import FmuError, ScenarioError
from orchestrator.fmi.instances import fmu_instance
from orchestrator.master.algorithms import GaussSeidel
from orchestrator.master.session import Session
from orchestrator.master.signals import Constant
from orchestrator.master.system import SignalSource, System
from orchestrator.scenarios.isolated import Safety
from tests.support.c_fmu import have_compiler
from tests.support.sized3_fmu import build_sized3_fmu

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")

P = {f"p[{k}]": float(k) for k in (1, 2, 3)}


@pytest.fixture(scope="module")
def sized(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_sized3_fmu(tmp_path_factory.mktemp("sized3"))


def test_arrays_have_the_size_that_is_given_in_every_run_of_a_session(sized: Path) -> None:
    instance = fmu_instance("a", sized, {"size": 3, **P})
    assert instance.model.variables["size"].start == 3
    assert [n for n in instance.model.variables if n.startswith("y")] == ["y[1]", "y[2]", "y[3]"]
    assert dict(instance.start) == P
    sources = tuple(SignalSource(f"a.u[{k}]", Constant(10.0 * k)) for k in (1, 2, 3))
    with Session(System((instance,), (), sources), ("a.y[1]", "a.y[3]", "a.size"), GaussSeidel(0.1), 1.0) as session:
        first = session.run()
        again = session.run()
    assert first.values[:, -1] == pytest.approx([10.0, 90.0, 3.0])
    assert first.values.tobytes() == again.values.tobytes()


def test_a_sweep_keeps_the_size(sized: Path) -> None:
    path = sized.parent / "sweep.toml"
    path.write_text(
        'stop = 1.0\nrecord = ["a.y[3]"]\n[master]\nstep = 0.1\n[instances.a]\nfmu = "Sized.fmu"\n'
        '[instances.a.parameters]\nsize = 3\n"p[1]" = 1.0\n"p[2]" = 1.0\n"p[3]" = 1.0\n'
        '[[sources]]\nto = "a.u[3]"\nkind = "constant"\nvalue = 2.0\n'
    )
    result = sweep_scenario(path, {"a.p[3]": "range:2:4:2"}, workers=1)
    assert [row.outcome.values[0] for row in result.rows()] == pytest.approx([4.0, 8.0])


def test_a_sweep_varies_the_size(sized: Path) -> None:
    path = sized.parent / "sizes.toml"
    path.write_text(
        'stop = 1.0\nrecord = ["a.y[1]", "a.size"]\n[master]\nstep = 0.1\n[instances.a]\nfmu = "Sized.fmu"\n'
        '[[sources]]\nto = "a.u[1]"\nkind = "constant"\nvalue = 2.0\n'
    )
    vary = {"a.size": "1,2", "a.p[1]": "3,5"}
    rows = [row.outcome for row in sweep_scenario(path, vary, workers=1).rows()]
    assert [row.values[0::5][:2] for row in rows] == [pytest.approx(v) for v in ((6, 1), (10, 1), (6, 2), (10, 2))]
    with pytest.raises(ScenarioError, match=r"a.size: must lie in \[1, 8\], but is 9"):
        sweep_scenario(path, {"a.size": "2,9"}, workers=1)
    path.write_text(path.read_text().replace('"a.y[1]"', '"a.y[2]"'))
    done = [row.outcome for row in sweep_scenario(path, {"a.size": "2,1,2"}, workers=1).rows()]
    assert [row.message == "" for row in done] == [True, False, True]
    assert "must name a variable of a (Sized), but 'y[2]' is none" in done[1].message


@pytest.mark.parametrize("trust", [True, False])
def test_a_scenario_says_the_size_within_walls_too(sized: Path, trust: bool) -> None:
    path = sized.parent / "s.toml"
    path.write_text(
        'stop = 1.0\nrecord = ["a.y[4]"]\n[master]\nstep = 0.1\n[instances.a]\nfmu = "Sized.fmu"\n'
        '[instances.a.parameters]\nsize = 4\n"p[1]" = 1.0\n"p[2]" = 1.0\n"p[3]" = 1.0\n"p[4]" = 5.0\n'
        '[[sources]]\nto = "a.u[4]"\nkind = "constant"\nvalue = 2.0\n'
    )
    assert simulate(path, safety=Safety(trust=trust))["a.y[4]"][-1] == pytest.approx(10.0)


def test_without_a_value_the_size_is_the_fmus_own(sized: Path) -> None:
    instance = fmu_instance("a", sized)
    assert "y[2]" in instance.model.variables
    assert "y[3]" not in instance.model.variables
    assert instance.model.variables["p[2]"].start == 2.0


@pytest.mark.parametrize(
    ("start", "expected"),
    [
        ({"size": 9}, r"structural parameter size must lie in \[1, 8\], but is 9"),
        ({"size": 2.5}, "structural parameter size must be an integer of 32 bits, but is 2.5"),
        ({"size": "two"}, "structural parameter size must be an integer of 32 bits, but is 'two'"),
        ({"size": 3, "p[1]": 1.0}, r"its parameter p\[2\] must have a value"),
    ],
)
def test_what_does_not_fit_is_named(sized: Path, start: dict[str, object], expected: str) -> None:
    with pytest.raises(FmuError, match=expected):
        fmu_instance("a", sized, start)
