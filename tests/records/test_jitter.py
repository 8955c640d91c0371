"""Stamps that jitter about a uniform clock are found, lost rows among them; samples at uneven times are resampled."""

import re
from pathlib import Path

import numpy as np
import pytest

from orchestrator.diagnosis.fmu.mapping import InputEntry, Map, OutputEntry
from orchestrator.diagnosis.fmu.record import read_fmu_record
from orchestrator.errors import RecordError
from orchestrator.records.jitter import describe_jitter
from orchestrator.records.record import Reading, read_record, record_from_columns
from tests.support.independent_plant import make_record

Table = dict[str, np.ndarray]
STEP, SIZE = 0.005, 800
ROWS = STEP * np.arange(SIZE)


@pytest.fixture(scope="module")
def table() -> Table:
    return make_record({"alpha": 0.01}, seed=3, duration=4.0)[0]


def _white(share: float, size: int = SIZE, seed: int = 0) -> np.ndarray:
    """Return times whose distance from the clock is uniform, ``share`` of a step at most."""
    return STEP * (np.arange(size) + share * np.random.default_rng(seed).uniform(-1.0, 1.0, size))


def _late() -> np.ndarray:
    """Return stamps that come late, most a little."""
    return ROWS + STEP * np.minimum(np.random.default_rng(1).exponential(0.12, SIZE), 0.5)


def _drift() -> np.ndarray:
    return _white(0.2) + 0.4 * STEP * np.sin(np.pi * ROWS / ROWS[-1])


def _random_walk() -> np.ndarray:
    return ROWS + STEP * 0.02 * np.cumsum(np.random.default_rng(2).normal(size=SIZE))


def _packets() -> np.ndarray:
    """Return stamps that are not correlated from one row to the next, but from each to the one after that."""
    return ROWS + 0.2 * STEP * np.resize([1.0, 1.0, -1.0, -1.0], SIZE)


JITTER = {
    "a fifth": _white(0.2),
    "near a half": _white(0.45),
    "late": _late(),
    "normal": ROWS + 0.1 * STEP * np.random.default_rng(4).normal(size=SIZE),
}
UNEVEN = {
    "drift": _drift(),
    "random walk": _random_walk(),
    "packets of four": _packets(),
    "too far": _white(0.6).clip(min=np.concatenate([[-1.0], _white(0.6)[:-1] + 1e-5])),
    "steps at random": np.cumsum(np.random.default_rng(3).uniform(3e-3, 7e-3, SIZE)),
}
LOST = {
    "one": slice(500, 501),
    "one near the end": slice(790, 791),
    "some here and there": slice(20, 780, 90),
    "a gap": slice(300, 340),
}


@pytest.mark.parametrize("time", JITTER.values(), ids=JITTER)
def test_rows_are_uniform_where_stamps_jitter(table: Table, time: np.ndarray) -> None:
    for start in (0.0, 3e4):
        record = record_from_columns(table | {"time": start + time}, "log")
        told = record_from_columns(table | {"time": start + time}, "log", None, True)
        np.testing.assert_array_equal(record.time, told.time)
        np.testing.assert_array_equal(record.theta_m, table["theta_m"])
        jitter = 1e3 * np.std(time - ROWS)
        notes = [note for note in record.notes if "jitter" in note]
        assert len(notes) == 1
        rate, said = re.match(r"rows are taken as uniform at (\S+) Hz: .* jitter by (\S+) ms", notes[0]).groups()
        assert float(rate) == pytest.approx(1.0 / record.step, rel=1e-5)
        assert record.step == pytest.approx(STEP, rel=1e-4)
        assert float(said) == pytest.approx(jitter, rel=0.02)
        assert not any("taken as uniform" in note for note in told.notes)


@pytest.mark.parametrize("name", UNEVEN)
def test_samples_at_uneven_times_are_resampled_and_told(name: str) -> None:
    time = UNEVEN[name]
    assert np.all(np.diff(time) > 0.0)
    record = record_from_columns({"time": time, "u": np.sin(5.0 * time), "theta_m": np.sin(9.0 * time)}, "log")
    assert any("angles resampled (linear)" in note and "error" in note for note in record.notes)
    np.testing.assert_allclose(np.diff(record.time), record.step, rtol=1e-6)
    np.testing.assert_allclose(record.theta_m, np.sin(9.0 * record.time), atol=3e-3)


@pytest.mark.parametrize("name", LOST)
@pytest.mark.parametrize("share", [0.2, 0.35])
def test_rows_that_are_lost_among_stamps_that_jitter_are_missing_samples(name: str, share: float) -> None:
    kept = np.delete(np.arange(SIZE), np.arange(SIZE)[LOST[name]])
    table = {"time": _white(share)[kept], "u": np.sin(5.0 * ROWS)[kept], "theta_m": np.sin(9.0 * ROWS)[kept]}
    record = record_from_columns(table, "log")
    assert any("rows are taken as uniform" in note for note in record.notes)
    assert (record.size, record.n_missing) == (SIZE, SIZE - kept.size)
    np.testing.assert_array_equal(record.theta_m[kept], table["theta_m"])


@pytest.mark.parametrize("share", [0.2, 0.35])
@pytest.mark.parametrize("noise", [0.0, 2e-5])
def test_samples_that_jitter_with_their_stamps_are_not_uniform(share: float, noise: float) -> None:
    time, rng = _white(share), np.random.default_rng(5)
    heard = noise * rng.normal(size=SIZE)
    assert describe_jitter(time, np.sin(9.0 * ROWS) + heard)
    assert not describe_jitter(time, np.sin(9.0 * time) + heard)
    half_lost = np.where(rng.random(SIZE) < 0.1, np.nan, np.sin(9.0 * time) + heard)
    assert not describe_jitter(time, half_lost)


def test_the_option_goes_before(table: Table, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = np.column_stack([_white(0.3), *(table[name] for name in ("u", "theta_m", "theta_l"))])
    np.savetxt(path, rows, delimiter=",", header="time,u,theta_m,theta_l", comments="", fmt="%.9g")
    assert any("taken as uniform" in note for note in read_record(path).notes)
    assert any("resampled (linear)" in note for note in read_record(path, reading=Reading(resample="linear")).notes)
    assert not any("taken as uniform" in n for n in read_record(path, reading=Reading(resample="uniform")).notes)


def test_records_of_fmus_have_the_same_rule(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    given = Map(inputs={"u": InputEntry("u")}, outputs={"y": OutputEntry("y")})

    def write(time: np.ndarray, motion: np.ndarray, kept: np.ndarray | slice = slice(None)) -> None:
        rows = np.column_stack([time, np.sign(np.sin(2.0 * ROWS))[kept], np.sin(9.0 * motion)[kept]])
        np.savetxt(path, rows, delimiter=",", header="time,u,y", comments="", fmt="%.9g")

    write(_white(0.4), ROWS)
    record = read_fmu_record(path, given)
    assert any(note.startswith("rows are taken as uniform at") for note in record.notes)
    np.testing.assert_allclose(record.time, ROWS, atol=0.05 * STEP)
    np.testing.assert_allclose(record.outputs[:, 0], np.sin(9.0 * ROWS), atol=1e-8)
    kept = np.delete(np.arange(SIZE), [300, 301, 700])
    write(_white(0.35)[kept], ROWS, kept)
    lossy = read_fmu_record(path, given)
    np.testing.assert_allclose(lossy.time, ROWS, atol=0.05 * STEP)
    np.testing.assert_allclose(lossy.outputs[:, 0], np.sin(9.0 * ROWS), atol=1e-5)
    for time, motion in ((_white(0.4), _white(0.4)), (_drift() + 40.0 * ROWS**2 * STEP, ROWS)):
        write(time, motion)
        with pytest.raises(RecordError, match="must grow by"):
            read_fmu_record(path, given)
