"""The calibrated map on a loop whose S is known in closed form: a folded normal distribution."""

import dataclasses
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import foldnorm

from orchestrator.errors import CalibrationError
from orchestrator.paired import calibration as module
from orchestrator.paired.calibration import (
    Calibration,
    _conformal_width,
    _digest,
    _interpolation_error,
    _require_monotone,
    _smooth,
    calibrate_loop,
    estimate_gap,
    load_or_calibrate,
)
from orchestrator.paired.experiment import Experiment
from orchestrator.paired.settings import MapSettings

SMALL = MapSettings(clean_sizes=41, noisy_sizes=41, seeds_per_size=6, validation_runs=200)
CLEAN = Experiment()
NOISY = replace(CLEAN, encoder_noise=0.001)
LENGTH = CLEAN.steps + 1


@dataclass
class Loop:
    """The load's estimate differs from the twin's by alpha at every sample, plus both encoders' errors."""

    experiment: Experiment

    def run(self, alpha, errors):
        seen = np.zeros((LENGTH, 3))
        seen[:, 2] = 1.0 + alpha + (errors[0] + errors[1]) / np.sqrt(2.0)
        seen[:, 0] = seen[:, 1] = np.nan
        return seen


def mean_sum(alpha: float, noise: float) -> float:
    """Return the expected S of the loop above."""
    return LENGTH * float(foldnorm.mean(alpha / noise, scale=noise))


@pytest.fixture(scope="module")
def clean() -> Calibration:
    return calibrate_loop(Loop(CLEAN), SMALL)


@pytest.fixture(scope="module")
def noisy() -> Calibration:
    return calibrate_loop(Loop(NOISY), SMALL)


def test_the_clean_map_is_the_closed_form(clean: Calibration) -> None:
    assert np.allclose(clean.log_sum, np.array(clean.log_alpha) + np.log(LENGTH), atol=1e-12)
    assert np.exp(clean.log_alpha[0]) == pytest.approx(0.75 * CLEAN.smallest)
    assert np.exp(clean.log_alpha[-1]) == pytest.approx(1.1 * CLEAN.largest)
    assert len(clean.log_alpha) == 41
    assert clean.runs == 41 + 200
    found = estimate_gap(clean, 0.03 * LENGTH)
    assert found.alpha == pytest.approx(0.03, rel=1e-9)
    assert found.lower <= 0.03 * (1.0 + 1e-9)
    assert found.upper >= 0.03 * (1.0 - 1e-9)


def test_the_noisy_map_is_shifted_by_what_noise_adds(noisy: Calibration) -> None:
    expected = np.log([mean_sum(float(np.exp(a)), NOISY.encoder_noise) for a in noisy.log_alpha])
    shift = expected - np.log(LENGTH * np.exp(noisy.log_alpha))
    assert shift[0] > 0.03  # the smallest gaps are smaller than the noise
    assert np.allclose(noisy.log_sum, expected, atol=0.012)
    assert np.allclose(noisy.log_sum[20:], expected[20:], atol=0.005)
    assert noisy.runs == 41 + 41 * 6 + 200
    assert noisy.seed_branch == 7


def test_the_spread_is_that_of_the_estimate(noisy: Calibration) -> None:
    """Delta method: the deviation of log S over the slope of the map."""
    alpha, noise = np.exp(noisy.log_alpha), NOISY.encoder_noise
    mean = np.array([mean_sum(float(a), noise) for a in alpha])
    deviation = np.sqrt(LENGTH) * foldnorm.std(alpha / noise, scale=noise) / mean
    slope = np.gradient(np.log(mean), np.log(alpha))
    ratio = np.array(noisy.log_spread) / (deviation / slope)
    assert np.median(ratio) == pytest.approx(1.0, abs=0.15)
    assert np.all((ratio > 0.5) & (ratio < 1.6))


def test_intervals_cover_what_they_claim(noisy: Calibration) -> None:
    generator, inside = np.random.default_rng(99), 0
    for _ in range(400):
        alpha = float(np.exp(generator.uniform(np.log(0.003), np.log(0.09))))
        error = generator.normal(0.0, NOISY.encoder_noise, LENGTH)
        found = estimate_gap(noisy, float(np.abs(alpha + error).sum()))
        inside += found.lower <= alpha <= found.upper
    assert 0.91 <= inside / 400 <= 0.985


def by_hand(**changes) -> Calibration:
    values = {
        "experiment": {"encoder_noise": 0.0}, "digest": "", "version": "", "smallest": 0.01, "largest": 0.1,
        "log_sum": [0.0, 1.0, 2.0, 3.0], "log_alpha": [-4.0, -3.5, -3.0, -2.5], "log_spread": [0.1, 0.2, 0.3, 0.4],
        "width": 2.0, "level": 0.95, "runs": 1, "seed_branch": 7, "settings": MapSettings(),
    }  # fmt: skip
    return Calibration(**(values | changes))


def test_estimates_follow_the_map_and_its_spread() -> None:
    found = estimate_gap(by_hand(), float(np.exp(1.5)))
    assert np.log([found.alpha, found.lower, found.upper]) == pytest.approx([-3.25, -3.25 - 0.5, -3.25 + 0.5])


@pytest.mark.parametrize("at", [0.0, 3.0])
def test_the_ends_of_the_map_count(at: float) -> None:
    inside = float(np.exp(at)) * (1.0 + (1e-12 if at == 0.0 else -1e-12))
    assert np.log(estimate_gap(by_hand(), inside).alpha) == pytest.approx(-4.0 + 0.5 * at)


def test_nothing_is_extrapolated_without_noise() -> None:
    for total in (np.exp(-1e-6), np.exp(3.000001), 0.0):
        with pytest.raises(CalibrationError, match=r"calibrated 1 to 20.0855 rad.*outside 0.01 to 0.1 rad"):
            estimate_gap(by_hand(), float(total))


def test_noise_may_push_a_tiny_gap_below_the_map() -> None:
    """Five deviations of 0.1 in log alpha times a slope of 2: S may lie a whole unit of log S lower."""
    noisy = by_hand(experiment={"encoder_noise": 1e-4})
    for total in (np.exp(-0.999), np.exp(-1e-9)):
        found = estimate_gap(noisy, float(total))
        assert (found.alpha, found.lower) == (pytest.approx(np.exp(-4.0)), 0.0)
        assert found.upper == pytest.approx(np.exp(-4.0 + 2.0 * 0.1))
    with pytest.raises(CalibrationError):
        estimate_gap(noisy, float(np.exp(-1.001)))
    with pytest.raises(CalibrationError):
        estimate_gap(noisy, float(np.exp(3.001)))


def test_smoothing_weighs_neighbours() -> None:
    spike = np.zeros(9)
    spike[4] = 9.0
    assert _smooth(spike).tolist() == pytest.approx([0, 0, 1, 2, 3, 2, 1, 0, 0])
    assert _smooth(np.full(5, 3.0)).tolist() == pytest.approx([3.0] * 5)


def test_the_interpolation_error_is_the_larger_of_neighbours() -> None:
    x = np.arange(11.0)
    y = x.copy()
    y[5] += 0.25  # an odd node: the map through the even ones misses it
    error = _interpolation_error(x, y, 1e-12)
    assert error[3:8].tolist() == pytest.approx([0.25] * 5)
    assert error[:3].tolist() == pytest.approx([1e-12] * 3, abs=1e-13)
    assert error[8:].tolist() == pytest.approx([1e-12] * 3, abs=1e-13)


def test_the_width_is_the_quantile_of_unseen_scores() -> None:
    """A map that is off by one spread times the place in the range has scores uniform from zero to ten."""
    low, high = np.log(CLEAN.smallest), np.log(CLEAN.largest)
    nodes = np.linspace(low - 1.0, high + 1.0, 301)
    off = 0.1 * (nodes - low) / (high - low)
    spread = np.full(301, 0.01)
    settings = MapSettings(validation_runs=400, level=0.8)
    loop = Loop(CLEAN)
    width = _conformal_width(
        loop, loop.run(0.0, (np.zeros(1), np.zeros(1)))[:, 2], nodes - off, nodes + np.log(LENGTH), spread, settings
    )
    assert width == pytest.approx(8.0, abs=0.45)
    full = MapSettings(validation_runs=20, level=0.999)
    assert 8.0 < _conformal_width(
        loop, loop.run(0.0, (np.zeros(1), np.zeros(1)))[:, 2], nodes - off, nodes + np.log(LENGTH), spread, full
    ) <= 10.0  # fmt: skip


def test_a_map_that_does_not_grow_is_refused() -> None:
    sizes = np.array([0.01, 0.02, 0.03])
    _require_monotone(np.array([1.0, 2.0, 3.0]), sizes, CLEAN)
    for sums in ([1.0, 2.0, 2.0], [1.0, 2.0, 1.5]):
        with pytest.raises(CalibrationError, match=r"falls near 0\.02 rad"):
            _require_monotone(np.array(sums), sizes, CLEAN)


def test_a_noisy_map_that_does_not_grow_is_refused() -> None:
    drowned = replace(CLEAN, encoder_noise=3.0)
    with pytest.raises(CalibrationError, match="must grow strictly"):
        calibrate_loop(Loop(drowned), SMALL)


def test_calibrations_are_stored_once_and_remade_when_damaged(
    tmp_path, monkeypatch, caplog, clean: Calibration
) -> None:
    said: list[str] = []
    monkeypatch.setattr(module, "cache_directory", lambda name: tmp_path)
    monkeypatch.setattr(module, "calibrate", lambda experiment, settings: clean)
    assert load_or_calibrate(CLEAN, said.append, SMALL).log_sum == clean.log_sum
    assert len(said) == 1
    assert "default experiment at encoder noise 0 rad" in said[0]
    assert load_or_calibrate(CLEAN, said.append, SMALL).log_sum == clean.log_sum
    assert len(said) == 1
    (path,) = tmp_path.glob("*.json")
    text = path.read_text()
    for damaged in ("{", text.replace(":0.", ":1.", 1).replace(": 0.", ": 1.", 1)):
        assert damaged != text
        path.write_text(damaged)
        assert load_or_calibrate(CLEAN, said.append, SMALL).log_sum == clean.log_sum
        assert caplog.messages.pop() == f"{path} was damaged, and is made anew"
    assert len(said) == 3
    assert load_or_calibrate(CLEAN, None, SMALL).settings == SMALL
    load_or_calibrate(CLEAN, said.append, MapSettings(clean_sizes=43))
    assert len(said) == 4


def test_the_digest_names_experiment_settings_and_sources(monkeypatch, tmp_path) -> None:
    base = _digest(CLEAN, SMALL)
    assert len(base) == 24
    assert base == _digest(dataclasses.replace(CLEAN), SMALL)
    assert len({base, _digest(NOISY, SMALL), _digest(CLEAN, MapSettings())}) == 3
