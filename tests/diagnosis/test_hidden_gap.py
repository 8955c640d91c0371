"""A gap before a load that no encoder sees: where its filter starts decides whether it finds the load at all."""

import time
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.simulated import model_of
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.reference import Reference
from orchestrator.diagnosis.fit.together import series
from orchestrator.diagnosis.search.hidden_gap import gap_of_the_estimator
from orchestrator.diagnosis.settings import DiagnosisSettings
from tests.support.hidden_effects import Case, one_encoder_case

SETTINGS = DiagnosisSettings()
SEED = 9975049  # a loop whose load rests in the middle of a gap of three times its typical twist
LOW = 3e-4  # process noise at which a filter follows its model


def likelihood_of(*cases: Case) -> tuple[RecordLikelihood, Reference, slice]:
    """Return the likelihood of records of one machine, the estimator's gap, and the part that was fitted."""
    model = model_of(cases[0])
    plant = model.plant
    nominal = plant.extended(model.values)
    signals, parts = series([case.record for case in cases], plant.value(nominal, plant.drive.lag), SETTINGS)
    likelihood = RecordLikelihood(plant, signals, nominal, signals.size, SETTINGS)
    found = gap_of_the_estimator(likelihood, model, parts.fitted, time.monotonic() + 600.0)
    assert found is not None
    return likelihood, found, parts.fitted


def off(likelihood: RecordLikelihood, p: np.ndarray, part: slice) -> float:
    """Return the rms of whitened innovations; 1: those of the right model."""
    return float(np.sqrt(np.mean(likelihood.whitened(p, LOW)[part] ** 2)))


@pytest.fixture(scope="module")
def loop() -> tuple[RecordLikelihood, Reference, slice]:
    return likelihood_of(one_encoder_case(SEED, 20.0))


def test_the_estimator_tells_where_the_load_is(loop) -> None:
    _, found, _ = loop
    (start,) = found.starts
    errors = np.sqrt(np.diag(start.covariance))
    assert np.all(np.abs(start.state) < 4.0 * errors)  # the machine rests at zero at first
    assert errors[2] < 1e-4


def test_a_filter_that_starts_there_follows_and_one_that_starts_anywhere_is_lost(loop) -> None:
    likelihood, found, part = loop
    assert off(likelihood.about(found.p, found.starts), found.p, part) == pytest.approx(1.0, abs=0.1)
    assert off(likelihood.about(found.p), found.p, part) > 3.0


def test_a_stretch_starts_where_the_model_finds_the_load(loop) -> None:
    likelihood, found, part = loop
    known = likelihood.about(found.p, found.starts)
    own, block = known.alone(slice(1000, part.stop), found.p, LOW)
    at = 1000 - SETTINGS.likelihood.head
    assert own.reference.starts[0].state == pytest.approx(known.innovations(found.p, LOW)[1][at, :5])
    assert off(own, found.p, block) == pytest.approx(1.0, abs=0.15)


def test_of_a_later_part_the_start_is_not_known(loop) -> None:
    likelihood, _, part = loop
    found = gap_of_the_estimator(
        likelihood, model_of(one_encoder_case(SEED, 20.0)), slice(part.start + 500, part.stop), time.monotonic() + 600.0
    )
    assert found is not None
    assert found.starts == ()


def test_each_of_several_records_has_its_start() -> None:
    """The second record is the first one from some moment in its motion on."""
    at_rest = one_encoder_case(SEED, 16.0)
    record, later = at_rest.record, slice(700, None)
    moving = replace(record, time=record.time[later], u=record.u[later], theta_m=record.theta_m[later])
    likelihood, found, part = likelihood_of(at_rest, replace(at_rest, record=moving))
    assert abs(found.starts[1].state[1]) > 20.0 * abs(found.starts[0].state[1])
    assert off(likelihood.about(found.p, found.starts), found.p, part) == pytest.approx(1.0, abs=0.1)
    assert off(likelihood.about(found.p, found.starts[::-1]), found.p, part) > 1.5
