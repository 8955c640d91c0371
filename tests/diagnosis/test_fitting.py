"""Fits, blocks left out and comparisons, on a model that is linear: what they must be is worked out by hand."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from orchestrator.diagnosis.inference.fitting import compare, fit_model, weigh_prior
from orchestrator.diagnosis.inference.problem import fit_problem
from orchestrator.diagnosis.model.interface import ModelPoint, UncertainParameter
from orchestrator.diagnosis.report.estimates import parameter_estimates
from orchestrator.diagnosis.selection.settling import settle
from orchestrator.diagnosis.settings import FitSettings
from tests.support.linear_model import LinearModel, linear_problem

LABEL = "drag@motor"


@pytest.fixture(scope="module")
def fitted():
    problem = linear_problem({LABEL: 0.4})
    return problem, fit_model(problem, problem.start.with_effect(LABEL, (0.0,)))


def test_a_fit_finds_parameter_and_size(fitted):
    problem, model = fitted
    assert model.point.parameters[0] == pytest.approx(1.1, abs=0.01)
    assert model.point.effects[LABEL][0] == pytest.approx(0.4, abs=0.01)
    gradient = model.jacobian.T @ model.residual
    prior, slopes = problem.prior(model.point, model.coordinates)
    largest = np.sqrt(model.cost * np.max(np.sum(model.jacobian**2, axis=0)))
    assert np.max(np.abs(gradient + prior * slopes)) < 1e-3 * largest


def test_errors_of_blocks_are_those_of_fits_without_them(fitted):
    problem, model = fitted
    block = 7
    rows = problem.blocks != block
    prior, slopes = problem.prior(model.point, model.coordinates)
    J, r = model.jacobian, model.residual
    normal = J[rows].T @ J[rows] + np.diag(slopes**2)
    shift = -np.linalg.solve(normal, J[rows].T @ r[rows] + slopes * prior)
    left_out = r[~rows] + J[~rows] @ shift
    assert model.held_out[~rows] == pytest.approx(left_out, rel=1e-5, abs=1e-8)
    np.testing.assert_allclose(model.block_shifts[block], shift, rtol=1e-5, atol=1e-9)


def test_errors_of_values_are_those_of_repeated_records():
    sizes, stated, jackknifed = [], [], []
    for seed in range(40):
        problem = linear_problem({LABEL: 0.4}, seed=seed, size=800)
        problem, model = settle(problem, fit_model(problem, problem.start.with_effect(LABEL, (0.0,))))
        scale = problem.effects[LABEL].scales[0]
        sizes.append(model.point.effects[LABEL][0])
        stated.append(scale * np.sqrt(model.covariance[1, 1]))
        jackknifed.append(scale * np.sqrt(model.jackknife[1, 1]))
    assert np.median(stated) == pytest.approx(np.std(sizes), rel=0.4)
    assert np.median(jackknifed) == pytest.approx(np.std(sizes), rel=0.4)


def test_a_value_that_changes_slowly_is_no_surer_than_its_parts(fitted):
    _, model = fitted
    count = len(model.block_shifts)
    sizes = np.random.default_rng(2).permutation(np.repeat([1.0, 3.0], count // 2))  # of each block, by itself

    def error_of(sizes, covariance):
        shifts = np.zeros_like(model.block_shifts)
        shifts[:, 1] = (sizes.mean() - sizes) / (count - 1)
        other = replace(model, block_shifts=shifts, covariance=covariance * np.eye(2))
        return np.sqrt(other.jackknife[1, 1])

    assert error_of(sizes, 1e-4) == pytest.approx(1.0 / np.sqrt(count), rel=0.2)  # those of a sample, spread 1
    assert error_of(np.sort(sizes), 1e-4) == pytest.approx(1.0, rel=0.1)  # it was half as large until half-way
    assert error_of(np.sort(sizes), 1.0) == pytest.approx(1.0 / np.sqrt(count), rel=0.2)  # as much is noise


def test_a_block_counts_as_one_row_at_least(fitted):
    problem, model = fitted
    quiet, loud = (replace(model, block_shifts=factor * model.block_shifts) for factor in (0.1, 1e4))
    assert weigh_prior(problem, quiet).overdispersion == 1.0
    assert weigh_prior(problem, loud).overdispersion == problem.blocks.size / problem.block_count


def test_of_a_value_that_changes_nothing_nothing_is_known(fitted, monkeypatch):
    problem, model = fitted
    whole = type(problem).move_point
    monkeypatch.setattr(
        type(problem), "move_point",
        lambda problem, point, coordinates, steps: replace(
            whole(problem, point, coordinates, steps), effects=point.effects
        ),
    )  # fmt: skip
    idle = fit_model(problem, model.point)
    assert idle.covariance[1, 1] > 1e3 * model.covariance[1, 1]
    assert idle.covariance[0, 0] == pytest.approx(1.0 / np.sum(model.jacobian[:, 0] ** 2), rel=0.2)


def test_a_value_at_its_upper_end_is_as_sure_as_the_way_back_says(fitted, monkeypatch):
    problem, model = fitted
    ended = replace(problem.effects[LABEL], lower=(0.0,), upper=(0.4,))
    monkeypatch.setattr(problem.models[0], "effects", {LABEL: ended})
    problem = replace(problem)  # which remembers its effects
    stopped = fit_model(problem, model.point.with_effect(LABEL, (0.4,)), 0)
    assert np.ptp(stopped.jacobian[:, 1]) == 0.0
    assert stopped.covariance[1, 1] == pytest.approx(model.covariance[1, 1], rel=0.1)
    assert stopped.covariance[0, 0] == pytest.approx(1.0 / np.sum(model.jacobian[:, 0] ** 2), rel=0.1)


def test_a_true_effect_gains_and_chance_does_not():
    problem = linear_problem({LABEL: 0.1, "nothing@motor": 0.0})
    base = fit_model(problem, problem.start)
    true, chance = (fit_model(problem, problem.start.with_effect(name, (0.0,))) for name in problem.effects)
    assert compare(base, true).t > 5.0
    assert compare(base, true).gain > 0.3
    assert compare(base, chance).gain < 0.01
    assert compare(true, base).t < -3.0


def test_blocks_after_a_share_are_of_the_rows_behind_it(fitted):
    problem, _ = fitted
    (whitening,), (model,) = problem.whitenings, problem.models
    blocks, places = problem.blocks_after([0.85])
    late = whitening.rows >= 0.85 * model.size
    np.testing.assert_array_equal(places, np.flatnonzero(np.tile(late, len(whitening.active))))
    assert 0 < places.size < 0.2 * whitening.size
    np.testing.assert_array_equal(np.unique(blocks), np.arange(blocks.max() + 1))
    assert blocks.max() >= 3


def test_blocks_have_as_many_rows_that_say_something(fitted):
    problem, _ = fitted
    (whitening,) = problem.whitenings
    active = whitening.active.copy()
    active[:, : active.shape[1] // 2] = 0.0
    blocks = replace(problem, whitenings=(replace(whitening, active=active),)).blocks
    counts = np.bincount(blocks, active[0] > 0.0)
    assert len(counts) == blocks.max() + 1 >= 10
    assert counts.min() >= counts.max() - 1
    assert np.all(np.diff(blocks) >= 0)


class _StartedModel(LinearModel):
    """A linear model whose first rows are off by a value of that record alone."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.parameters = (*self.parameters, UncertainParameter("x", 0.0, 1.0, "m", True, scale=0.5))

    def residuals(self, points: Sequence[ModelPoint]) -> list[np.ndarray]:
        decay = np.exp(-np.arange(self.size) / 50.0)
        return [y - p.parameters[1] * decay for y, p in zip(super().residuals(points), points, strict=True)]


def test_a_value_of_one_record_is_reported_with_its_number() -> None:
    rng, models = np.random.default_rng(3), []
    for start in (0.4, -0.3):
        ramp = rng.standard_normal(2000)
        data = 1.1 * ramp + start * np.exp(-np.arange(2000) / 50.0) + 0.01 * rng.standard_normal(2000)
        models.append(_StartedModel(data, ramp, {}, 0.01))
    problem = fit_problem(models, FitSettings())
    found = parameter_estimates(problem, fit_model(problem, problem.start), 0.95)
    assert [*found] == ["slope", "x of record 1", "x of record 2"]
    for name, truth in (("slope", 1.1), ("x of record 1", 0.4), ("x of record 2", -0.3)):
        assert found[name].value == pytest.approx(truth, abs=4.0 * found[name].standard_error)
        assert 0.0 < found[name].standard_error < 0.03
    assert found["x of record 1"].unit == "m"
    assert [*fit_problem(models[:1], FitSettings()).reported] == ["slope", "x"]
