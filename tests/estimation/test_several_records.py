"""Several records of one machine together, and records with missing samples."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import orchestrator as oc
from orchestrator.errors import RecordError
from orchestrator.estimation import cramer_rao
from orchestrator.estimation.likelihood import Likelihood
from orchestrator.estimation.methods import maximum_likelihood
from orchestrator.estimation.problem import make_problem
from orchestrator.estimation.protocol import Estimate, TimeLimitError
from orchestrator.records.model_file import default_model
from orchestrator.records.record import Record, record_from_columns
from tests.support.independent_plant import make_record

MODEL = default_model()
ALPHA = 0.01


@pytest.fixture(scope="module")
def made() -> list[tuple[dict[str, np.ndarray], dict]]:
    return [
        make_record({"alpha": ALPHA}, 40 + k, 5.0, 200.0, 0.0, "multisine", (1e-4, 1e-4), None, "dead_zone")
        for k in range(2)
    ]


@pytest.fixture(scope="module")
def records(made) -> list[Record]:
    return [record_from_columns(columns, f"record {k}") for k, (columns, _) in enumerate(made)]


def test_two_records_give_the_standard_error_that_theory_promises(made, records) -> None:
    result = maximum_likelihood.estimate(records[0], MODEL, more=records[1:])
    values = cramer_rao.truth_values(made[0][1]["linear"], ALPHA, *(truth["states"][0, :5] for _, truth in made))
    problems = [make_problem(record, MODEL) for record in records]
    bound = cramer_rao.error_bound(problems, values, (1e-4, 1e-4))
    alone = [cramer_rao.error_bound(problem, values, (1e-4, 1e-4)) for problem in problems]
    assert bound < 1.001 / np.hypot(1.0 / alone[0], 1.0 / alone[1])
    assert result.standard_error == pytest.approx(bound, rel=0.1)
    assert result.interval[0] < ALPHA < result.interval[1]
    assert [entry["source"] for entry in result.diagnostics["records"]] == ["record 0", "record 1"]
    assert all(entry["traversals"] > 5 for entry in result.diagnostics["records"])
    assert result.curves["states"].shape[0] == records[0].size


def test_missing_samples_are_left_out_of_the_likelihood(made, records) -> None:
    rng = np.random.default_rng(5)
    columns = made[0][0]
    keep = rng.random(records[0].size) > 0.05
    keep[0] = keep[-1] = True
    record = record_from_columns({name: values[keep] for name, values in columns.items()}, "gaps")
    assert record.size == records[0].size
    assert record.n_missing == int(np.count_nonzero(~keep))
    result = maximum_likelihood.estimate(record, MODEL)
    assert result.interval[0] < ALPHA < result.interval[1]
    assert result.standard_error < 2e-5


def test_a_missing_angle_changes_nothing_but_its_own_term(records) -> None:
    problem = make_problem(records[0], MODEL)
    theta = problem.start
    whole = Likelihood(problem).run(theta)
    outputs = problem.outputs.copy()
    outputs[-1, :] = np.nan
    holed = Likelihood(replace(problem, outputs=outputs)).run(theta)
    np.testing.assert_array_equal(holed.errors[:-1], whole.errors[:-1])
    last = np.log(whole.variances[-1]) + whole.errors[-1] ** 2 / whole.variances[-1]
    assert whole.deviance - holed.deviance == pytest.approx(float(last.sum()), rel=1e-9)


def test_an_uncertain_scale_of_the_torque_is_one_of_the_unknowns(records) -> None:
    record = replace(records[0], u=records[0].u / 1.02, u_scale_uncertainty=0.05)
    exact = replace(MODEL, parameters={k: replace(p, uncertainty=0.0) for k, p in MODEL.parameters.items()})
    result = maximum_likelihood.estimate(record, exact)
    scale = result.diagnostics["parameters"]["u_scale"]
    assert scale["value"] == pytest.approx(1.02, abs=4.0 * scale["standard_error"])
    assert scale["standard_error"] < 1e-3


def test_a_time_limit_ends_the_fit(records) -> None:
    with pytest.raises(TimeLimitError, match="`rate`"):
        maximum_likelihood.estimate(records[0], MODEL, time_limit=0.2)


@pytest.fixture
def rubbing() -> list[dict[str, np.ndarray]]:
    """Two short records of a machine with dry friction, which the model lacks."""
    made = [make_record({"alpha": 0.02, "Fc_m": 1.5}, 50 + k, 3.0, 100.0, excitation="multisine") for k in range(2)]
    return [columns for columns, _ in made]


@pytest.fixture
def unexplained(monkeypatch) -> None:
    """A fit, in no time, that finds that the model does not explain the records."""
    diagnostics = {"lacking": "the model lacks something", "cramer_rao": 1e-5}
    fit = Estimate("maximum_likelihood", 0.02, 1e-5, (0.01998, 0.02002), True, "", diagnostics)
    monkeypatch.setattr(maximum_likelihood, "estimate", lambda *given, **options: fit)


@pytest.mark.usefixtures("unexplained")
def test_records_that_the_model_does_not_explain_are_diagnosed_together(rubbing, monkeypatch) -> None:
    seen = []

    def refused(records, model, progress):
        seen.append([record.source for record in records])
        raise RecordError("it is a test")

    monkeypatch.setattr("orchestrator.diagnose", refused)
    records = [record_from_columns(columns, f"rubbing {k}") for k, columns in enumerate(rubbing)]
    found = oc.estimate(records)
    assert seen == [["rubbing 0", "rubbing 1"]]
    assert found.diagnosis is None
    assert "The model does not explain the records; no diagnosis: it is a test" in found.blocks()
    assert oc.estimate(records, diagnose=False).undiagnosed == ""
    assert len(seen) == 1


def test_the_dry_friction_of_a_fit_is_told(rubbing, monkeypatch) -> None:
    fitted = {"effects.coulomb_friction.motor.torque": {"value": 0.8, "standard_error": 0.01}}
    diagnostics = {"lacking": "", "cramer_rao": 1e-5, "parameters": fitted, "measurement_noise": (1e-4, 1e-4)}
    fit = Estimate("maximum_likelihood", 0.02, 1e-5, (0.01998, 0.02002), True, "", diagnostics)
    monkeypatch.setattr(maximum_likelihood, "estimate", lambda *given, **options: fit)
    told = oc.estimate(record_from_columns(rubbing[0], "rubbing"), diagnose=False).blocks()
    assert any(
        "dry friction 0.8 N.m at the motor (standard error 0.01)" in line for line in told if isinstance(line, str)
    )


@pytest.mark.night
@pytest.mark.usefixtures("unexplained")
@pytest.mark.slow
def test_records_with_lost_rows_are_diagnosed_too(rubbing) -> None:
    rows = np.arange(rubbing[1]["time"].size) != 7
    holed = {name: values[rows] for name, values in rubbing[1].items()}
    found = oc.estimate([record_from_columns(rubbing[0], "whole"), record_from_columns(holed, "holed")])
    assert found.diagnosis is not None
    assert found.undiagnosed == ""


@pytest.mark.slow
def test_one_diagnosis_of_two_records_gives_the_half_gap_of_the_corrected_model(rubbing, monkeypatch) -> None:
    asked = partial(oc.diagnose, effects=["coulomb_friction@motor", "backlash@shaft"])  # the search is of other tests
    monkeypatch.setattr("orchestrator.diagnose", asked)
    found = oc.estimate([record_from_columns(columns, f"rubbing {k}") for k, columns in enumerate(rubbing)])
    assert found.diagnosis is not None
    assert [record.source for record in (found.diagnosis.record, *found.diagnosis.more)] == ["rubbing 0", "rubbing 1"]
    assert found.best.method == "diagnosis"
    assert found.interval[0] < 0.02 < found.interval[1]
