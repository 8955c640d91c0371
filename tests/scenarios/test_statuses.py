"""What an FMU answers beside OK: a run that goes on says it, one that cannot go on ends in words."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from orchestrator.api.scenario_sweep import sweep_scenario
from orchestrator.api.simulate import simulate
from orchestrator.cli import main
from orchestrator.errors import SlaveError
from orchestrator.scenarios.scenario import load_scenario
from tests.support.answers_fmu import build_answers_fmu
from tests.support.c_fmu import have_compiler
from tests.support.python_fmus import build_python_fmu, slave_source
from tests.support.shared_inputs import shared_input

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")


def scenario(folder: Path, *macros: str, algorithm: str = "gauss_seidel", step: float = 0.01, **more: bool) -> Path:
    """A scenario of one FMU with x' = 2 u, u = 1, for a second."""
    build_answers_fmu(folder, *macros, **more)
    path = folder / "run.toml"
    path.write_text(
        f'stop = 1.0\nrecord = ["a.x", "a.steps"]\n[master]\nalgorithm = "{algorithm}"\nstep = {step}\n'
        '[instances.a]\nfmu = "Answers.fmu"\n[[sources]]\nto = "a.u"\nkind = "constant"\nvalue = 1.0\n'
    )
    return path


ALGORITHMS = pytest.mark.parametrize("algorithm", ["gauss_seidel", "jacobi", "iterated"])


@ALGORITHMS
@pytest.mark.parametrize("step", [0.01, 0.0004])  # in machine code, too
def test_warnings_are_counted_and_the_first_is_shown(tmp_path: Path, algorithm: str, step: float) -> None:
    result = simulate(scenario(tmp_path, "WARNS_FROM=0.5", algorithm=algorithm, step=step))
    assert result["a.x"][-1] == pytest.approx(2.0)
    (remark,) = result.run.remarks
    assert (remark.instance, remark.count) == ("a", round(0.5 / step))
    assert remark.text == "fmi2DoStep at t = 0.5 s returned Warning: near the limit"


def test_an_fmu_that_stands_still_with_a_warning_is_seen_on_the_terminal_and_in_the_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = scenario(tmp_path, "WARNS_FROM=0.2", "FREEZES")
    assert main(["simulate", "--scenario", str(path), "--out", str(tmp_path / "out")]) == 0
    assert "Note: a: fmi2DoStep at t = 0.2 s returned Warning: near the limit (80 times)" in capsys.readouterr().out
    results = json.loads((tmp_path / "out" / "simulate.json").read_text())["results"]
    assert [(r["instance"], r["count"]) for r in results["remarks"]] == [("a", 80)]
    assert "near the limit" in (tmp_path / "out" / "report.html").read_text()


@pytest.mark.parametrize("step", [0.01, 0.0004])
def test_an_error_that_is_logged_beside_ok_is_told(tmp_path: Path, step: float) -> None:
    result = simulate(scenario(tmp_path, "LOGS_ERROR", step=step))
    assert [str(r) for r in result.run.remarks] == [
        f"a: logged Error, while its calls went well: no licence ({round(1 / step)} times)"
    ]


@ALGORITHMS
@pytest.mark.parametrize("step", [0.01, 0.0004])
def test_a_run_that_an_fmu_ends_keeps_what_it_has(tmp_path: Path, algorithm: str, step: float) -> None:
    result = simulate(scenario(tmp_path, "ENDS_AT=0.7", algorithm=algorithm, step=step))
    assert result.time[-1] == pytest.approx(0.7)
    assert np.allclose(result["a.x"], 2.0 * result.time)
    assert "a: ended the run at t = 0.7 s of 1 s" in str(result.run.remarks[0])


@ALGORITHMS
@pytest.mark.parametrize("step", [0.01, 0.0004])
def test_a_session_takes_a_run_that_ended_early_only_where_it_is_asked_to(
    tmp_path: Path, algorithm: str, step: float
) -> None:
    asked = load_scenario(scenario(tmp_path, "ENDS_AT=0.7", algorithm=algorithm, step=step))
    with asked.session() as session:
        for _ in range(2):  # a session goes on after it
            with pytest.raises(SlaveError, match=r"Discard.* wants the run to end, but the whole run is needed"):
                session.run()
            assert session.run(allow_early_end=True).time[-1] == pytest.approx(0.7)


def test_the_adaptive_master_says_that_it_does_not_end_runs(tmp_path: Path) -> None:
    with pytest.raises(SlaveError, match="wants the run to end, which `adaptive` does not do"):
        simulate(scenario(tmp_path, "ENDS_AT=0.7", algorithm="adaptive", saves=True))


@ALGORITHMS
@pytest.mark.parametrize(("macros", "saves"), [(("LONGEST=0.003",), True), (("LONGEST=0.003", "COMES_TO"), False)])
def test_a_discarded_step_is_done_in_shorter_ones(
    tmp_path: Path, algorithm: str, macros: tuple[str, ...], saves: bool
) -> None:
    result = simulate(scenario(tmp_path, *macros, algorithm=algorithm, saves=saves))
    assert np.allclose(result["a.x"], 2.0 * result.time)
    (remark,) = result.run.remarks
    assert (remark.count, remark.text.partition(":")[0]) == (100, "the step at t = 0 s was discarded")
    assert "done in shorter steps, the least of 0.00" in remark.text


@pytest.mark.parametrize(
    ("varies", "said"),
    [
        (True, "it neither saves its state nor says how far it came"),
        (False, "a: fmi2DoStep at t = 0 s returned Discard"),
    ],
)
def test_a_discarded_step_that_cannot_be_shorter_ends_the_run_in_words(tmp_path: Path, varies: bool, said: str) -> None:
    with pytest.raises(SlaveError, match=said):
        simulate(scenario(tmp_path, "LONGEST=0.003", varies=varies))


def test_steps_are_not_shortened_for_ever(tmp_path: Path) -> None:
    with pytest.raises(SlaveError, match="must be done, but even those of"):
        simulate(scenario(tmp_path, "LONGEST=0.0", saves=True))


@pytest.mark.parametrize("algorithm", ["gauss_seidel", "jacobi"])
def test_an_end_before_the_first_step_is_an_error_and_a_later_one_a_remark(tmp_path: Path, algorithm: str) -> None:
    with pytest.raises(SlaveError, match=r"t = 0 s returned Discard .*ends the run before the first step"):
        simulate(scenario(tmp_path, "ENDS_AT=0.0", algorithm=algorithm))
    result = simulate(scenario(tmp_path, "ENDS_AT=0.01", algorithm=algorithm))
    assert [r.text for r in result.run.remarks] == ["ended the run at t = 0.01 s of 1 s (fmi2Discard, terminated)"]


@pytest.mark.parametrize("returns", ["return False", "pass", "return time < 0.05"])
def test_a_python_slave_is_told_what_it_must_return(tmp_path: Path, returns: str) -> None:
    fmu = build_python_fmu(tmp_path / "slave", slave_source(f"self.y = time + step\n{returns}"))
    path = tmp_path / "slave.toml"
    path.write_text(f'stop = 1.0\nrecord = ["a.y"]\n[master]\nstep = 0.1\n[instances.a]\nfmu = "{fmu}"\n')
    if "<" in returns:
        (remark,) = simulate(path).run.remarks
        assert remark.text.startswith("ended the run at t = 0.1 s of 1 s")
    else:
        with pytest.raises(SlaveError, match="`do_step` must return True when it has done the step"):
            simulate(path)


@pytest.mark.parametrize("step", [0.25, 0.0004])  # in machine code, too
def test_a_refused_step_says_how_long_it_was_and_what_the_fmu_printed(tmp_path: Path, step: float) -> None:
    with pytest.raises(SlaveError) as error:
        simulate(scenario(tmp_path, "REFUSES", step=step))
    assert f"a: fmi2DoStep at t = 0 s returned Error (to a step of {step:g} s)" in str(error.value)
    assert str(error.value).endswith("(it printed: steps must be whole numbers of 0.1 s)")


@pytest.mark.parametrize(("factor", "diverges"), [(-1e4, True), (-50.0, False)])
def test_a_run_that_diverges_is_said_to(tmp_path: Path, factor: float, diverges: bool) -> None:
    path = scenario(tmp_path)
    path.write_text(f'{path.read_text()}[[connections]]\nfrom = "a.x"\nto = "a.u"\nfactor = {factor}\n')
    texts = [r.text for r in simulate(path).run.remarks]
    assert len(texts) == diverges
    assert all("`a.x` runs away: it is " in text and " at t = 0.1" in text for text in texts)


def test_a_step_that_is_pending_is_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(SlaveError, match="returned Pending: it must do its steps while it is called"):
        simulate(scenario(tmp_path, "PENDS"))


@pytest.mark.parametrize("step", [0.001, 0.004, 0.0005])
def test_a_step_of_its_own_is_seen(tmp_path: Path, step: float) -> None:
    result = simulate(scenario(tmp_path, "OWN_STEP=0.01", step=step))
    (remark,) = result.run.remarks
    assert remark.text.startswith("goes by its own step of 0.01 s")
    assert ("up to" in remark.text) == (step != 0.004)
    assert "behind" not in remark.text


def test_an_fmu_that_keeps_to_communication_points_has_nothing_said_of_it(tmp_path: Path) -> None:
    assert simulate(scenario(tmp_path)).run.remarks == ()
    assert simulate(scenario(tmp_path, "OWN_STEP=0.001")).run.remarks == ()


def test_a_sweep_says_it_in_a_column_and_sums_it_up(tmp_path: Path) -> None:
    result = sweep_scenario(scenario(tmp_path, "WARNS_FROM=0.5"), {"a.gain": "range:1:3:3"}, workers=1)
    result.save(tmp_path / "out")
    with (tmp_path / "out" / "sweep.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["a.x.last"]) for row in rows] == pytest.approx([1.0, 2.0, 3.0])
    assert {row["remarks"] for row in rows} == {
        "a: fmi2DoStep at t = 0.5 s returned Warning: near the limit (50 times)"
    }
    assert "3 of 3 cases have remarks" in str(result.blocks()[-1])
    assert result.results().remarked == 3
    assert "3 have remarks; the first: a: fmi2DoStep" in (tmp_path / "out" / "report.html").read_text()


def test_each_run_of_a_sweep_has_remarks_of_its_own(tmp_path: Path) -> None:
    result = sweep_scenario(scenario(tmp_path, "ENDS_AT=0.7"), {"a.gain": "range:1:3:3"}, workers=1)
    assert [row.outcome.values[0] for row in result.rows()] == pytest.approx([0.7, 1.4, 2.1])
    assert all("ended the run at t = 0.7 s" in row.outcome.values[-1] for row in result.rows())


@pytest.mark.parametrize(
    ("name", "last", "said"),
    [("01", 0.42, "returned Warning: communication point"), ("02", 2.0, "(100 times)"), ("03", 2.0, "table ended"),
     ("05", 1.4, "ended the run at t = 0.7 s"), ("07", 1.0, "(51 times)")],
)  # fmt: skip
def test_shared_inputs(name: str, last: float, said: str) -> None:
    result = simulate(shared_input(f"07-fmu-statuses/{name}.toml"))
    assert result["a.x"][-1] == pytest.approx(last)
    assert said in str(result.run.remarks[0])
