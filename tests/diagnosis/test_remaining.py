"""What is left and the signals that it follows, and the law that an FMU of the corrected model can have."""

import json

import fmpy
import numpy as np
import pytest

import orchestrator as oc
from orchestrator.diagnosis.diagnose import balance_of, diagnose
from orchestrator.diagnosis.inference.problem import fit_problem
from orchestrator.diagnosis.model.law_arguments import law_arguments
from orchestrator.diagnosis.selection.remaining import find_dependences, formula_of, hats, knots_of
from orchestrator.diagnosis.selection.search import search_effects
from orchestrator.diagnosis.settings import DiagnosisSettings, SelectionSettings
from orchestrator.errors import ScenarioError
from orchestrator.records.model_file import default_model
from orchestrator.records.record import record_from_columns
from tests.support.independent_plant import make_record

SETTINGS = DiagnosisSettings()
MODEL = default_model()


def test_curves_are_straight_lines_between_knots():
    knots = np.array([-1.0, 0.0, 2.0])
    values = np.array([3.0, 1.0, 5.0])
    np.testing.assert_allclose(hats(knots, np.array([-1.0, -0.5, 1.0, 3.0])) @ values, [3.0, 2.0, 3.0, 7.0])
    assert knots_of(np.zeros(100)) is None
    assert np.all(np.diff(knots_of(np.random.default_rng(0).normal(size=500))) > 0.0)


def test_the_formula_is_the_shortest_within_the_errors():
    knots = np.linspace(-2.0, 2.0, 11)
    assert formula_of(knots, 3.0 * knots, np.full(11, 0.01)).endswith(" x")
    assert "sign(x)" in formula_of(knots, 0.5 * np.sign(knots) + 0.1 * knots, np.full(11, 0.01))
    assert formula_of(knots, np.sin(5.0 * knots) + knots**3, np.full(11, 1e-4)) == ""


def test_friction_that_is_not_named_is_left_and_follows_the_speed():
    columns, _ = make_record({"Fc_m": 0.8}, 5, 16.0, substeps=50)
    balance = balance_of(record_from_columns(columns, "record"), MODEL, SETTINGS)
    found = search_effects(fit_problem([balance], SETTINGS.fit), SelectionSettings(most_effects=0))
    points = found.problem.record_points(found.final.point)
    strongest = find_dependences(found, law_arguments([balance], points, metric=False), SelectionSettings())[0]
    assert (strongest.site, strongest.argument) == ("motor", "speed")
    assert strongest.comparison.gain > 0.3
    assert strongest.values[-1] == pytest.approx(0.8, rel=0.4)
    assert strongest.values[0] == pytest.approx(-0.8, rel=0.4)


def test_a_complete_model_leaves_nothing_that_follows():
    columns, _ = make_record({}, 5, 16.0, substeps=50)
    found = diagnose(record_from_columns(columns, "record"), MODEL)
    assert all(one.comparison.gain < SETTINGS.grades.likely_gain for one in found.remaining)
    assert found.law is None


@pytest.mark.slow
def test_any_tool_gets_the_misfit_that_is_stated(tmp_path):
    columns, _ = make_record({"Fc_m": 0.8}, 51, 20.0, substeps=50)
    path = tmp_path / "settings.toml"
    path.write_text("[selection]\nmost_effects = 0\n")
    found = oc.diagnose(record_from_columns(columns, "machine"), settings=path, with_law=True)
    assert (found.verdict, found.with_law) == ("unknown", True)
    found.save(tmp_path / "out")
    results = json.loads((tmp_path / "out" / "diagnose.json").read_text())["results"]
    exported = results["learned_law"]["exported"]
    runs, encoders = found.runs, list(exported["misfit"])
    step = runs.time[1] - runs.time[0]
    ends = [*(run["row"] for run in exported["runs"][1:]), len(runs.time)]
    errors = {1: [], 0: []}
    for switch, of_switch in errors.items():
        for run, end in zip(exported["runs"], ends, strict=True):
            rows = slice(run["row"], end)
            count = end - run["row"]
            asked = list(zip(step * np.arange(count), runs.u[rows], strict=True))
            u = np.array(asked, dtype=[("time", float), ("u", float)])
            result = fmpy.simulate_fmu(
                str(tmp_path / "out" / found.fmu_name), stop_time=(count - 1) * step, step_size=step,
                output_interval=step, input=u, output=encoders, fmi_type="CoSimulation",
                start_values={**run["starts"], exported["parameter"]: switch},
            )  # fmt: skip
            of_switch.append(np.column_stack([result[name][:count] for name in encoders]) - runs.measured[rows])
    on, off = (np.sqrt(np.mean(np.concatenate(errors[switch]) ** 2, axis=0)) for switch in (1, 0))
    np.testing.assert_allclose(on, list(exported["misfit"].values()), rtol=1e-3)
    assert exported["largest_difference_from_compiled"] < 1e-3
    assert on[0] < 0.5 * off[0]


def test_a_law_is_refused_with_an_fmu_of_others():
    with pytest.raises(ScenarioError, match="with_law"):
        oc.diagnose("a.csv", "a.fmu", "a.toml", with_law=True)
