"""Whitening: noise of a known spectrum comes out white and of unit size, and the back filter is the adjoint."""

from functools import cache

import numpy as np
import pytest

from orchestrator.diagnosis.data.signals import prepare_signals
from orchestrator.diagnosis.inference.whitening import estimate_whitening
from orchestrator.diagnosis.model.interface import ModelPoint
from orchestrator.diagnosis.model.torque_balance import TorqueBalance
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.records.model_file import default_model, read_model
from orchestrator.records.record import record_from_columns
from tests.support.axis_record import MODEL, axis_record
from tests.support.independent_plant import NOMINAL, make_record

SETTINGS = DiagnosisSettings()


@cache
def exact_balance(seed=1, duration=20.0, **options):
    """The balances of a record whose model is exact, but for the encoders' noise."""
    columns, truth = make_record({}, seed, duration, mismatch=0.0, substeps=50, **options)
    assert truth["linear"]["k"] == NOMINAL["k"]
    record = record_from_columns(columns, "record")
    model = default_model()
    return TorqueBalance(model, prepare_signals(record, None, SETTINGS.band), SETTINGS.balance)


@pytest.mark.parametrize("torque_noise", [0.0, 0.5])
def test_noise_of_encoders_and_torque_comes_out_white(torque_noise):
    balance = exact_balance(torque_noise=torque_noise)
    start = ModelPoint.nominal(balance.parameters)
    (residuals,) = balance.residuals([start])
    whitening = estimate_whitening(balance, residuals, SETTINGS.fit)
    white = whitening.apply(residuals).reshape(2, -1)
    inner = white[:, white.shape[1] // 10 :]
    np.testing.assert_allclose(np.std(inner, axis=1), 1.0, atol=0.35 if torque_noise else 0.2)
    raw = residuals[:, whitening.rows]
    assert np.std(raw[0]) > 5.0 * np.std(inner[0]) or np.std(raw[1]) > 5.0 * np.std(inner[1])


def test_the_kept_rows_are_those_of_the_whole_filter():
    balance = exact_balance()
    (residuals,) = balance.residuals([ModelPoint.nominal(balance.parameters)])
    whitening = estimate_whitening(balance, residuals, SETTINGS.fit)
    spectra = np.fft.rfft(residuals * whitening.taper, whitening.length, axis=1)
    spectra[:, len(whitening.weights) :] = 0.0
    weights = np.zeros((spectra.shape[1], 2, 2), dtype=complex)
    weights[: len(whitening.weights)] = whitening.weights
    whole = np.fft.irfft((weights @ spectra.T[:, :, None])[:, :, 0].T, whitening.length, axis=1)
    expected = whole[:, whitening.rows] * whitening.active
    np.testing.assert_allclose(whitening.apply(residuals), expected.ravel(), rtol=1e-9, atol=1e-9)


def test_back_filter_is_the_adjoint_of_the_filter():
    balance = exact_balance()
    (residuals,) = balance.residuals([ModelPoint.nominal(balance.parameters)])
    whitening = estimate_whitening(balance, residuals, SETTINGS.fit)
    rng = np.random.default_rng(3)
    given, weights = rng.standard_normal(residuals.shape), rng.standard_normal(whitening.size)
    for channel in (0, 1):
        alone = np.zeros_like(given)
        alone[channel] = given[channel]
        forward = whitening.apply(alone) @ weights
        backward = whitening.back_filter(weights, channel) @ given[channel]
        assert forward == pytest.approx(backward, rel=1e-9)


def test_a_band_ends_where_the_motion_does(tmp_path):
    path = tmp_path / "model.toml"
    path.write_text(MODEL)
    model = read_model(path)
    p = [entry.default for entry in model.plant.table]
    quiet = prepare_signals(axis_record(p, 1, "axis"), 1.0, SETTINGS.band)
    assert 1.0 < quiet.cutoffs[0] < 0.35 / quiet.step + 1e-9
    record = axis_record(p, 1, "axis")
    noise = 3e-3 * np.random.default_rng(0).normal(size=record.size)
    noisy = record_from_columns({"time": record.time, "u": record.u, "theta_m": record.theta_m + noise}, "noisy")
    assert prepare_signals(noisy, 1.0, SETTINGS.band).cutoffs[0] < quiet.cutoffs[0]
