"""Effects in series against closed forms, and against the stepping code of the delivered effect FMU."""

import numpy as np
import pytest

from orchestrator.diagnosis.fmu import loop
from orchestrator.diagnosis.fmu.problem import at_input
from orchestrator.diagnosis.fmu.record import divide_samples
from orchestrator.effects.effect import PlaceScales
from orchestrator.effects.of_fmus import BANK, FmuEffect
from pyfmu_sources.adapters.attachment import SERIES, AttachedEffect

STEP = 0.01


@pytest.fixture
def signal():
    rng = np.random.default_rng(3)
    return np.repeat(rng.standard_normal(60), 5)


def test_rows_are_divided_into_more_parts_than_rows_or_fewer(signal):
    rows = np.append(signal, 9.0)
    assert divide_samples(rows, 3, 6) == pytest.approx(np.repeat(signal, 2), abs=0.0)
    assert divide_samples(rows, 3, 1) == pytest.approx(signal.reshape(-1, 3).mean(axis=1))
    halves = divide_samples(rows, 3, 2)
    assert halves[0] == pytest.approx((signal[0] + 0.5 * signal[1]) / 1.5)
    assert halves.mean() == pytest.approx(signal.mean())
    lines = divide_samples(np.arange(7.0), 3, 3, order=1)
    assert lines == pytest.approx(np.arange(6.0) + 0.5)


def test_a_delay_of_whole_steps_shifts(signal):
    late = loop.delay_input(signal, STEP, 7 * STEP, 0.5)
    assert late[:7] == pytest.approx(0.5)
    assert late[7:] == pytest.approx(signal[:-7])


def test_a_lag_gives_the_mean_of_the_exponential():
    out = loop.lag_input(np.ones(400), STEP, 0.2, 0.0)
    ends = np.arange(1, 401) * STEP
    mean = 1.0 - 0.2 / STEP * (np.exp(-(ends - STEP) / 0.2) - np.exp(-ends / 0.2))
    assert out == pytest.approx(mean, abs=1e-12)


def test_a_limited_rate_rises_in_a_straight_line():
    out = loop.limit_rate(np.ones(100), STEP, 2.0, 0.0)
    assert out[:50] == pytest.approx(2.0 * STEP * (np.arange(50) + 0.5))
    assert out[51:] == pytest.approx(1.0)


def test_an_output_that_is_read_late_follows_a_cubic_exactly():
    t = np.arange(100) * STEP
    late = loop.delay_output(t**3 - t, STEP, 0.0234)
    s = t - 0.0234
    assert late[5:] == pytest.approx((s**3 - s)[5:], abs=1e-12)


def test_an_output_that_is_read_late_keeps_its_kinks_where_inputs_jump():
    t = np.arange(81) * STEP
    kinked = np.abs(t - 40 * STEP) + 3.0 * np.maximum(t - 20 * STEP, 0.0) ** 2
    late = loop.delay_output(kinked, STEP, 0.7 * STEP, m=4)
    s = t - 0.7 * STEP
    assert late[4:] == pytest.approx((np.abs(s - 40 * STEP) + 3.0 * np.maximum(s - 20 * STEP, 0.0) ** 2)[4:], abs=1e-12)
    assert np.max(np.abs(loop.delay_output(kinked, STEP, 0.7 * STEP) - late)) > 0.01 * STEP


def test_an_output_behind_a_lag_follows_a_ramp():
    t = np.arange(500) * STEP
    out = loop.lag_output(t, STEP, 0.1)
    assert out == pytest.approx(t - 0.1 * (1.0 - np.exp(-t / 0.1)), abs=1e-12)


@pytest.mark.parametrize(("kind", "value"), [
    ("gain", 0.2), ("offset", 0.3), ("delay", 0.0337), ("lag", 0.05), ("saturation", 0.8), ("dead_zone", 0.3),
    ("rate_limit", 20.0), ("quantisation", 0.25),
])  # fmt: skip
def test_the_effect_fmu_does_what_was_fitted(signal, kind, value):
    for at_rest in (False, True):
        compare(signal + 0.7, kind, value, at_rest)


@pytest.mark.parametrize("delay", [0.31, 1.0, 2.6, 4.0, 9.7])
@pytest.mark.parametrize("m", [1, 2, 4, 8])
def test_the_effect_fmu_reads_an_output_as_late_as_was_fitted(signal, delay, m):
    effect = AttachedEffect(instance_name="effect")
    effect.series, effect.q0, effect.q1 = SERIES.index("late_reading"), delay * STEP, float(m)
    effect.exit_initialization_mode()
    found = []
    for k, u in enumerate(signal[1:]):
        effect.signal = float(u)
        assert effect.do_step(k * STEP, STEP)
        found.append(effect.result)
    fitted = loop.delay_output(signal, STEP, delay * STEP, m)
    rows = np.arange(4 * m + 16, len(signal), m)  # those that are compared: what lies between sees no jump ahead
    error = np.abs(np.array(found)[rows - 1] - fitted[rows])
    assert np.max(error) < (1e-12 if m >= 3 or delay >= 2.0 else 0.5 * np.max(np.abs(np.diff(signal, 2))))


def compare(signal, kind, value, at_rest):
    effect = AttachedEffect(instance_name="effect")
    effect.series, effect.q0, effect.at_rest = SERIES.index(kind), value, at_rest
    effect.exit_initialization_mode()
    found = []
    for k, u in enumerate(signal):
        effect.signal = float(u)
        assert effect.do_step(k * STEP, STEP)
        found.append(effect.result)
    scales = PlaceScales(STEP, 1.0, 1.0, signal)
    fitted = at_input(FmuEffect(BANK[f"input_{kind}"], "u", scales, at_rest), signal, STEP, value)
    # A variable-step solver makes another path of another last bit: what is delivered must feed it the same one.
    assert found == (pytest.approx(fitted, abs=1e-12) if kind in ("lag", "rate_limit") else fitted.tolist())
