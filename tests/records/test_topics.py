"""Logs merged from several topics: rows hold the cells of one topic each, and the others are empty."""

from pathlib import Path

import numpy as np
import pytest

from orchestrator.errors import RecordError
from orchestrator.records.record import Reading, Record, read_record

STEP, ROWS = 0.005, 900


def _signals(time: np.ndarray) -> dict[str, np.ndarray]:
    torque = 5.0 * np.sign(np.sin(2.0 * np.pi * time / 0.8 + 0.1))
    return {"u": torque, "theta_m": 3.0 * np.sin(2.0 * time), "theta_l": 0.75 * np.sin(2.0 * time)}


def _merged(topics: list[tuple[tuple[str, ...], float]]) -> dict[str, np.ndarray]:
    """Return the columns of a merged log; topics with their delays [s]."""
    rows = []
    for names, delay in topics:
        time = STEP * np.arange(ROWS) + delay
        signals = _signals(time)
        rows += [(t, {name: signals[name][n] for name in names}) for n, t in enumerate(time.tolist())]
    rows.sort(key=lambda row: row[0])
    empty = float("nan")
    return {"time": np.array([t for t, _ in rows])} | {
        name: np.array([cells.get(name, empty) for _, cells in rows]) for name in ("u", "theta_m", "theta_l")
    }


def _write(folder: Path, columns: dict[str, np.ndarray], kind: str) -> Path:
    path = folder / f"log.{kind}"
    if kind == "csv":
        rows = zip(*(values.tolist() for values in columns.values()), strict=True)
        lines = [",".join("" if cell != cell else f"{cell:.9g}" for cell in row) for row in rows]  # noqa: PLR0124
        path.write_text("\n".join([",".join(columns), *lines]) + "\n")
    else:
        np.savez(path, **columns)
    return path


def _check(record: Record, delay: float) -> None:
    time = STEP * np.arange(ROWS) + delay
    assert record.size >= ROWS - 1
    expected = _signals(record.time + (time[0] if record.time[0] == 0.0 else 0.0))
    settled = np.convolve(np.abs(np.diff(expected["u"], prepend=expected["u"][0])), np.ones(7), "same") == 0.0
    np.testing.assert_allclose(record.u[settled], expected["u"][settled], atol=1e-9)
    assert record.n_missing == 0
    assert any("topics with rows of their own" in note for note in record.notes)


@pytest.mark.parametrize("kind", ["csv", "npz"])
@pytest.mark.parametrize("delay", [0.0021, 0.0009, 0.0049])
def test_a_torque_topic_beside_one_of_angles(tmp_path: Path, kind: str, delay: float) -> None:
    columns = _merged([(("u",), 0.0), (("theta_m", "theta_l"), delay)])
    record = read_record(_write(tmp_path, columns, kind), None, (), Reading(resample="linear"))
    _check(record, delay)
    good = np.isfinite(columns["theta_m"])
    np.testing.assert_allclose(record.theta_m, columns["theta_m"][good][: record.size], atol=1e-8)
    np.testing.assert_allclose(record.theta_l, columns["theta_l"][good][: record.size], atol=1e-8)


def test_a_part_of_merged_topics(tmp_path: Path) -> None:
    columns = _merged([(("u",), 0.0), (("theta_m", "theta_l"), 0.0021)])
    path = _write(tmp_path, columns, "csv")
    part = read_record(path, None, (), Reading(resample="linear", part=(1.0, 3.0)))
    whole = read_record(path, None, (), Reading(resample="linear"))
    np.testing.assert_allclose(part.theta_m, whole.theta_m[200:601], atol=1e-8)


def test_each_encoder_as_a_topic_needs_an_interpolation(tmp_path: Path) -> None:
    columns = _merged([(("u",), 0.0), (("theta_m",), 0.0017), (("theta_l",), 0.0033)])
    path = _write(tmp_path, columns, "csv")
    with pytest.raises(RecordError, match="has its own time stamps: state how to interpolate it to those of `theta_m`"):
        read_record(path)
    record = read_record(path, None, (), Reading(resample="linear"))
    _check(record, 0.0017)
    expected = _signals(STEP * np.arange(ROWS) + 0.0017)
    np.testing.assert_allclose(record.theta_l[5:-5], expected["theta_l"][: record.size][5:-5], atol=2e-5)


def test_samples_that_are_merely_missing_are_no_topics(tmp_path: Path) -> None:
    columns = _merged([(("u", "theta_m", "theta_l"), 0.0)])
    for name in ("u", "theta_m", "theta_l"):
        columns[name][100:400] = np.nan
    with pytest.raises(RecordError, match="must have at most 20 % of its samples missing"):
        read_record(_write(tmp_path, columns, "csv"))


def test_a_torque_in_every_fifth_row_is_a_topic(tmp_path: Path) -> None:
    columns = _merged([(("u", "theta_m", "theta_l"), 0.0)])
    columns["u"][np.arange(ROWS) % 5 != 0] = np.nan
    record = read_record(_write(tmp_path, columns, "csv"), None, (), Reading(resample="linear"))
    assert any("2 topics with rows of their own" in note for note in record.notes)
    np.testing.assert_allclose(record.theta_m, columns["theta_m"], atol=1e-8)
    settled = np.convolve(np.abs(np.diff(_signals(columns["time"])["u"], prepend=5.0)), np.ones(21), "same") == 0.0
    np.testing.assert_allclose(record.u[settled], _signals(columns["time"])["u"][settled], atol=1e-9)


def test_samples_lost_here_and_there_are_no_topics(tmp_path: Path) -> None:
    columns = _merged([(("u", "theta_m", "theta_l"), 0.0)])
    columns["u"][np.random.default_rng(1).random(ROWS) < 0.4] = np.nan
    with pytest.raises(RecordError, match="must have at most 20 % of its samples missing"):
        read_record(_write(tmp_path, columns, "csv"))
