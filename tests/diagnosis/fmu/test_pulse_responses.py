"""Pulse responses: what efforts change, its transpose, the spectrum, and whether an FMU is linear."""

import numpy as np
import pytest

from orchestrator.diagnosis.fmu.response import PulseResponses

ROWS, STEP, DECAY = 300, 0.01, 0.9


@pytest.fixture
def lag():
    """Responses of ``y+ = 0.9 y + w`` to pulses at rows 0 and 150."""
    response = np.concatenate([[0.0], DECAY ** np.arange(ROWS - 1)])[:, None]
    return PulseResponses((0, 150), {2: (response, response[:150])}, ROWS)


def simulated(pushes):
    y = np.zeros(ROWS)
    for k in range(ROWS - 1):
        y[k + 1] = DECAY * y[k] + pushes[k]
    return y


def test_efforts_change_what_a_simulation_says(lag):
    pushes = np.random.default_rng(1).standard_normal((2, ROWS))
    found = lag.change_outputs(pushes, 2)
    for change, push in zip(found, pushes, strict=True):
        np.testing.assert_allclose(change[0], simulated(push), atol=1e-10)


def test_the_gradient_is_the_transpose(lag):
    rng = np.random.default_rng(2)
    push, by_outputs = rng.standard_normal(ROWS), rng.standard_normal((1, ROWS))
    assert float(np.sum(lag.change_outputs(push[None], 2)[0] * by_outputs)) == pytest.approx(
        float(push @ lag.gradient(by_outputs, 2))
    )


def test_the_spectrum_is_that_of_the_system(lag):
    frequencies = np.linspace(0.0, 0.5 / STEP, 40)
    z = np.exp(2j * np.pi * frequencies * STEP)
    found = lag.frequency_response(frequencies, STEP, memory=1e6)
    np.testing.assert_allclose(found[:, 0, 0], 1.0 / (z - DECAY), rtol=1e-5)


def test_an_fmu_is_linear_where_its_responses_are_the_same(lag):
    assert lag.is_linear(0.01)
    first, later = lag.found[2]
    assert not PulseResponses(lag.rows, {2: (first, 1.3 * later)}, ROWS).is_linear(0.1)
