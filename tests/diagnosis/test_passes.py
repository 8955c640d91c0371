"""What a pass of the search leaves, and which other passes follow it."""

from dataclasses import replace
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from orchestrator.diagnosis import verdict
from orchestrator.diagnosis.fit.fitting import Parts, fit, split
from orchestrator.diagnosis.passes import passes
from orchestrator.diagnosis.rest import growth_of, left_of
from orchestrator.diagnosis.standing import outweighs_one_run
from orchestrator.diagnosis.verdict.remainder import (
    noise_floor,
)
from tests.support.short_records import DRIVETRAIN, SETTINGS, axis_likelihood
from tests.support.small_search import PARTS, axis_model


def test_what_is_left_of_the_final_fit() -> None:
    likelihood, p = axis_likelihood(effects__load_torque__torque=0.5)
    first = fit(likelihood, p, 1e-4, (), PARTS)
    whole = Parts(PARTS.seen, PARTS.validated, PARTS.held_out)
    base, final = fit(likelihood, likelihood.nominal, 1e-2, (), whole), fit(likelihood, p, 1e-4, (), whole)
    found = left_of(likelihood, base, final, first, PARTS, 1e-4)
    floor = noise_floor(likelihood, PARTS, 1e-4, p)
    assert found.missing == pytest.approx(floor - final.fitted)
    assert found.explained == pytest.approx(1.0 - (floor - final.fitted) / (floor - base.fitted))
    better = replace(base, fitted=floor + 1.0)
    assert left_of(likelihood, better, final, first, PARTS, 1e-4).explained == 0.0
    z = likelihood.whitened(p, 1e-4)
    assert growth_of(likelihood.over(180), final, whole) == pytest.approx(np.std(z[180:240]) / np.std(z[10:180]))


def quick(**verdict):
    few = {"noise_levels": 6, "first_level": 3, "shortlist": 1, "most_effects": 1, "most_in_a_repeat": 1}
    search = msgspec.structs.replace(SETTINGS.search, **few)
    fits = msgspec.structs.replace(SETTINGS.fit, iterations=5, block_iterations=1)
    return msgspec.structs.replace(
        SETTINGS, search=search, fit=fits, verdict=msgspec.structs.replace(SETTINGS.verdict, **verdict)
    )  # fmt: skip


def passed(settings, likelihood):
    small = replace(likelihood, settings=settings)
    parts, _ = split([small.signals.size], settings)
    return passes(axis_model(), small.signals, parts, small.nominal, settings, lambda *_: None)


def test_a_pass_that_explains_the_record_is_the_only_one() -> None:
    likelihood, _ = axis_likelihood(240, effects__coulomb_friction__motor__torque=0.8)
    found = passed(quick(), likelihood)
    assert not found.unknown
    assert [effect.label for effect in found.best.effects] == ["coulomb_friction@motor"]
    assert found.parts == Parts(slice(10, 120), slice(120, 180), slice(180, 240))
    assert found.search.parts == found.parts
    assert found.left.explained > 0.6
    assert found.likelihood.stop == 180


def test_what_shows_on_the_last_part_alone_is_sought_with_the_first_held_out() -> None:
    """A push of 1 N.m that sets in at three quarters of the record, and which no effect explains before."""
    likelihood, p = axis_likelihood(240)
    late, _ = axis_likelihood(240, effects__load_torque__torque=3.0)
    y = likelihood.signals.y.copy()
    y[180:, 0] = y[179, 0] + late.signals.y[180:, 0] - late.signals.y[179, 0]
    moved = replace(likelihood, signals=replace(likelihood.signals, y=y))
    found = passed(quick(), moved)
    grown = growth_of(
        moved.over(180), fit(moved, p, 1e-4, (), PARTS), Parts(PARTS.seen, PARTS.validated, PARTS.held_out)
    )
    assert grown > 3.0
    if found.unknown:
        assert found.left.growth > 3.0 or found.left.explained < 0.4
    else:
        assert found.parts == Parts(slice(60, 180), slice(180, 240), slice(10, 60))
    impossible = passed(quick(least_explained=1.0, least_missing=0.0, grown=1e9, proven=1.0, structured=-1e9), moved)
    assert impossible.unknown
    assert impossible.parts == PARTS
    easy = passed(quick(least_missing=1e9, grown=1e9), moved)
    assert not easy.unknown
    assert not easy.floor_off


@pytest.mark.parametrize("others", [1.0, 0.0])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_the_heaviest_tail_counts_wherever_it_is(monkeypatch, place: int, others: float) -> None:
    """One row in a hundred differs: excess kurtosis (1 - 6 p q) / (p q); signs that alternate have -2, zeros none."""
    columns = others * np.tile(np.array([1.0, -1.0]), 50)[:, None].repeat(3, axis=1)
    columns[:, place] = np.eye(1, 100, 7)[0]
    monkeypatch.setattr(verdict.remainder, "error_response", lambda likelihood, model: None)
    monkeypatch.setattr(verdict.remainder, "back_propagated", lambda response, raw: columns[:, 2:])
    likelihood = SimpleNamespace(innovations=lambda p, q: (columns, None), signals=SimpleNamespace(channels=2))
    white = SimpleNamespace(white=lambda z, part: z[part])
    fitted = SimpleNamespace(p=None, q=0.0, z=columns[:, :2], colour=white)
    found = verdict.remainder.tails(likelihood, fitted, slice(0, 100))
    assert found == pytest.approx((1.0 - 6.0 * 0.01 * 0.99) / (0.01 * 0.99))


@pytest.mark.parametrize(
    ("names", "better", "stands"),
    [
        (("late_load@log",), ("50 ms",), True),
        (("late_load@log", "early_torque@log"), ("50 ms",), True),
        (("late_load@log",), (), False),
        (("late_load@log", "coulomb_friction@motor"), ("50 ms",), False),
        (("coulomb_friction@motor",), ("500 ms",), True),
        (("coulomb_friction@motor",), (), False),
    ],
)
def test_one_run_says_nothing_against_what_many_show(names, better, stands) -> None:
    bank = {effect.label: effect for effect in DRIVETRAIN.bank}
    labels = ("one sample", "50 ms", "500 ms", "2 s", "whole part")
    after = SimpleNamespace(surely_better_than=lambda before: better, labels=labels, long=2)
    assert outweighs_one_run([bank[name] for name in names], SimpleNamespace(), after) is stands
