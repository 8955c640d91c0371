"""What is left and the signals that it follows."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from orchestrator.diagnosis.diagnose import balance_of, diagnose
from orchestrator.diagnosis.inference.problem import fit_problem
from orchestrator.diagnosis.model.interface import ModelPoint, NoiseSources
from orchestrator.diagnosis.model.law_arguments import law_arguments
from orchestrator.diagnosis.selection.evidence import noise_share
from orchestrator.diagnosis.selection.remaining import find_dependences, formula_of, hats, knots_of
from orchestrator.diagnosis.selection.search import search_effects
from orchestrator.diagnosis.settings import DiagnosisSettings, SelectionSettings
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
    strongest = find_dependences(found, law_arguments([balance], points, str), SelectionSettings())[0]
    assert (strongest.site, strongest.argument) == ("motor", "speed")
    assert strongest.comparison.gain > 0.3
    assert strongest.values[-1] == pytest.approx(0.8, rel=0.4)
    assert strongest.values[0] == pytest.approx(-0.8, rel=0.4)


def test_a_complete_model_leaves_nothing_that_follows():
    columns, _ = make_record({}, 5, 16.0, substeps=50)
    found = diagnose(record_from_columns(columns, "record"), MODEL)
    assert all(one.comparison.gain < SETTINGS.grades.likely_gain for one in found.remaining)
    assert found.law is None


def test_noise_that_is_left_is_told_from_a_law() -> None:
    """White noise of a current is noise; dry friction of a motion of a hertz, in a band of twenty, is none."""
    time = 0.01 * np.arange(6000)
    noise = np.random.default_rng(5).standard_normal(time.size)
    friction = np.sign(np.sin(2.0 * np.pi * 1.03 * time))

    def share(left: np.ndarray) -> float:
        def sources(frequencies: np.ndarray) -> NoiseSources:
            none = np.zeros((frequencies.size, 1, 1), dtype=complex)
            return NoiseSources(none, np.zeros(1), none, np.zeros(1))

        model = SimpleNamespace(
            residuals=lambda points: [left[None]], step=0.01, size=time.size, cutoffs=(20.0,), noise_sources=sources
        )
        problem: Any = SimpleNamespace(models=(model,), record_points=lambda point: [point])
        return noise_share(problem, ModelPoint(()))

    assert share(noise) > 0.85
    assert share(friction) < 0.1
    assert 0.2 < share(friction + noise) < 0.5  # of a white spectrum up to 50 Hz the band holds two fifths
