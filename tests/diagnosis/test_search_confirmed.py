"""A small effect that both parts of a record ask for."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.diagnosis.fit.fitting import Fit, fit
from orchestrator.diagnosis.search.candidate import Candidate
from orchestrator.diagnosis.search.confirmed import is_confirmed, most_gain, share_of
from orchestrator.shared.inference.colour import WHITE, Colour
from tests.support.short_records import (
    AXIS,
    SETTINGS,
    axis_angles,
    axis_likelihood,
    signals_from,
)
from tests.support.small_search import PARTS, search_of

LOAD = next(effect for effect in AXIS.bank if effect.label == "load_torque@load")
PLACE = AXIS.index("effects.load_torque.torque")
LEVEL = SETTINGS.levels[-1]
TORQUE = 0.02  # N.m, of 8 that drive the axis
JUDGE = "orchestrator.diagnosis.search.judging"


def record(early: float = TORQUE, late: float = TORQUE):
    """The likelihood of an axis with a constant torque that changes where the deciding part begins."""
    likelihood, p = axis_likelihood()
    u, noise = likelihood.signals.u, likelihood.signals.noise
    load = np.where(np.arange(u.size) < PARTS.fitted.stop, early, late)
    y = axis_angles(p, u - load)
    y[:, 0] += noise[0] * np.random.default_rng(105).standard_normal(u.size)
    return replace(likelihood, signals=signals_from(y, u, 1, noise))


def models(likelihood, torque: float = TORQUE) -> tuple[Fit, Fit]:
    """A model with a constant torque and the one without, all else as it is."""
    p = likelihood.nominal.copy()
    before = fit(likelihood, p, LEVEL, (), PARTS, most=0)
    p[PLACE] = torque
    return fit(likelihood, p, LEVEL, (), PARTS, most=0), before


def test_a_part_asks_for_a_share_of_an_effect() -> None:
    likelihood = record()
    for torque, share in ((TORQUE, 1.0), (2.0 * TORQUE, 0.5), (-TORQUE, -1.0)):
        found = share_of(likelihood, *models(likelihood, torque), PARTS.validated)
        assert abs(found.value - share) < 3.0 * found.error
        assert found.error < 0.2 * abs(share)
    nothing = share_of(record(0.0, 0.0), *models(record(0.0, 0.0)), PARTS.validated)
    assert abs(nothing.value) < 3.0 * nothing.error


def test_the_error_of_a_share_is_that_of_the_noise() -> None:
    """At a tenth of the size it is ten times as large a part of it, and it holds where the noise is a torque."""
    likelihood = record()
    small, large = (share_of(likelihood, *models(likelihood, f * TORQUE), PARTS.fitted).error for f in (0.1, 1.0))
    assert small == pytest.approx(10.0 * large, rel=0.05)
    z = np.diff(np.array([likelihood.whitened(m.p, LEVEL)[PARTS.fitted, 0] for m in models(likelihood)]), axis=0)
    assert large >= np.linalg.norm(z) ** -1 * 0.8


def test_nothing_is_asked_where_an_effect_does_nothing_or_a_model_fails() -> None:
    likelihood = record()
    model, before = models(likelihood)
    assert share_of(likelihood, before, before, PARTS.validated) is None
    assert (
        share_of(likelihood, replace(model, colour=Colour(WHITE.lags, np.full((1, 1), np.nan))), before, PARTS.fitted)
        is None
    )
    astray = before.p.copy()
    astray[AXIS.index("J")] = np.nan
    assert share_of(likelihood, model, replace(before, p=astray), PARTS.fitted) is None


@pytest.mark.parametrize(
    ("early", "late", "confirmed"),
    [
        (TORQUE, TORQUE, True),
        (TORQUE, 0.0, False),  # it ends
        (0.0, TORQUE, False),  # it begins
        (TORQUE, 3.0 * TORQUE, False),  # it grows
        (TORQUE, -TORQUE, False),
    ],
)
def test_both_parts_must_ask_for_as_much(early: float, late: float, confirmed: bool) -> None:
    likelihood = record(early, late)
    model, before = models(likelihood)
    assert is_confirmed(likelihood, model, before, PARTS) is confirmed
    assert not is_confirmed(likelihood, model, before, replace(PARTS, fitted=PARTS.seen))
    assert not is_confirmed(likelihood, before, before, PARTS)


def gaining(model: Fit, before: Fit, fitted: float, decided: float) -> tuple[Candidate, Candidate]:
    """Candidates of two models, of which the first gains so much on either part."""
    settings = SETTINGS.search
    poor = replace(before, q=1e-3, fitted=0.0, validated=0.0)
    return (
        Candidate((LOAD,), replace(model, q=1e-3, fitted=fitted, validated=decided), settings),
        Candidate((), poor, settings),
    )


@pytest.mark.parametrize(
    ("fitted", "decided", "late", "noise", "earns"),
    [
        (17.7, 0.1, TORQUE, True, True),  # the deciding part gains next to nothing, and asks for as much
        (4.0, 11.1, TORQUE, True, True),
        (17.7, 0.1, 0.0, True, False),
        (17.7, 0.1, TORQUE, False, False),  # what is left is no noise: it may be anything
        (14.8, 0.1, TORQUE, True, False),  # 10 beyond its parameter are asked for in all
        (14.8, 3.1, 0.0, True, True),  # as ever: enough on either part
    ],
)
def test_a_small_effect_pays_by_what_both_parts_gain_together(
    fitted: float, decided: float, late: float, noise: bool, earns: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A true effect that was missed: 17.7 where it was fitted, 0.1 on the part that decides, five errors from zero."""
    monkeypatch.setattr(f"{JUDGE}.is_noise", lambda *_: noise)
    likelihood = record(TORQUE, late)
    search = search_of(likelihood)
    candidate, base = gaining(*models(likelihood), fitted, decided)
    assert search.earns(candidate, base, base) is earns


def test_a_model_that_runs_away_without_an_effect_answers_to_it() -> None:
    likelihood = record()
    model, _ = models(likelihood)
    away = model.p.copy()
    away[AXIS.index("b")] = -1e4
    assert not most_gain(likelihood, model, away, PARTS.fitted) < 1e9
    assert most_gain(likelihood, model, model.p, PARTS.fitted) == 0.0
