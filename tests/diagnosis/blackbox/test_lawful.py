"""Whether what is left follows a law: copies of it with random phases tell what chance gives."""

import numpy as np
import pytest

from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.lawful import aimless, dependence_of
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.whitening import Ladder
from tests.diagnosis.blackbox.test_pairs import MOTION, ROWS, TURNS, answer, fitter, noise, plain


def found(own: Fitter, fit: BoxFit) -> str:
    assert own.ladder.share(fit.level) > 1e-5  # noise at the port explains it
    law = dependence_of(own, fit)
    return "" if law is None else law.statement


def test_drag_in_one_spot_follows_the_position() -> None:
    spot = np.abs(MOTION - 20.0) < 6.0
    own = fitter(answer(-2e-2 * spot * np.gradient(MOTION)) + noise(4))
    assert "the position and the" in found(own, plain(own))


def test_drag_that_comes_back_along_the_way_follows_the_position() -> None:
    rough = np.sin(0.9 * MOTION) > 0.3
    own = fitter(answer(-3e-2 * rough * np.gradient(MOTION)) + noise(4))
    assert "the position" in found(own, plain(own))


@pytest.mark.parametrize("size", [1e-2, 5e-2])
def test_an_effort_that_comes_is_told_with_its_time(size: float) -> None:
    own = fitter(answer(np.where(np.arange(ROWS) > 432, size, 0.0)) + noise(5))
    statement = found(own, plain(own))
    assert "begins or ends" in statement
    assert float(statement.partition("about ")[2].partition(" s")[0]) == pytest.approx(4.32, abs=0.2)


def test_a_drag_that_grows_follows_the_time_and_the_speed() -> None:
    drag = -3e-2 * (np.arange(ROWS) / ROWS) ** 3 * np.gradient(MOTION)
    own = fitter(answer(drag) + noise(6))
    assert "the time and the speed" in found(own, plain(own))


@pytest.mark.parametrize("colour", [0.0, 0.8, 0.99])
@pytest.mark.parametrize("seed", range(5))
def test_a_disturbance_follows_no_law(seed: int, colour: float) -> None:
    """Whatever its colour: the filter knows three."""
    white = 1e-2 * np.sqrt(1.0 - colour**2) * np.random.default_rng(10 + seed).normal(size=ROWS)
    pushes = np.zeros(ROWS)
    for k in range(1, ROWS):
        pushes[k] = colour * pushes[k - 1] + white[k]
    own = fitter(answer(pushes) + noise(20 + seed))
    assert not found(own, plain(own))


def test_copies_have_the_spectrum_and_no_order() -> None:
    ladder = Ladder(TURNS, np.ones(1), ROWS)
    e = np.random.default_rng(0).normal(size=(ROWS, 1))
    copies = aimless(ladder, 5, e, 3)
    white = ladder[5].whiten(copies)
    np.testing.assert_allclose(np.abs(np.fft.rfft(white[:, 0, 1])), np.abs(np.fft.rfft(e[:, 0])), rtol=1e-6, atol=1e-6)
    assert abs(float(np.corrcoef(white[:, 0, 1], e[:, 0])[0, 1])) < 0.15
    np.testing.assert_allclose(ladder[5].coloured(ladder[5].whiten(copies)), copies, atol=1e-8)
