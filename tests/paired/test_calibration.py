"""The map from S to the gap: monotone, disjoint from tests, refusing what it does not cover."""

import ast
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from orchestrator.errors import CalibrationError, ScenarioError
from orchestrator.paired import calibration as module
from orchestrator.paired.calibration import calibrate, estimate_gap, load_or_calibrate
from orchestrator.paired.compiled_loop import make_loop
from orchestrator.paired.experiment import Experiment, choose_experiment, thesis_experiment
from orchestrator.paired.metric import difference_sum, error_statistics

PLANTS = "orchestrator.plants.design"

NOISY = replace(Experiment(), encoder_noise=1e-4)


def estimates(experiment, sizes, seed):
    calibration = load_or_calibrate(experiment)
    loop = make_loop(experiment)
    zero = np.zeros(experiment.steps + 1)
    twin = loop.run(0.0, (zero, zero))[:, 2]
    found = []
    for k, alpha in enumerate(sizes):
        errors = experiment.encoder_errors(seed + k)
        found.append(estimate_gap(calibration, difference_sum(loop.run(alpha, errors)[:, 2], twin)))
    return [np.array(column) for column in zip(*((g.alpha, g.lower, g.upper) for g in found), strict=True)]


def random_sizes(experiment, count, seed):
    low, high = np.log(experiment.smallest), np.log(experiment.largest)
    return np.exp(np.random.default_rng(seed).uniform(low, high, count))


@pytest.mark.parametrize("experiment", [Experiment(), thesis_experiment()], ids=["default", "thesis"])
def test_estimates_without_noise(experiment):
    sizes = random_sizes(experiment, 100, seed=101)
    statistics = error_statistics(sizes, *estimates(experiment, sizes, 0))
    assert statistics.mean_percent < 0.1
    assert statistics.worst_percent < 0.5


def test_estimates_with_noise_and_their_coverage():
    sizes = random_sizes(NOISY, 1000, seed=102)
    statistics = error_statistics(sizes, *estimates(NOISY, sizes, 50_000))
    assert statistics.mean_percent < 0.3
    assert 0.93 <= statistics.coverage <= 0.97


def test_the_scaled_experiment_is_the_default_one():
    small, large = Experiment(), thesis_experiment()
    zero = np.zeros(small.steps + 1)
    a = make_loop(small).run(0.05, (zero, zero))[:, 2]
    b = make_loop(large).run(0.05 * 48.0, (zero, zero))[:, 2]
    assert np.abs(b / 48.0 - a).max() < 1e-9


def test_nothing_is_extrapolated():
    calibration = load_or_calibrate(Experiment())
    for total in (0.0, 1.0, 1e6):
        with pytest.raises(CalibrationError, match="must lie within the calibrated"):
            estimate_gap(calibration, total)


def test_noise_below_the_range_gives_an_interval_down_to_zero():
    calibration = load_or_calibrate(NOISY)
    low = estimate_gap(calibration, float(np.exp(calibration.log_sum[0])) * (1 - 1e-9))
    assert low.lower == 0.0
    assert low.upper > low.alpha > 0.0


def test_a_limit_cycling_experiment_is_refused():
    # Weights on the load angle alone make a stiff loop that limit-cycles in the gap.
    stiff = replace(Experiment(), name="stiff", state_weights=(1.0, 1.0, 1e6, 1.0, 1.0), torque_weight=1e-4)
    with pytest.raises(CalibrationError, match="must grow strictly with alpha in the stiff experiment"):
        calibrate(stiff)


def test_provenance_is_stored():
    calibration = load_or_calibrate(Experiment())
    assert calibration.experiment["amplitude"] == Experiment().amplitude
    assert calibration.runs > 200
    assert np.all(np.diff(calibration.log_sum) > 0.0)
    assert np.all(np.diff(calibration.log_alpha) > 0.0)
    assert load_or_calibrate(Experiment()) == calibration


@pytest.mark.parametrize("experiment", [Experiment(), NOISY], ids=["clean", "noisy"])
def test_the_calibration_that_comes_with_the_package_is_that_of_these_sources(experiment, monkeypatch):
    monkeypatch.setattr(module, "calibrate", lambda *_: pytest.fail("run `python -m tools.calibrations`"))
    monkeypatch.setattr(module, "cache_directory", lambda name: pytest.fail("run `python -m tools.calibrations`"))
    calibration = load_or_calibrate(experiment)
    loop = make_loop(experiment)
    zero = (np.zeros(experiment.steps + 1),) * 2
    twin = loop.run(0.0, zero)[:, 2]
    for n in range(0, len(calibration.log_sum), 24):
        total = difference_sum(loop.run(float(np.exp(calibration.log_alpha[n])), zero)[:, 2], twin)
        bound = 1e-9 if experiment.encoder_noise == 0.0 else 0.01
        assert np.log(total) == pytest.approx(calibration.log_sum[n], abs=bound)


def test_a_calibration_is_made_anew_when_a_module_changes_that_its_numbers_come_from():
    sources = set(module._sources())
    used = {
        node.module
        for path in sources
        for node in ast.walk(ast.parse(path.read_bytes()))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(("orchestrator.paired.", PLANTS))
    }
    files = {Path(import_module(name).__file__) for name in used}
    assert files <= sources


def test_statistics():
    actual = np.array([1.0, 2.0])
    statistics = error_statistics(actual, np.array([1.1, 2.0]), np.array([1.05, 1.9]), np.array([1.2, 2.1]))
    assert statistics.mean_percent == pytest.approx(5.0)
    assert statistics.worst_percent == pytest.approx(10.0)
    assert statistics.mse == pytest.approx(0.005)
    assert statistics.coverage == 0.5
    with pytest.raises(ValueError, match="length"):
        error_statistics(actual, actual, actual, actual[:1])


def test_unknown_experiment():
    with pytest.raises(ScenarioError, match="must be one of default, thesis"):
        choose_experiment("x")
