"""Stamps that jitter about a uniform clock are found; clocks that do anything else are refused as they were."""

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


def _two_rates() -> np.ndarray:
    return np.concatenate([ROWS[:400], ROWS[400] + 1.003 * ROWS[:400]]) + _white(0.15) - ROWS


def _random_walk() -> np.ndarray:
    return ROWS + STEP * 0.02 * np.cumsum(np.random.default_rng(2).normal(size=SIZE))


def _packets() -> np.ndarray:
    """Return stamps that are not correlated from one row to the next, but from each to the one after that."""
    return ROWS + 0.2 * STEP * np.resize([1.0, 1.0, -1.0, -1.0], SIZE)


def _without(rows: slice) -> np.ndarray:
    """Return jittering stamps of which rows are lost, for as many rows of values as there were."""
    return np.delete(_white(0.2, 900), np.arange(900)[rows])[:SIZE]


JITTER = {
    "a fifth": _white(0.2),
    "near a half": _white(0.45),
    "late": _late(),
    "normal": ROWS + 0.1 * STEP * np.random.default_rng(4).normal(size=SIZE),
}
OTHER = {
    "drift": _drift(),
    "two rates": _two_rates(),
    "random walk": _random_walk(),
    "packets of four": _packets(),
    "one row lost": _without(slice(500, 501)),
    "one row lost near the end": _without(slice(797, 798)),
    "a row lost here and there": _without(slice(20, 900, 90)),
    "a gap": _without(slice(300, 340)),
    "too far": _white(0.6).clip(min=np.concatenate([[-1.0], _white(0.6)[:-1] + 1e-5])),
    "steps at random": np.cumsum(np.random.default_rng(3).uniform(3e-3, 7e-3, SIZE)),
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


@pytest.mark.parametrize("name", OTHER)
def test_other_clocks_are_refused_with_the_advice(table: Table, name: str) -> None:
    assert np.all(np.diff(OTHER[name]) > 0.0)
    with pytest.raises(
        RecordError, match=r"must be uniform with a step of .*: say how to resample: `resample` uniform"
    ):
        record_from_columns(table | {"time": OTHER[name]}, "log")


@pytest.mark.parametrize("share", [0.2, 0.35])
@pytest.mark.parametrize("noise", [0.0, 2e-5])
def test_samples_that_jitter_with_their_stamps_are_not_uniform(share: float, noise: float) -> None:
    time, rng = _white(share), np.random.default_rng(5)
    heard = noise * rng.normal(size=SIZE)
    assert describe_jitter(time, np.sin(9.0 * ROWS) + heard)
    assert not describe_jitter(time, np.sin(9.0 * time) + heard)
    half_lost = np.where(rng.random(SIZE) < 0.1, np.nan, np.sin(9.0 * time) + heard)
    assert not describe_jitter(time, half_lost)


def test_white_stamps_are_rarely_refused_and_wandering_ones_never_taken() -> None:
    """With `WHITE` at 3 for ten lags, one record in forty would be refused."""
    still = np.zeros(SIZE)
    assert sum(bool(describe_jitter(_white(0.3, seed=seed), still)) for seed in range(300)) >= 298
    for seed in range(300):
        walk = np.cumsum(np.random.default_rng(seed).normal(size=SIZE))
        assert not describe_jitter(ROWS + 0.3 * STEP * walk / np.abs(walk).max(), still)


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

    def write(time: np.ndarray, motion: np.ndarray) -> None:
        rows = np.column_stack([time, np.sign(np.sin(2.0 * ROWS)), np.sin(9.0 * motion)])
        np.savetxt(path, rows, delimiter=",", header="time,u,y", comments="", fmt="%.9g")

    write(_white(0.4), ROWS)
    record = read_fmu_record(path, given)
    assert any(note.startswith("rows are taken as uniform at") for note in record.notes)
    np.testing.assert_allclose(record.time, ROWS, atol=0.05 * STEP)
    np.testing.assert_allclose(record.outputs[:, 0], np.sin(9.0 * ROWS), atol=1e-8)
    for time, motion in ((_white(0.4), _white(0.4)), (_drift() + 40.0 * ROWS**2 * STEP, ROWS)):
        write(time, motion)
        with pytest.raises(RecordError, match="must grow by"):
            read_fmu_record(path, given)
