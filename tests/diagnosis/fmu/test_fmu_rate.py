"""Long records of any FMU: the rate at which they are analysed, and what of them stays."""

import numpy as np
import pytest

from orchestrator.api.diagnose import diagnose
from orchestrator.diagnosis.fmu.record import FmuRecord, decimate, decimation_factor
from orchestrator.diagnosis.settings import DiagnosisSettings, FmuSettings
from tests.support.box_fmu import DOMAINS, write_fmu, write_map
from tests.support.box_records import record, write_record
from tests.support.c_fmu import have_compiler

NOISE = 1e-3


def _data(rows, frequency, step=1e-3):
    """A sine of 1 under an input that holds its steps, at a noise of a thousandth."""
    time = step * np.arange(rows)
    y = np.sin(2 * np.pi * frequency * time) + NOISE * np.random.default_rng(1).standard_normal(rows)
    u = np.sign(np.sin(2 * np.pi * 0.5 * frequency * time))
    return FmuRecord(time, u[:, None], y[:, None], "record.csv", time[:, None])


@pytest.mark.parametrize(
    ("rows", "frequency", "factor"),
    [(7_900, 1.0, 1), (40_000, 1.0, 10), (40_000, 10.0, 6), (40_000, 60.0, 1)],
    ids=["short", "slow", "faster", "fast"],
)
def test_a_long_record_keeps_the_rate_that_its_outputs_ask_for(rows, frequency, factor):
    found = decimation_factor(_data(rows, frequency))
    assert found == 1 if factor == 1 else abs(found - factor) <= 1


def test_fewer_rows_are_looked_at_and_all_inputs_act():
    data = _data(20_000, 1.0)
    less = decimate(data, 10)
    assert less.factor == 10
    assert less.step == pytest.approx(1e-2)
    np.testing.assert_array_equal(less.outputs, data.outputs[:19_990:10])
    np.testing.assert_array_equal(less.file_inputs, data.inputs[:19_990])
    held = np.cumsum(data.inputs[:-1, 0])[9::10] * data.step
    assert np.cumsum(less.inputs[:, 0]) * less.step == pytest.approx(held, abs=1e-12)
    assert less.signals[:, 0] == pytest.approx(less.time + 4.5e-3, abs=1e-9)


@pytest.mark.skipif(not have_compiler(), reason="no C compiler")
def test_a_saturation_between_the_rows_that_are_looked_at_is_found_to_its_size(tmp_path):
    domain, rng = DOMAINS[0], np.random.default_rng(8)
    case = record(domain, ("input_saturation",), rng, 1300)
    fmu, map_path = write_fmu(tmp_path / "Spring.fmu", domain), write_map(tmp_path / "map.toml", domain)
    settings = DiagnosisSettings(fmu=FmuSettings(rows=400, per_band=2.1, most_above=0.3))
    found = diagnose(write_record(tmp_path / "r.csv", case), fmu, map_path, settings=settings)
    found.close()
    assert found.diagnosis.workings.problem.data.factor == 3
    assert found.diagnosis.workings.problem.m == 6  # at least four in a sample, a whole number a row of the file
    (effect,) = found.effects
    assert effect.name == "input_saturation"
    assert effect.parameters["limit"].value == pytest.approx(case.sizes[0], rel=0.01)
    (output,) = found.test[0].signals
    assert output.final < 1.1 * output.noise


def test_all_rows_of_a_short_record_stay():
    data = _data(500, 1.0)
    assert decimate(data, decimation_factor(data)) is data
