"""A fit does not depend on the size of the machine: torques and inertias by any factor, gears of any ratio."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchestrator.estimation.description import friction_note
from orchestrator.estimation.filter.innovations import Innovations
from orchestrator.estimation.information import inverse
from orchestrator.estimation.likelihood import Fit, Likelihood
from orchestrator.estimation.methods import maximum_likelihood
from orchestrator.estimation.problem import DRY, Unknown, make_problem
from orchestrator.records.model_file import Model, default_model, read_model
from orchestrator.records.record import Record, record_from_columns
from tests.support.frictional_drive import draw_frictional_drive
from tests.support.independent_plant import make_record

TORQUES = ("J_m", "J_l", "k", "c", "b_m", "b_l")  # parameters that a torque's unit is in
GAP = 0.012


def _weak(factor: float) -> tuple[Record, Model]:
    """Return a record of 4 s of a machine with a weak drive, all of whose torques are multiplied by a factor."""
    columns, _ = make_record(
        {"alpha": GAP}, 5, 4.0, mismatch=0.04, torque=0.05, linear={"tau": 0.02}, substeps=50, noise=(1e-4, 5e-5),
        counts=None,
    )  # fmt: skip
    record = record_from_columns(columns | {"u": factor * columns["u"]}, "weak")
    model = default_model()
    parameters = dict(model.parameters)
    for name in TORQUES:
        one = parameters[name]
        parameters[name] = replace(one, value=factor * one.value, uncertainty=factor * one.uncertainty)
    parameters["tau"] = replace(parameters["tau"], value=0.02, uncertainty=0.002)
    return record, replace(model, parameters=parameters)


def test_all_torques_by_a_factor_leave_the_gap_as_it_is() -> None:
    """Levels of torque noise that were fixed would call a drive of microwatts noise."""
    found = [maximum_likelihood.estimate(*_weak(factor), threads=1) for factor in (1.0, 1e-5)]
    assert found[0].alpha == pytest.approx(GAP, rel=0.01)
    assert found[1].alpha == pytest.approx(found[0].alpha, rel=1e-5)
    assert found[1].standard_error == pytest.approx(found[0].standard_error, rel=0.01)
    assert found[1].message == found[0].message


def test_a_stiff_shaft_is_found_wherever_the_zeros_of_the_encoders_lie(tmp_path: Path) -> None:
    """Flanks that start half a gap off ask for torques that no drive has: the fit took noise for them, and no size."""
    drive = draw_frictional_drive(3000)
    path = tmp_path / "drive.toml"
    path.write_text(drive.model_text(), encoding="utf-8")
    record = record_from_columns({name: column[:1200] for name, column in drive.columns.items()}, "drive")
    found = maximum_likelihood.estimate(record, read_model(path))
    assert found.alpha == pytest.approx(drive.gap, rel=1e-3)
    low, high = found.interval
    assert low < drive.gap < high < low + 0.01 * drive.gap


def test_levels_of_noise_at_the_load_follow_the_gear() -> None:
    record, model = _weak(1.0)
    geared = replace(model, parameters=model.parameters | {"i": replace(model.parameters["i"], value=100.0)})
    plain, high = (make_problem(record, one).units for one in (model, geared))
    assert plain[0] == high[0] < 1.0
    assert plain[1] == pytest.approx(plain[0], rel=0.01)
    assert high[1] == pytest.approx(100.0 * 3.0 * high[0] / 80.0, rel=0.01)  # of 80 N.m, which is much for the thesis's


def test_a_difference_is_not_taken_beyond_a_bound() -> None:
    """A drive whose lag has become as small as it may be is not looked at with a negative one, which runs away."""
    problem = make_problem(*_weak(1.0))
    likelihood, theta = Likelihood(problem), problem.start
    place = problem.index("tau")
    lowest = 1e-6
    unknowns = list(problem.unknowns)
    unknowns[place] = replace(unknowns[place], mean=lowest, lower=lowest, deviation=math.inf, scale=1e-3)
    likelihood = Likelihood(replace(problem, unknowns=tuple(unknowns)))
    theta[place], theta[problem.index("alpha")] = lowest, GAP
    gradient, information, _ = likelihood.derivatives(likelihood.at(theta), np.arange(theta.size))
    assert np.isfinite(gradient).all()
    assert np.isfinite(information).all()


@pytest.mark.parametrize("inside", [True, False])
def test_a_contact_that_hangs_on_a_point_is_no_information(inside: bool) -> None:
    """All other points differ from this one by a jump, whichever way they lie; that tells nothing of any slope."""
    problem = make_problem(*_weak(1.0))
    start = problem.start
    slopes = np.random.default_rng(1).normal(size=(problem.record.size, 2, start.size))
    unknowns = [Unknown(u.name, u.mean, math.inf, 1.0, -math.inf if inside else u.mean) for u in problem.unknowns]

    class Jumping(Likelihood):
        def run(self, theta: np.ndarray, keep: bool = False) -> Innovations:
            errors = slopes @ (theta - start) + 0.05 * bool(np.any(theta != start))
            return Innovations(errors, np.ones_like(errors), np.empty(0), np.empty(0, dtype=np.int64))

    likelihood = Jumping(replace(problem, unknowns=tuple(unknowns)))
    information, expected = np.eye(start.size), np.einsum("rok,rol->kl", slopes, slopes)
    for _ in range(3):
        _, information, likelihood = likelihood.derivatives(likelihood.at(start), np.arange(start.size))
    assert information == pytest.approx(expected, rel=0.01, abs=10.0)


def test_friction_that_makes_up_the_interval_asks_for_a_crawl() -> None:
    problem = make_problem(*_weak(1.0))
    likelihood, free = Likelihood(problem), np.arange(len(problem.unknowns))
    gap, dry = problem.index("alpha"), problem.index(DRY[0])
    covariance = np.diag([u.scale**2 for u in problem.unknowns])
    for correlation, advised in ((0.9, True), (0.5, False)):
        covariance[gap, dry] = covariance[dry, gap] = correlation * math.sqrt(
            covariance[gap, gap] * covariance[dry, dry]
        )
        fit = Fit(likelihood.at(problem.start), free, inverse(covariance), 1, True, likelihood)
        assert ("also log a slow motion in both directions" in friction_note(fit, 0.02)) == advised
        assert not friction_note(fit, 0.001)
