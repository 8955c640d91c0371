"""The zero of another record's encoders: told by a model's waves, and by nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.diagnosis.proof.moved_zero import from_zero, moved_zero
from orchestrator.diagnosis.proof.other_record import validate
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.plants.known import plants
from orchestrator.records.model_file import read_model
from orchestrator.records.record import record_from_columns
from tests.support.axis_record import MODEL, axis_record
from tests.support.short_records import AXIS, DRIVETRAIN, axis_likelihood, drivetrain_likelihood

RIPPLE = {"effects__torque_ripple__amplitude": 1.0, "effects__torque_ripple__cycles_per_rev": 5.0}
LEVEL = DiagnosisSettings().levels[8]


def moved(likelihood, by: np.ndarray):
    return replace(likelihood, signals=replace(likelihood.signals, y=likelihood.signals.y + by))


@pytest.mark.parametrize("by", [0.37, -0.2])
def test_a_zero_that_moved_is_found_within_a_wave(by: float) -> None:
    likelihood, p = axis_likelihood(600, **RIPPLE)
    assert moved_zero(moved(likelihood, np.array([by, 0.0])), p, LEVEL) == pytest.approx(by, abs=0.01)


def test_a_zero_further_off_is_found_but_for_whole_waves() -> None:
    likelihood, p = axis_likelihood(600, **RIPPLE)
    period = 2.0 * np.pi / 5.0
    found = moved_zero(moved(likelihood, np.array([3.0 * period + 0.3, 0.0])), p, LEVEL)
    assert found == pytest.approx(0.3, abs=0.01)


def test_a_zero_that_stayed_or_that_nothing_tells_is_left_where_it_is() -> None:
    likelihood, p = axis_likelihood(600, **RIPPLE)
    assert moved_zero(likelihood, p, LEVEL) == 0.0
    plain = p.copy()
    plain[AXIS.index("effects.torque_ripple.amplitude")] = 0.0
    assert moved_zero(moved(likelihood, np.array([0.37, 0.0])), plain, LEVEL) == 0.0
    smooth, _ = axis_likelihood(600)
    assert moved_zero(smooth, p, LEVEL) == 0.0  # a wave that the record has not


def test_the_load_counts_with_the_motor() -> None:
    likelihood, p = drivetrain_likelihood(600, effects__gravity_load__amplitude=20.0)
    ratio = DRIVETRAIN.ratio(p)
    there = moved(likelihood, np.array([0.4 * ratio, 0.4]))
    found = moved_zero(there, p, LEVEL)
    assert found / ratio == pytest.approx(0.4, abs=0.05)
    back = from_zero(there.signals, DRIVETRAIN, p, 0.4 * ratio)
    assert np.allclose(back.y, likelihood.signals.y, atol=1e-12)


def test_a_wave_is_judged_from_the_zero_of_each_record(tmp_path) -> None:
    p = list(plants()["ServoAxis"].extended([entry.default for entry in AXIS.table])[: len(AXIS.table)])
    for name, value in {"J": 1.0, "b": 2.0, "effects.torque_ripple.amplitude": 1.0,
                        "effects.torque_ripple.cycles_per_rev": 9.0}.items():  # fmt: skip
        p[AXIS.index(name)] = value
    (tmp_path / "axis.toml").write_text(MODEL)
    found = diagnose(axis_record(p, 4, "first"), read_model(tmp_path / "axis.toml"))
    assert [effect.name for effect in found.effects] == ["torque_ripple"]
    other = axis_record(p, 5, "other")
    columns = {"time": other.time, "u": other.u, "theta_m": other.theta_m + 0.25}
    same, elsewhere = (validate(one, found) for one in (other, record_from_columns(columns, "elsewhere")))
    assert same.moved_zero == 0.0
    assert elsewhere.moved_zero == pytest.approx(0.25, abs=0.005)
    assert elsewhere.misfit[0].after == pytest.approx(same.misfit[0].after, rel=0.2)
    assert elsewhere.misfit[0].before == pytest.approx(same.misfit[0].before, rel=1e-3)
    assert elsewhere.r_squared["after"][0] > 0.999
