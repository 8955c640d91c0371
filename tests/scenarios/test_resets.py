"""Runs of FMUs of others do not hang on their reset: each begins with new instances."""

from pathlib import Path

import pytest

from orchestrator.api.scenario_sweep import sweep_scenario
from orchestrator.fmi.instances import fmu_instance
from orchestrator.scenarios.scenario import load_scenario
from orchestrator.shared.isolation.archives import content_hash
from tests.support.answers_fmu import build_answers_fmu
from tests.support.c_fmu import have_compiler
from tests.support.python_fmus import build_python_fmu, slave_source

LEAVES = {
    "its state": "RESETS=m->s.x = x;",
    "a share of its state": "RESETS=m->s.x = 1e-3 * x;",
    "a latch that a large value trips": "RESETS=m->s.mode = x > 2.5 || m->s.mode ? 7 : 0;",
    "a variable of its library": "LEFT",
    "that it was reset": "RESETS=m->s.gain = 5.0; m->s.x = 1.0;",
}
compiled = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")


def scenario(folder: Path, fmu: Path, output: str = "x") -> Path:
    path = folder / "one.toml"
    path.write_text(
        f'stop = 1.0\nrecord = ["a.{output}"]\n[master]\nstep = 0.125\n[instances.a]\nfmu = "{fmu}"\n'
        '[[sources]]\nto = "a.u"\nkind = "constant"\nvalue = 1.0\n'
    )
    return path


def swept(path: Path, workers: int, values: str = "3,1,2,0") -> list[float]:
    result = sweep_scenario(path, {"a.gain": values}, workers=workers)
    return [row.outcome.values[0] if row.outcome.values else row.outcome.message for row in result.rows()]


@compiled
@pytest.mark.parametrize("what", LEAVES)
def test_a_row_is_that_of_its_own_case_whatever_a_reset_leaves(tmp_path: Path, what: str) -> None:
    path = scenario(tmp_path, build_answers_fmu(tmp_path, LEAVES[what]))
    for workers in (1, 2):
        assert swept(path, workers) == [3.0, 1.0, 2.0, 0.0]


@compiled
def test_a_reset_that_is_refused_costs_no_row(tmp_path: Path) -> None:
    path = scenario(tmp_path, build_answers_fmu(tmp_path, "RESETS=return fmi2Error;"))
    assert swept(path, 1) == [3.0, 1.0, 2.0, 0.0]


def test_what_a_python_module_counts_is_not_handed_on(tmp_path: Path) -> None:
    step = "global total\ntotal += step * self.gain * self.u\nself.y = total\nreturn True"
    path = scenario(tmp_path, build_python_fmu(tmp_path / "sum", slave_source(step, "total = 0.0")), "y")
    assert swept(path, 1) == [3.0, 1.0, 2.0, 0.0]


@compiled
def test_the_second_try_after_a_discarded_step_begins_anew(tmp_path: Path) -> None:
    fmu = build_answers_fmu(tmp_path, "LONGEST=0.1", "COMES_TO", "RESETS=m->s.x = x;")
    with load_scenario(scenario(tmp_path, fmu)).session() as session:
        values = [session.run({"a.gain": gain})["a.x"][-1] for gain in (3.0, 1.0)]
    assert values == pytest.approx([3.0, 1.0])


@compiled
def test_our_own_fmus_are_reset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    fmu = build_answers_fmu(tmp_path, "RESETS=m->s.x = x;")
    assert not fmu_instance("a", fmu).resets
    monkeypatch.setattr("orchestrator.fmi.ours._known", {content_hash(fmu)})
    assert fmu_instance("a", fmu).resets
    with load_scenario(scenario(tmp_path, fmu)).session() as session:
        assert [session.run()["a.x"][-1] for _ in range(2)] == [2.0, 4.0]
