"""Laws from the torque that a motion needs, where a controller hides them from predictions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from orchestrator.diagnosis.diagnose import DEFAULT_SETTINGS, diagnose
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.together import at_one_rate, series
from orchestrator.diagnosis.passes import BY_TORQUE
from orchestrator.diagnosis.search.by_torque import _independent
from orchestrator.diagnosis.search.search import Search
from orchestrator.records.model_file import Model, read_model
from orchestrator.records.record import Record
from orchestrator.shared.stopwatch import Stopwatch
from tests.support.light_rotor import DRY, INERTIA, rotor_record
from tests.support.short_records import AXIS

FRICTION = "effects.coulomb_friction.motor.torque"
SEED = 1  # of a rotor whose likeliest model without friction is ten times too heavy


@pytest.fixture(scope="module")
def model(tmp_path_factory) -> Model:
    path: Path = tmp_path_factory.mktemp("rotor") / "rotor.toml"
    path.write_text(
        'fmu = "ServoAxis"\n[parameters.J]\nvalue = 8e-6\nrelative_uncertainty = 0.6\n'
        "[parameters.b]\nvalue = 1e-5\nrelative_uncertainty = 0.9\n"
    )
    return read_model(path)


@pytest.fixture(scope="module")
def record() -> Record:
    return rotor_record(SEED)


def search_of(record: Record, model: Model) -> Search:
    """Return a search of a record by its torque."""
    nominal = AXIS.extended(model.values)
    analyses = at_one_rate([record], AXIS, nominal, DEFAULT_SETTINGS)
    signals, parts = series([one.record for one in analyses], 0.0, DEFAULT_SETTINGS)
    likelihood = RecordLikelihood(AXIS, signals, nominal, parts.validated.stop, DEFAULT_SETTINGS)
    return Search(likelihood, model, parts, as_given=True, most=4, of_torque=True)


def test_the_torque_tells_friction_and_inertia_of_a_rotor_that_a_loop_hides(record, model) -> None:
    search = search_of(record, model)
    base, best = search.run()
    place = AXIS.index("J")
    assert base.fit.p[place] > 5.0 * INERTIA
    assert [effect.label for effect in best.effects] == ["coulomb_friction@motor"]
    assert best.fit.p[AXIS.index(FRICTION)] == pytest.approx(DRY, rel=0.02)
    assert best.fit.p[place] == pytest.approx(INERTIA, rel=0.2)
    assert [step.accepted for step in search.steps] == [True, False]


def test_a_torque_that_no_law_explains_names_none(record, model) -> None:
    noise = np.std(record.u) * np.random.default_rng(3).standard_normal(record.size)
    search = search_of(replace(record, u=noise), model)
    base, best = search.run()
    assert best is base


def test_a_part_that_stands_still_is_not_asked(record, model) -> None:
    search = search_of(record, model)
    y = search.likelihood.signals.y.copy()
    y[search.parts.validated] = y[search.parts.validated.start]
    search.likelihood = replace(search.likelihood, signals=replace(search.likelihood.signals, y=y))
    base, best = search.run()
    assert best is base


def test_what_the_torque_tells_is_named_where_it_predicts_better(record, model) -> None:
    found = diagnose(record, model)
    (friction,) = found.effects
    assert (found.verdict, friction.name) == ("effects", "coulomb_friction")
    assert friction.parameters["torque"].value == pytest.approx(DRY, rel=0.01)
    ahead = {row.horizon: {error["model"]: error["theta_m"] for error in row.errors} for row in found.horizons}
    assert ahead["500 ms"]["final"] < 0.3 * ahead["500 ms"]["parameters"]
    assert found.trust.level.word == "amber"
    assert found.warnings[1:2] == (BY_TORQUE,)


def test_neighbours_that_miss_the_same_count_once() -> None:
    white = np.random.default_rng(1).standard_normal(2000)
    assert _independent(white) == pytest.approx(2000, rel=0.3)
    assert _independent(np.repeat(white[:200], 10)) < 400


def test_a_search_by_torque_ends_when_its_time_is_up(record, model) -> None:
    search = replace(search_of(record, model), allowed=Stopwatch(1e-9))
    base, best = search.run()
    assert best is base
    assert search.stopped
