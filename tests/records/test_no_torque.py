"""Records of two angles without a torque: taken where asked for, refused elsewhere."""

from pathlib import Path

import numpy as np
import pytest

import orchestrator as oc
from orchestrator.records.columns import Column
from tests.support.written_record import write_record

TIME = 0.01 * np.arange(600)
ANGLE = np.sin(TIME)


def _written(path: Path, names: str, *columns: np.ndarray) -> Path:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=names, comments="", fmt="%.9g")
    return path


def test_two_angles_are_read_without_a_torque(tmp_path: Path) -> None:
    path = _written(tmp_path / "bench.csv", "time,pos_motor,pos_load,temperature", TIME, ANGLE, 0.1 * ANGLE, 0.0 * TIME)
    with pytest.raises(oc.RecordError, match="`u` must be there"):
        oc.read_record(path)
    record = oc.read_record(path, torque_needed=False)
    assert not record.has_torque
    assert record.theta_l == pytest.approx(0.1 * ANGLE, abs=1e-8)
    assert any("no column looks like a torque" in note for note in record.notes)
    assert record.n_missing == 0
    slower = oc.read_record(path, torque_needed=False, rate=50.0, part=(0.0, 5.5))
    assert not slower.has_torque
    assert slower.size < 300


def test_the_note_names_a_column_that_can_be_the_torque(tmp_path: Path) -> None:
    path = _written(tmp_path / "bench.csv", "time,theta_m,theta_l,channel_7", TIME, ANGLE, ANGLE, np.cos(TIME))
    named = oc.read_record(path, {"u": Column("channel_7")})
    assert named.has_torque
    assert named.u == pytest.approx(np.cos(TIME), abs=1e-8)


def test_a_torque_is_demanded_beside_one_angle(tmp_path: Path) -> None:
    path = _written(tmp_path / "one.csv", "time,theta_m", TIME, ANGLE)
    with pytest.raises(oc.RecordError, match="`u` must be there"):
        oc.read_record(path, torque_needed=False)


def test_a_record_without_torque_is_refused_by_what_needs_one(tmp_path: Path) -> None:
    path = _written(tmp_path / "bench.csv", "time,theta_m,theta_l", TIME, ANGLE, ANGLE)
    record = oc.read_record(path, torque_needed=False)
    with pytest.raises(oc.RecordError, match="`u` must hold numbers"):
        oc.diagnose(record)
    write_record(tmp_path / "again.csv", record)
    assert (tmp_path / "again.csv").read_text().startswith("time,theta_m,theta_l\n")
