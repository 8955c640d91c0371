"""Encoders whose zeros lie many turns away."""

from dataclasses import replace

import numpy as np
import pytest

from orchestrator.estimation.zeros import set_zeros
from orchestrator.records.model_file import default_model
from orchestrator.records.record import Record, record_from_columns
from tests.support.independent_plant import make_record


@pytest.fixture(scope="module")
def record() -> Record:
    columns, _ = make_record({"alpha": 0.012}, seed=11, duration=6.0, substeps=25, contact="dead_zone")
    return record_from_columns(columns, "log")


@pytest.mark.parametrize(
    ("motor", "load"), [(100.0, 0.0), (1e6, 0.0), (0.0, -2e4), (4e6, 1e6), (-3e5, 5.0), (2.0, 0.0)]
)
def test_zeros_anywhere_come_near_each_other(motor: float, load: float, record: Record) -> None:
    assert record.theta_l is not None
    far = replace(record, theta_m=record.theta_m + motor, theta_l=record.theta_l + load)
    near, plain = set_zeros(far, default_model()), set_zeros(record, default_model())
    assert near.theta_l is not None
    assert plain.theta_l is not None
    ratio = default_model().parameters["i"].value
    twists = [one.theta_m / ratio - one.theta_l for one in (near, plain) if one.theta_l is not None]
    assert abs(float(np.median(twists[0]) - np.median(twists[1]))) < 0.03
    np.testing.assert_allclose(np.diff(near.theta_m), np.diff(record.theta_m), atol=1e-8)
    assert np.abs(near.theta_l).max() < 110.0
    assert (np.round((near.theta_l - far.theta_l) / (2.0 * np.pi), 6) % 1.0 == 0.0).all()
    assert "encoders' zeros differ" in near.notes[-1]


def test_zeros_that_are_near_stay(record: Record) -> None:
    assert set_zeros(record, default_model()) is record
    small = replace(record, theta_m=record.theta_m + 0.05)  # an offset of sensors, which `diagnose` names
    assert set_zeros(small, default_model()) is small


def test_one_encoder_loses_whole_turns(record: Record) -> None:
    far = replace(record, theta_m=record.theta_m + 1e5).without_load_encoder()
    near = set_zeros(far, default_model())
    assert np.abs(near.theta_m).max() < 200.0
    assert (np.round((near.theta_m - far.theta_m) / (2.0 * np.pi), 6) % 1.0 == 0.0).all()


@pytest.mark.parametrize("rows", [200, 201])
def test_a_record_shorter_than_its_filter_is_no_crash(rows: int, record: Record) -> None:
    """Stamps in the wrong unit make seconds into milliseconds."""
    names = ("time", "u", "theta_m", "theta_l")
    short = {name: np.asarray(getattr(record, name))[:rows] for name in names}
    fast = record_from_columns(short | {"time": 1e-6 * np.arange(rows)}, "fast")
    assert set_zeros(fast, default_model()).theta_m.size == rows
