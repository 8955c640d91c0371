"""Several records of one machine: one series with common parts, the predictor in time through each, one verdict."""

from dataclasses import replace

import numpy as np
import pytest

import orchestrator as oc
from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.diagnosis.fit.fitting import split
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.runs import Run, in_parts, in_time, stretches
from orchestrator.diagnosis.fit.together import series
from orchestrator.diagnosis.proof.by_record import repeats
from orchestrator.diagnosis.proof.simulation import simulate
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.errors import RecordError, ScenarioError
from orchestrator.plants.known.drivetrain import PLANT
from orchestrator.records.model_file import default_model
from orchestrator.records.record import Record, record_from_columns
from tests.support.independent_plant import make_record

SETTINGS = DiagnosisSettings()
P = PLANT.extended(default_model().values)


def record_of(seed: int, duration: float = 4.0, friction: float = 2.0, **options: object) -> Record:
    columns, _ = make_record({"Fc_l": friction}, seed, duration, substeps=25, **options)
    return record_from_columns(columns, f"record-{seed}")


def test_rows_stand_by_part_and_then_by_record() -> None:
    rows, order = in_parts([4, 6], [(2, 3), (3, 5)])
    assert order.tolist() == [0, 1, 4, 5, 6, 2, 7, 8, 3, 9]
    assert [own.tolist() for own in rows] == [[0, 1, 5, 8], [2, 3, 4, 6, 7, 9]]
    runs = [Run(own, np.ones(2), name) for own, name in zip(rows, "ab", strict=True)]
    assert list(stretches(runs, slice(0, 5), 10)) == [(0, slice(0, 2)), (1, slice(2, 5))]
    assert list(stretches(runs, slice(3, 8), 10)) == [(1, slice(3, 5)), (0, slice(5, 6)), (1, slice(6, 8))]
    assert list(stretches((), slice(3, 20), 10)) == [(0, slice(3, 10))]
    found, place = in_time(runs, 7, 10)
    assert found.tolist() == rows[1].tolist()
    assert place == 4
    assert in_time((), 7, 10)[1] == 7


def test_parts_of_a_series_are_those_of_its_records() -> None:
    parts, splits = split([1000, 600], SETTINGS)
    assert splits == [(500, 750), (300, 450)]
    assert (parts.fitted, parts.validated, parts.held_out) == (slice(10, 800), slice(800, 1200), slice(1200, 1600))
    most, (edges,) = split([40_000], SETTINGS)
    assert edges == (3000, 4500)
    assert most.held_out == slice(4500, 40_000)


def test_the_predictor_runs_through_each_record_in_time() -> None:
    one, two = record_of(1), record_of(2, 3.0)
    joined, _ = series([one, two], 1.0, SETTINGS)
    p = P.copy()
    p[PLANT.index("effects.input_delay.delay")] = 0.012
    # The same noise for all, so that gains are the same.
    same = tuple(replace(run, noise=joined.noise) for run in joined.runs)
    together = RecordLikelihood(PLANT, replace(joined, runs=same), P, joined.size, SETTINGS)
    states = together.innovations(p, 0.01)[1]
    for record, run in zip((one, two), joined.runs, strict=True):
        alone, _ = series([record], 1.0, SETTINGS)
        alone = replace(alone, noise=joined.noise, torque=joined.torque)
        own = RecordLikelihood(PLANT, alone, P, alone.size, SETTINGS)
        np.testing.assert_allclose(states[run.rows][100:], own.innovations(p, 0.01)[1][100:], rtol=1e-3, atol=1e-4)
        rows = run.rows[-150:]
        start = states[rows[0]]
        run_alone = simulate(PLANT, p, start, alone, slice(record.size - 150, record.size))
        run_joined = simulate(PLANT, p, start, joined, slice(int(rows[0]), int(rows[-1]) + 1))
        np.testing.assert_allclose(run_joined, run_alone, rtol=0.0, atol=1e-12)


def test_repeats_set_a_floor() -> None:
    first = record_of(3)
    rng = np.random.default_rng(0)
    noisy = [
        replace(first, theta_m=first.theta_m + rng.normal(0.0, 2e-3, first.size), source=name) for name in ("a", "b")
    ]
    signals, _ = series([*noisy, record_of(4)], 1.0, SETTINGS)
    found = repeats(signals, PLANT.encoders, SETTINGS.proof)
    assert found is not None
    assert found.sources == ("a", "b")
    assert found.floor["theta_m"] == pytest.approx(2e-3, rel=0.06)
    assert found.floor["theta_l"] == 0.0
    alone, _ = series([first, record_of(4)], 1.0, SETTINGS)
    assert repeats(alone, PLANT.encoders, SETTINGS.proof) is None


def test_records_must_belong_together() -> None:
    model, first = default_model(), record_of(1)
    with pytest.raises(RecordError, match="encoders must be those of record-1"):
        diagnose([first, record_of(2).without_load_encoder()], model)
    slow = record_of(5, rate=100.0)
    with pytest.raises(RecordError, match=r"sample time must be that of record-1, 0\.005 s, but is 0\.01 s"):
        diagnose([first, slow], model)


def test_several_records_are_judged_without_a_search() -> None:
    first = record_of(1, friction=0.0, mismatch=0.0)
    records = [first, record_of(2, friction=0.0, mismatch=0.0), replace(first, source="again")]
    found = oc.diagnose(records, default_model(), search=False)
    assert found.effects == ()
    assert [one.source for one in found.diagnosis.records] == ["record-1", "record-2", "again"]
    assert found.diagnosis.repeats is not None
    assert found.diagnosis.repeats.sources == ("record-1", "again")
    assert [record.source for record in found.more] == ["record-2", "again"]
    with pytest.raises(ScenarioError, match="`record` must be at least one record"):
        oc.diagnose([], default_model())


@pytest.mark.slow
def test_one_verdict_with_the_evidence_of_each_record() -> None:
    columns, truth = make_record({"Fc_l": 2.0}, 61, 10.0, substeps=50)
    other, _ = make_record({"Fc_l": 2.0}, 62, 10.0, substeps=50, linear=truth["linear"])
    records = [record_from_columns(columns, "one"), record_from_columns(other, "two")]
    found = diagnose(records, default_model())
    assert [effect.name for effect in found.effects] == ["coulomb_friction"]
    assert found.effects[0].parameters["torque"].value == pytest.approx(2.0, rel=0.02)
    assert [one.source for one in found.records] == ["one", "two"]
    for one in found.records:
        for misfit in one.misfit:
            assert misfit.after < 2.0 * misfit.noise < misfit.before
    assert found.found().records[1].rows == records[1].size
    assert found.repeats is None
