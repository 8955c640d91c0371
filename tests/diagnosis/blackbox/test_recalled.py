"""What a signal was before the record, how long a late run is waited for, and when a parameter's drift is named."""

import threading
from types import SimpleNamespace

import numpy as np
import pytest

from orchestrator.diagnosis.blackbox.bank import BANK, BoxEffect, Surroundings
from orchestrator.diagnosis.blackbox.held_out import HeldOut
from orchestrator.diagnosis.blackbox.judged import _verdict
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.model import BoxModel
from orchestrator.diagnosis.blackbox.rest import Rest
from orchestrator.diagnosis.blackbox.runner import Runner
from orchestrator.diagnosis.blackbox.search import BoxSearch
from orchestrator.diagnosis.blackbox.settings import DEFAULT
from orchestrator.diagnosis.blackbox.verdict import _anew

SCENE = Surroundings(0.01, 1.0, 1.0, np.ones(3))
NONE = np.zeros((1, 1))
HELD, AT_REST = (BoxEffect(BANK["input_delay"], "u", SCENE, at_rest=rest) for rest in (False, True))
LOAD = BoxEffect(BANK["load"], "p", SCENE)


def fit(model: BoxModel) -> BoxFit:
    return BoxFit(model, 0, NONE, -10.0 if AT_REST in model.effects else -50.0, 0.0, 0.0, NONE)


def test_what_a_signal_was_before_the_record_is_asked_again_beside_further_effects() -> None:
    fitter = SimpleNamespace(grown=lambda model, level: fit(model), settled=lambda found: found)
    search = BoxSearch(fitter, [HELD, AT_REST, LOAD])
    for effect in (HELD, AT_REST):
        model = BoxModel(np.zeros(0)).extended(effect, np.array([0.1])).extended(LOAD, np.array([2.0]))
        found = search.recalled(fit(model))
        assert found.model.effects == (AT_REST, LOAD)
        assert np.array_equal(found.model.vector, [0.1, 2.0])


def test_what_a_signal_was_before_the_record_is_asked_of_a_rival_too() -> None:
    lag = BoxModel(np.zeros(0)).extended(BoxEffect(BANK["input_lag"], "u", SCENE), np.array([0.1]))
    best = BoxFit(lag, 0, NONE, -10.0, 0.0, 0.0, NONE)
    fitter = SimpleNamespace(
        grown=lambda model, level: fit(model), settled=lambda found: found, ladder=SimpleNamespace(share=lambda k: 0.0),
        fit=lambda model, level: fit(model),
    )  # fmt: skip
    search = BoxSearch(fitter, [HELD, AT_REST])
    held = fit(BoxModel(np.zeros(0)).extended(HELD, np.array([0.1])))
    assert _anew(search, best, lag.effects[0], {}, [held])["input_delay@u"].model.effects == (AT_REST,)


def test_an_fmu_that_has_hung_is_waited_for_less_long() -> None:
    runner = object.__new__(Runner)
    runner.settings, runner.step_cost, runner._warm = DEFAULT.process, 1e-6, {threading.get_ident()}
    waited = []
    for runner.lost in range(4):
        waited.append(runner._allowed(1000))
    expected = DEFAULT.process.slower * 1e-3
    assert waited == pytest.approx([expected + DEFAULT.process.known / n for n in (1, 2, 3, 4)])


@pytest.mark.parametrize(("share", "verdict"), [(1e-4, "unknown"), (0.0, "effects")])
def test_a_parameter_that_changes_is_not_named_beside_a_disturbance(share: float, verdict: str) -> None:
    drift = BoxEffect(BANK["parameter_drift"], "k", SCENE)
    last = fit(BoxModel(np.zeros(0)).extended(drift, np.array([0.1])))
    rest = Rest(share == 0.0, share > 0.0, share, (), np.ones((8, 1)))
    search = SimpleNamespace(fitter=None, settings=DEFAULT.search)
    shown = HeldOut(1.0, 1.0, 1.0)
    assert _verdict(search, last, (), rest, False, shown, 50.0, DEFAULT.rest)[0] == verdict
