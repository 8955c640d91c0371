"""Results whose rows are samples, as frames of other libraries."""

import sys

import numpy as np
import pytest

import orchestrator as oc
from orchestrator.api.sampled import SampledResult

TIME = np.array([0.0, 0.5, 1.0])
ANGLE = np.array([0.1, np.nan, 0.3])


class _Run(SampledResult):
    blocks = results = None
    command = "run"
    digits = 3

    def signals(self):
        return {"time": TIME, "plant.angle": ANGLE, "note": TIME * 2.0}

    @property
    def units(self):
        return {"plant.angle": "rad", "note": None}


def test_a_frame_has_the_samples_over_time_with_their_units():
    pytest.importorskip("pandas")
    frame = _Run().to_dataframe()
    assert list(frame.columns) == ["plant.angle", "note"]
    assert frame.index.name == "time"
    assert frame.loc[0.5, "note"] == 1.0
    assert np.array_equal(frame["plant.angle"], ANGLE, equal_nan=True)
    assert frame.attrs["units"]["plant.angle"] == "rad"


def test_a_dataset_has_the_samples_over_time_with_their_units():
    pytest.importorskip("xarray")
    data = _Run().to_xarray()
    assert data["plant.angle"].attrs == {"units": "rad"}
    assert data["note"].attrs == {}
    assert float(data["note"].sel(time=0.5)) == 1.0
    assert data["time"].attrs == {"units": "s"}


@pytest.mark.parametrize(("method", "library"), [("to_dataframe", "pandas"), ("to_xarray", "xarray")])
def test_a_library_that_is_missing_is_named_with_the_cure(monkeypatch, method, library):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(oc.InputError, match=rf"`{method}` needs the extra \[frames\]: pip install"):
        getattr(_Run(), method)()


def test_the_csv_file_has_the_same_samples_and_no_word_for_none(tmp_path):
    _Run().write_data(tmp_path)
    assert (tmp_path / "run.csv").read_text() == "time,plant.angle,note\n0,0.1,0\n0.5,,1\n1,0.3,2\n"


def test_results_of_runs_and_diagnoses_are_samples():
    for kind in (oc.PairResult, oc.SimulationResult, oc.DiagnosisResult, oc.FmuDiagnosisResult, oc.LocationResult,
                 oc.DesignResult):  # fmt: skip
        assert issubclass(kind, SampledResult), kind
