"""Differences of sensitive motions, and what makes up for an effect that is taken out."""

from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.diagnosis.blackbox.bank import BANK, BoxEffect, Surroundings
from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.model import BoxModel
from orchestrator.diagnosis.blackbox.parts import parts_of
from orchestrator.diagnosis.blackbox.steps import made_up_for
from orchestrator.diagnosis.blackbox.whitening import Ladder, realised

ROWS, NOISE = 200, 1e-3
TIME = np.linspace(0.0, 1.0, ROWS)
SCENE = Surroundings(0.01, 1.0, 1.0, TIME)
GAIN, LAG, LIMIT = (BoxEffect(BANK[name], "u", SCENE) for name in ("input_gain", "input_lag", "input_saturation"))
BEHIND = BoxEffect(BANK["output_lag"], "y", SCENE)


def run(model: BoxModel, turns: float) -> np.ndarray:
    """An angle that turns ``turns`` times faster for each part of a ratio: drive and gain over inertia."""
    gain = sum(float(v[0]) for e, v in zip(model.effects, model.values, strict=True) if e is GAIN)
    late = sum(float(v[0]) for e, v in zip(model.effects, model.values, strict=True) if e in (LAG, BEHIND))
    inertia, drag = model.p
    return (np.sin(turns * (1.0 + gain) / inertia * (TIME - late)) - (1.0 + gain) / drag * TIME**2)[:, None]


def fitter(turns: float) -> tuple[Fitter, list[int]]:
    counted: list[int] = []

    def simulate(models, rows=None):
        counted.append(len(models))
        return [run(model, turns)[: rows or ROWS] for model in models]

    uncertain = (SimpleNamespace(standard_deviation=0.05, minimum=0.1, maximum=10.0),) * 2
    problem = SimpleNamespace(
        map=SimpleNamespace(uncertain=uncertain), nominal=BoxModel(np.ones(2)), noise=np.array([NOISE]), n=ROWS,
        simulate=simulate, outputs=("y",),
    )  # fmt: skip
    return Fitter(problem, Ladder(realised(np.zeros((100, 1, 1))), np.ones(1), ROWS), parts_of(ROWS)), counted


def slope(model: BoxModel, turns: float) -> np.ndarray:
    ahead, behind = (run(BoxModel(model.p + by), turns) for by in (np.array([1e-7, 0.0]), np.array([-1e-7, 0.0])))
    return (ahead - behind)[:, 0] / 2e-7 / NOISE


def test_a_sensitive_motion_is_differenced_over_small_changes() -> None:
    model = BoxModel(np.ones(2))
    own, counted = fitter(400.0)
    J = own.jacobian(model, run(model, 400.0))
    true = slope(model, 400.0)
    assert np.linalg.norm(J[:, 0, 0] - true) < 0.05 * np.linalg.norm(true)
    assert counted == [2, 1]  # the second value is tame
    again = own.jacobian(model, run(model, 400.0))  # what was learned is kept
    assert counted == [2, 1, 2]
    assert again[:, 0, 0] == pytest.approx(J[:, 0, 0], rel=0.05, abs=0.05 * np.max(np.abs(true)))


def test_a_tame_one_over_changes_as_given() -> None:
    model = BoxModel(np.ones(2))
    own, counted = fitter(0.01)
    own.jacobian(model, run(model, 0.01))
    assert counted[0] == 2
    assert own.scales(model)[0] == pytest.approx(own.settings.fit.difference * 0.05)


def fit_of(own: Fitter, model: BoxModel, turns: float) -> BoxFit:
    y = run(model, turns)
    J = own.jacobian(model, y)
    assert J is not None
    return BoxFit(model, 0, y, 0.0, 0.0, 0.0, J)


def test_parameters_in_proportion_make_up_for_a_gain() -> None:
    own, _ = fitter(300.0)
    model = BoxModel(np.array([0.99, 1.01])).extended(GAIN, np.array([-0.008]))
    found = made_up_for(own, fit_of(own, model, 300.0), GAIN)
    assert found.effects == ()
    assert found.p == pytest.approx(model.p / (1.0 - 0.008), rel=2e-3)


def test_what_is_not_in_proportion_leaves_the_others() -> None:
    own, _ = fitter(300.0)
    model = BoxModel(np.array([0.99, 1.01])).extended(LIMIT, np.array([0.1])).extended(GAIN, np.array([0.01]))
    found = made_up_for(own, fit_of(own, model, 300.0), LIMIT)
    assert found.effects == (GAIN,)
    assert np.array_equal(found.vector, np.array([0.99, 1.01, 0.01]))


def test_a_lag_makes_up_for_one_on_the_other_side() -> None:
    own, _ = fitter(300.0)
    model = BoxModel(np.ones(2)).extended(LAG, np.array([0.002])).extended(BEHIND, np.array([0.0005]))
    found = made_up_for(own, fit_of(own, model, 300.0), BEHIND)
    assert found.effects == (LAG,)
    assert found.values[0] == pytest.approx([0.0025], rel=1e-3)
