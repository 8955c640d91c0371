"""A torque whose rows are not those of the angles."""

from pathlib import Path

import numpy as np
import pytest

from orchestrator.errors import RecordError
from orchestrator.records.record import Reading, Record, read_record
from orchestrator.records.requests import hold_request
from orchestrator.records.timing import interpolate, interpolation_cost

TIME = 0.002 * np.arange(1000)


def _levels(count: int) -> np.ndarray:
    return np.random.default_rng(4).uniform(-5.0, 5.0, count)


@pytest.mark.parametrize("rows", [3, 10, 25])
def test_a_request_on_rows_of_the_angles_is_held_exactly(rows: int) -> None:
    own = TIME[::rows]
    request = hold_request(TIME, own, _levels(own.size), "u", "log")
    np.testing.assert_allclose(request.held, np.repeat(_levels(own.size), rows)[: TIME.size], atol=1e-9)
    assert request.within == 0.0
    assert request.raster == pytest.approx(0.002 * rows)


def test_a_request_between_rows_keeps_its_impulse_and_says_what_it_is_off_by() -> None:
    own, step = np.array([-0.01, 0.0015, 0.0071]), 0.002
    request = hold_request(TIME[:6], own, np.array([1.0, 3.0, -1.0]), "u", "log")
    np.testing.assert_allclose(request.held, [1.5, 3.0, 3.0, 3.0 - 4.0 * 0.45, -1.0, -1.0])
    variances = [4.0 * 0.25 * 0.75, 16.0 * 0.45 * 0.55]
    assert request.within == pytest.approx(np.sqrt(sum(variances) / 6.0))
    assert float(np.sum(request.held[1:3])) * step == pytest.approx(3.0 * 2 * step)


def test_rows_without_a_torque_have_none() -> None:
    own = np.array([0.1, 0.12, 0.14, 0.16])
    request = hold_request(TIME, own, np.array([1.0, np.nan, 2.0, 4.0]), "u", "log")
    assert np.isnan(request.held[:50]).all()
    np.testing.assert_allclose(request.held[50:60], 1.0)
    assert np.isnan(request.held[60:70]).all()
    np.testing.assert_allclose(request.held[70:90], np.repeat([2.0, 4.0], 10))
    assert np.isnan(request.held[90:]).all()


def test_a_sampled_signal_is_found_between_its_rows() -> None:
    own = TIME[::10]
    request = hold_request(TIME, own, np.sin(12.0 * own), "u", "log")
    assert request.sampled is not None
    np.testing.assert_allclose(request.sampled[10:-20], np.sin(12.0 * TIME)[10:-20], atol=2e-4)
    assert float(np.sqrt(np.mean((request.held - np.sin(12.0 * TIME)) ** 2))) > 0.05
    assert request.describe("u", 0).endswith("were it a signal that was sampled, held it would be off by 0.09 (rms)")


def test_a_torque_that_is_logged_when_it_changes_was_held() -> None:
    changes = np.sort(np.random.default_rng(1).choice(np.arange(1, 990), 60, replace=False))
    own = np.concatenate([[0.0], TIME[changes]])
    request = hold_request(TIME, own, _levels(own.size), "u", "log")
    assert request.sampled is None
    place = np.searchsorted(own, TIME + 1e-9) - 1
    known = np.isfinite(request.held)
    np.testing.assert_allclose(request.held[known], _levels(own.size)[place][known], atol=1e-9)


def test_a_torque_of_another_time_is_refused() -> None:
    with pytest.raises(RecordError, match=r"must be of the time of the angles, 0 to 1\.998 s, but is of 50 to 50\.1 s"):
        hold_request(TIME, np.array([50.0, 50.05, 50.1]), np.ones(3), "u", "log")
    with pytest.raises(RecordError, match="row 3, the time stamps of column `u` must increase"):
        hold_request(TIME, np.array([0.0, 0.1, 0.1]), np.ones(3), "u", "log")


def _log(path: Path, own: np.ndarray, torque: np.ndarray, start: float = 0.0) -> Path:
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(torque, own + start, name="u", unit="Nm")])
        angles = (("theta_m", 4.0), ("theta_l", 1.0))
        file.append(
            [asammdf.Signal(ratio * np.sin(5.0 * TIME), TIME + start, name=name, unit="rad") for name, ratio in angles]
        )
        file.save(path, overwrite=True)
    return path


@pytest.mark.parametrize("resample", [None, "uniform", "linear", "cubic"])
def test_resampling_speaks_of_angles_alone(resample: str | None, tmp_path: Path) -> None:
    own = TIME[::10]
    path = _log(tmp_path / "log.mf4", own, _levels(own.size))
    record = read_record(path, reading=Reading(resample=resample))
    np.testing.assert_allclose(record.u, np.repeat(_levels(own.size), 10), atol=1e-9)
    assert record.u_raster == pytest.approx(0.02)
    assert any("u held from its own row to the next (50 Hz), changes at rows only" in note for note in record.notes)


def test_a_part_has_the_torque_of_its_own_time(tmp_path: Path) -> None:
    own = TIME[::10]
    path = _log(tmp_path / "log.mf4", own, _levels(own.size))
    record = read_record(path, reading=Reading(part=(0.5, 1.5)))
    np.testing.assert_allclose(record.u, np.repeat(_levels(own.size), 10)[250 : 250 + record.size], atol=1e-9)


def test_rows_beyond_the_torque_are_left_out_and_said(tmp_path: Path) -> None:
    own = TIME[100:800:10]
    record = read_record(_log(tmp_path / "log.mf4", own, _levels(own.size)))
    assert record.size == 700
    assert any("300 rows without it left out" in note for note in record.notes)
    np.testing.assert_allclose(record.u, np.repeat(_levels(own.size), 10), atol=1e-9)


def test_a_jittering_log_holds_its_torque(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    time = np.cumsum(rng.uniform(3e-3, 7e-3, 800))
    levels = np.repeat(_levels(80), 10)
    rows = np.column_stack([time, levels, np.sin(4.0 * time)])
    path = tmp_path / "log.csv"
    np.savetxt(path, rows, delimiter=",", header="time,u,theta_m", comments="", fmt="%.9g")
    for how in ("linear", "cubic"):
        record = read_record(path, reading=Reading(resample=how))
        assert np.all(np.abs(record.u) <= np.abs(levels).max() + 1e-9)  # a spline would go beyond
        edges = np.append(time, 2.0 * time[-1] - time[-2])
        before = np.concatenate([[0.0], np.cumsum(levels * np.diff(edges))])
        impulse = np.interp(record.time + record.step, edges, before) - np.interp(record.time, edges, before)
        np.testing.assert_allclose(record.u[:-2], impulse[:-2] / record.step, atol=1e-4)
        assert any("u " in note and "held from row to row" in note for note in record.notes)


@pytest.mark.parametrize("how", ["linear", "cubic"])
def test_the_cost_of_interpolation_is_its_true_error(how: str) -> None:
    rng = np.random.default_rng(6)
    for signal in (lambda t: np.sin(9.0 * t), lambda t: np.repeat(_levels(200), 5)[(t / 0.01 + 1e-9).astype(int)]):
        time = 0.002 * np.arange(900) + rng.uniform(0.0, 0.0015, 900)
        grid = 0.002 * np.arange(10, 890)
        true = float(np.sqrt(np.mean((interpolate(grid, time, signal(time), how) - signal(grid)) ** 2)))
        told = interpolation_cost(time, signal(time), how)
        assert 0.4 * true < told < 4.0 * true


def test_a_record_keeps_the_other_reading_in_its_parts(tmp_path: Path) -> None:
    own = TIME[::10]
    record = read_record(_log(tmp_path / "log.mf4", own, np.sin(12.0 * own)))
    assert isinstance(record, Record)
    assert record.u_sampled is not None
    part = record.part(100, 400)
    assert part.u_sampled is not None
    np.testing.assert_array_equal(part.u_sampled, record.u_sampled[100:400])
    slow = read_record(tmp_path / "log.mf4", reading=Reading(rate=250.0))
    assert slow.u_sampled is not None
    assert slow.u_sampled.size == slow.size
