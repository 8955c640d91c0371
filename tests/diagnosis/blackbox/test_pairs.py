"""Two effects that pay together only; efforts too small to name."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.diagnosis.blackbox.bank import BANK, BoxEffect, Surroundings
from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.model import BoxModel
from orchestrator.diagnosis.blackbox.parts import parts_of
from orchestrator.diagnosis.blackbox.promises import Known
from orchestrator.diagnosis.blackbox.screening import Screened
from orchestrator.diagnosis.blackbox.trials import BoxTrials
from orchestrator.diagnosis.blackbox.verdict import stand_in
from orchestrator.diagnosis.blackbox.whitening import Ladder, Surrogate

ROWS = 800
SCENE = Surroundings(0.01, 1.0, 1.0, np.linspace(-1.0, 1.0, ROWS))
TURNS = Surrogate(np.array([[1.0, 1.0], [0.0, 0.999]]), np.array([[0.5], [1.0]]), np.array([[1.0, 0.0]]))
"""A body that turns freely: noise at its port explains most of what goes on slowly."""
MOTION = 40.0 * np.sin(0.021 * np.arange(ROWS)) + 7.0 * np.sin(0.13 * np.arange(ROWS))


def answer(effort: np.ndarray) -> np.ndarray:
    return TURNS.response(effort[:-1, None], 0)[:, 0, 0]


SPRING, LOAD, DRAG = answer(-MOTION), answer(np.sign(np.gradient(MOTION))), answer(-np.gradient(MOTION))


def fitter(measured: np.ndarray) -> Fitter:
    """Return a fitter of a record that a model without parameters should have left at zero."""
    problem = SimpleNamespace(
        map=SimpleNamespace(uncertain=(), ports={"p": SimpleNamespace(position="x", input="u")}),
        nominal=BoxModel(np.zeros(0)), residual=lambda y: measured[: len(y), None] - y, outputs=("y",), n=ROWS,
        noise_places=[0], inputs=(), data=SimpleNamespace(inputs=np.zeros((ROWS, 0)), time=0.01 * np.arange(ROWS)),
        runner=SimpleNamespace(reads=["x"], inputs=["u"]), read=lambda models: [MOTION[:, None]],
    )  # fmt: skip
    return Fitter(problem, Ladder(TURNS, np.ones(1), ROWS), parts_of(ROWS))


def plain(own: Fitter) -> BoxFit:
    y = np.zeros((ROWS, 1))
    return BoxFit(BoxModel(np.zeros(0)), own.best_level(y, slice(0, ROWS)), y, 0.0, 0.0, 0.0, np.zeros((ROWS, 1, 0)))


def noise(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=ROWS)


def unit(column: np.ndarray) -> np.ndarray:
    return column / np.sqrt(np.mean(column**2))


def test_two_effects_that_noise_at_the_port_would_hide_are_promised_together() -> None:
    columns = {"spring": unit(SPRING), "directional_friction": unit(LOAD), "viscous_drag": unit(DRAG)}
    effects = [BoxEffect(BANK[name], "p", SCENE) for name in columns]
    trials = [(effect, np.ones(1), 1) for effect in effects]
    own = fitter(12.0 * columns["spring"] + 9.0 * columns["directional_friction"] + noise(1))
    known = Known(own, plain(own), ROWS)
    assert own.ladder.share(known.start) > 0.0
    screened = Screened([], known, trials, [c[:, None] for c in columns.values()], frozenset())
    best = screened.pairs(20.0)[0]
    assert {e.kind.name for e in best.effects} == {"spring", "directional_friction"}
    assert own.ladder.share(best.level) < own.ladder.share(known.start)
    found = {e.kind.name: v[0] for e, v in zip(best.effects, best.values, strict=True)}
    assert found["spring"] == pytest.approx(12.0, rel=0.05)
    assert found["directional_friction"] == pytest.approx(9.0, rel=0.05)


def test_noise_alone_promises_no_pair() -> None:
    columns = [unit(c)[:, None] for c in (SPRING, LOAD, DRAG)]
    trials = [(BoxEffect(BANK[name], "p", SCENE), np.ones(1), 1) for name in ("spring", "load", "viscous_drag")]
    pushes = 1e-2 * np.random.default_rng(2).normal(size=ROWS)
    own = fitter(answer(pushes) + noise(3))
    screened = Screened([], Known(own, plain(own), ROWS), trials, columns, frozenset())
    assert screened.pairs(20.0) == []


@pytest.mark.parametrize(("name", "values", "means"), [
    ("load", [1e-2], True), ("load", [1e-6], False),
    ("input_offset", [-1e-6], False), ("gravity", [1e-9, -1e-3], True), ("gravity", [1e-9, 1e-9], False),
    ("input_delay", [1e-9], True), ("coulomb_friction", [1e-7, 0.01], False),
])  # fmt: skip
def test_an_effort_of_the_size_of_rounding_is_no_effect(name: str, values: list[float], means: bool) -> None:
    assert BoxEffect(BANK[name], "p", SCENE).means(np.array(values), 1e-3) is means


@pytest.mark.parametrize(("without", "named"), [(0.02, "spring@p"), (0.028, "")])
def test_an_effect_must_more_than_halve_a_disturbance(without: float, named: str) -> None:
    shares = {0: 0.01, 1: without}
    best = BoxFit(BoxModel(np.zeros(0)).extended(BoxEffect(BANK["spring"], "p", SCENE), np.ones(1)), 0,
                  np.zeros((ROWS, 1)), 0.0, 0.0, 0.0, np.zeros((ROWS, 1, 1)))  # fmt: skip
    bare = plain(fitter(np.zeros(ROWS)))
    own = SimpleNamespace(
        ladder=SimpleNamespace(share=shares.__getitem__),
        fit=lambda model, level: bare,
        settled=lambda fit: replace(fit, level=1),
    )
    assert stand_in(SimpleNamespace(fitter=own, settings=SimpleNamespace(quiet=3e-4)), best) == named


@pytest.mark.parametrize(
    ("kind", "left", "within"),
    [("coulomb_friction", 9.9, True), ("coulomb_friction", 10.1, False), ("input_gain", 9.9, False)],
)
def test_what_a_law_at_a_port_may_be_off_by_is_no_further_effect(kind: str, left: float, within: bool) -> None:
    """The effect changes the output by 1000 (rms); a hundredth of that counts for nothing."""
    effect, further = BoxEffect(BANK[kind], "p", SCENE), BoxEffect(BANK["added_inertia"], "p", SCENE)
    values = np.full(len(effect.kind.parameters), 0.5)
    J = np.zeros((ROWS, 1, len(values)))
    J[:, 0, 0] = 2000.0 * np.where(np.arange(ROWS) % 2, 1.0, -1.0)
    model = BoxModel(np.zeros(0)).extended(effect, values)
    before = BoxFit(model, 0, np.full((ROWS, 1), left), 0.0, 0.0, 0.0, J)
    after = BoxFit(model.extended(further, np.ones(1)), 0, np.zeros((ROWS, 1)), 0.0, 0.0, 0.0, J)
    assert BoxTrials(fitter(np.zeros(ROWS)), ())._within_laws(after, before) is within


def test_what_takes_away_all_noise_at_the_port_is_asked_for_as_much_as_two_effects(monkeypatch) -> None:
    own = fitter(np.zeros(ROWS))
    trials = BoxTrials(own, ())
    monkeypatch.setattr(trials, "explained", lambda fit: True)
    noisy = next(k for k in range(own.ladder.size) if own.ladder.share(k) == 1.8e-3)
    base = replace(plain(own), decided=-1e4, level=noisy)
    before = replace(base, decided=-900.0)
    pays = trials.settings.pays
    assert trials._least(replace(before, level=0), before, base) == 2.0 * pays
    assert trials._least(before, before, base) > 3.0 * pays  # noise is left: no law is exact
