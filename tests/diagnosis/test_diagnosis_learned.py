"""A law learned inside the predictor from what no effect explains."""

import numpy as np
import pytest

from orchestrator.diagnosis.fit.fitting import Free, Parts, fit
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.proof.learned import formula_of, knots_of, learned_law
from orchestrator.plants.learned import KNOTS, LOAD_SPEED, arguments_of, names, with_law
from tests.support.short_records import AXIS, DRIVETRAIN, SETTINGS, drivetrain_likelihood

PARTS = Parts(slice(10, 500), slice(500, 750), slice(750, 1000))


def test_a_plant_offers_its_signals() -> None:
    codes = [argument.code for argument in arguments_of(DRIVETRAIN)]
    assert len(set(codes)) == len(codes) == 7
    assert {argument.site for argument in arguments_of(DRIVETRAIN)} == {"motor", "load", "shaft"}
    assert {argument.site for argument in arguments_of(AXIS)} == {"motor"}


def test_a_straight_law_is_viscous_friction() -> None:
    likelihood, p = drivetrain_likelihood(120)
    plant = with_law(DRIVETRAIN)
    assert plant.names[: len(p)] == DRIVETRAIN.names
    nominal = plant.extended(likelihood.nominal[: len(DRIVETRAIN.table)])
    wide = RecordLikelihood(plant, likelihood.signals, nominal, 120, SETTINGS)
    off = nominal.copy()
    assert np.allclose(wide.innovations(off, 0.01)[0], likelihood.innovations(likelihood.nominal, 0.01)[0])
    code, knots, values = names()
    off[plant.index(code)] = LOAD_SPEED
    speeds = np.linspace(-50.0, 50.0, KNOTS)
    for knot, value, speed in zip(knots, values, speeds, strict=True):
        off[plant.index(knot)], off[plant.index(value)] = speed, 0.7 * speed
    viscous = likelihood.nominal.copy()
    viscous[DRIVETRAIN.index("b_l")] += 0.7
    with_damping = likelihood.innovations(viscous, 0.01)[0]
    assert np.allclose(wide.innovations(off, 0.01)[0], with_damping, rtol=0.0, atol=1e-9)
    assert not np.allclose(with_damping, likelihood.innovations(likelihood.nominal, 0.01)[0], rtol=0.0, atol=1e-6)


def test_knots_lie_where_samples_are() -> None:
    values = np.random.default_rng(0).standard_normal(4000) ** 3
    knots = knots_of(values)
    assert knots is not None
    assert knots.size == KNOTS
    assert np.all(np.diff(knots) > 0.0)
    assert np.diff(knots)[KNOTS // 2] < 0.2 * np.diff(knots)[0]
    assert knots_of(np.zeros(100)) is None


@pytest.mark.parametrize(
    ("law", "formula"),
    [
        (lambda s: 0.3 * s * np.abs(s), "0.3 s |s|"),
        (lambda s: 2.0 * np.sign(s) - 0.1 * s**3, "2 sign(s) -0.1 s^3"),
        (np.exp, ""),
    ],
)
def test_a_short_formula_is_offered_where_one_runs_within_the_band(law, formula) -> None:
    knots = np.linspace(-3.1, 3.0, KNOTS)
    assert formula_of(knots, law(knots), np.full(KNOTS, 0.01), 1.5) == formula


@pytest.mark.slow
def test_the_law_that_is_missing_is_learned() -> None:
    """A drag that grows with the square of the load's speed, of which the learner knows nothing."""
    likelihood, _ = drivetrain_likelihood(1000, effects__quadratic_drag__coefficient=20.0)
    place = DRIVETRAIN.index("b_l")
    nominal = float(likelihood.nominal[place])
    free = (Free(place, 0.05 * nominal, 1e-3, 1e6, (nominal, 0.05 * nominal)),)
    base = fit(likelihood, likelihood.nominal, SETTINGS.levels[8], free, PARTS)
    law = learned_law(likelihood.over(750), base, PARTS, "rad")
    assert law is not None
    assert (law.site, law.argument) == ("load", "speed")
    assert law.shrinks > 5.0
    # Viscous friction is free beside it: what counts is the curve without its straight part.
    knots = np.array(law.knots)
    straight = np.vander(knots, 2)
    rest = [
        v - straight @ np.linalg.lstsq(straight, v, rcond=None)[0]
        for v in (np.array(law.values), 20.0 * knots * abs(knots))
    ]
    assert np.corrcoef(rest)[0, 1] > 0.95
    assert all(low <= value <= high for low, value, high in zip(law.low, law.values, law.high, strict=True))
