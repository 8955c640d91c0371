"""One look at the rows: failed readings, a clock that was set, repeats and drift are named, and clean logs are not."""

import csv
from pathlib import Path

import numpy as np
import pytest

from benchmarks.log_rows import clean_log, what_is_said
from orchestrator.api.calibrate import calibrate
from orchestrator.api.estimate import estimate
from orchestrator.errors import RecordError
from orchestrator.records.columns import Column
from orchestrator.records.record import Reading, read_record, record_from_columns
from tests.support.independent_plant import make_record

RATE = 500.0
Columns = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def log() -> Columns:
    """Six seconds of a drivetrain with a gap, whose encoders do not begin at zero."""
    columns, _ = make_record({"alpha": 0.01}, 5, 6.0, RATE, counts=None, substeps=30)
    return columns | {"theta_m": columns["theta_m"] + 40.0, "theta_l": columns["theta_l"] + 10.0}


def written(path: Path, columns: Columns) -> Path:
    with path.open("w", newline="") as stream:
        rows = csv.writer(stream)
        rows.writerow(columns)
        rows.writerows(zip(*(values.tolist() for values in columns.values()), strict=True))
    return path


@pytest.mark.parametrize("seed", range(4))
def test_nothing_is_said_of_a_clean_log(seed: int) -> None:
    assert what_is_said(clean_log(np.random.default_rng(100 + seed))[0]) == ""


# --- readings that failed ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["theta_m", "theta_l"])
@pytest.mark.parametrize("value", [0.0, -1.0, 1e4, 20.0])
@pytest.mark.parametrize("rows", [[700], [700, 701], [50, 1200, 1201, 1202, 2000]])
def test_failed_readings_are_missing(log: Columns, name: str, value: float, rows: list[int]) -> None:
    broken = log[name].copy()
    broken[rows] = value
    record = record_from_columns(log | {name: broken}, "log")
    assert np.flatnonzero(record.is_missing).tolist() == rows
    np.testing.assert_array_equal(np.delete(getattr(record, name), rows), np.delete(log[name], rows))
    (said,) = record.doubts
    assert f"{rows[0] + 1}" in said
    assert f"of `{name}`" in said


@pytest.mark.parametrize("column", [Column(unit="deg"), Column(unit="counts", counts_per_rev=4096.0)])
def test_failed_readings_are_no_turns(log: Columns, column: Column, tmp_path: Path) -> None:
    """A -1 among counts looks like an angle that starts again from zero."""
    scale = 180.0 / np.pi if column.unit == "deg" else 4096.0 / (2.0 * np.pi)
    raw = np.round(log["theta_m"] * scale)
    raw[[700, 1400, 1401]] = -1.0
    record = read_record(written(tmp_path / "log.csv", log | {"theta_m": raw}), {"theta_m": column})
    assert np.flatnonzero(np.isnan(record.theta_m)).tolist() == [700, 1400, 1401]


def test_a_log_of_failed_readings_gives_the_gap_and_says_so(log: Columns) -> None:
    broken = log["theta_l"].copy()
    broken[[700, 1400]] = [0.0, -1.0]
    result = estimate(record_from_columns(log | {"theta_l": broken}, "log"), diagnose=False)
    assert result.alpha == pytest.approx(0.01, rel=0.03)
    head = str(result.blocks()[0])
    assert "rows 701, 1401 of `theta_l`" in head
    assert head[:-1] in f"log: {result.results().record.notes[0]}"


# --- the clock was set ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("jump", [24e-3, -24e-3, 2e-3, -3600.0, 0.5])
def test_a_clock_that_was_set_is_refused_and_both_cures_work(log: Columns, jump: float, tmp_path: Path) -> None:
    row = 400 + int(np.argmax(np.abs(np.diff(log["theta_m"]))[400:-400]))
    path = written(tmp_path / "log.csv", log | {"time": log["time"] + jump * (np.arange(log["time"].size) >= row)})
    said = (
        rf"row {row + 1} the stamps jump by .* ms where the motion does not: .*`\[columns.time\] rate = 500` .*uniform"
    )
    with pytest.raises(RecordError, match=said):
        read_record(path)
    told = read_record(path, {"time": Column(rate=500.0)})
    uniform = read_record(path, reading=Reading(resample="uniform"))
    for record in (told, uniform):
        np.testing.assert_array_equal(record.theta_m, log["theta_m"])
        assert record.step == pytest.approx(1.0 / RATE, rel=1e-6)
    if abs(jump) > 0.01:
        (note,) = uniform.doubts
        assert note.startswith("rows are taken at 500 Hz")
        mean = (log["time"].size - 1) / (log["time"][-1] + jump)
        assert mean < 0.0 or f"say {mean:.6g} Hz" in note


def test_rows_that_are_lost_are_no_clock_that_was_set(log: Columns) -> None:
    kept = np.delete(np.arange(log["time"].size), slice(1200, 1212))
    record = record_from_columns({name: values[kept] for name, values in log.items()}, "log")
    assert record.doubts == ()
    assert record.n_missing == 12


# --- repeats -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("every", [2, 3, 4, 5, 7])
@pytest.mark.parametrize("names", [("theta_m", "theta_l"), ("theta_l",), ("theta_m",)])
def test_rows_of_new_readings_are_taken(log: Columns, every: int, names: tuple[str, ...]) -> None:
    size, first = log["time"].size, 1
    rows = np.maximum((np.arange(size) - first) // every * every + first, 0)
    record = record_from_columns(log | {name: log[name][rows] for name in names}, "log")
    kept = np.arange(first, first + (size - first) // every * every, every)
    for name in ("theta_m", "theta_l", "time"):
        np.testing.assert_array_equal(getattr(record, name), log[name][kept])
    np.testing.assert_allclose(record.u[5], log["u"][kept[5] : kept[6]].mean())
    (said,) = record.doubts
    shown = " and ".join(f"`{name}`" for name in names)
    assert said.startswith(
        f"each reading of {shown} is repeated in {every} rows: read at {500 / every:.6g} Hz, written at"
    )


# --- two clocks ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ppm", [-300.0, 150.0, 400.0])
def test_a_load_on_another_clock_is_brought_to_the_motors(ppm: float) -> None:
    log, _ = make_record({"alpha": 0.01}, 7, 16.0, 250.0, counts=None, excitation="levels", substeps=30)
    t = log["time"]
    drifted = np.interp(t * (1.0 + 1e-6 * ppm), t, log["theta_l"])
    (said,) = record_from_columns(log | {"theta_l": drifted}, "log").doubts
    assert ("too fast" if ppm < 0.0 else "too slow") in said
    found, error = (float(said.split(mark)[1].split()[0].rstrip(")")) for mark in ("clock that is ", "standard error "))
    assert found == pytest.approx(abs(ppm), abs=max(4.0 * error, 0.1 * abs(ppm)))
    joined = record_from_columns(log | {"theta_l": drifted}, "log").theta_l
    assert joined is not None
    off = [np.sqrt(np.nanmean((one - log["theta_l"])[-1000:] ** 2)) for one in (drifted, joined)]
    assert off[1] < 0.3 * off[0]


# --- any FMU -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def spring(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Columns]:
    """An FMU of a mass on a spring, its map and a record of it."""
    from tests.support.box_fmu import DOMAINS, write_fmu, write_map
    from tests.support.box_records import record, write_record
    from tests.support.c_fmu import have_compiler

    if not have_compiler():
        pytest.skip("no C compiler")
    folder = tmp_path_factory.mktemp("spring")
    fmu, given = write_fmu(folder / "spring.fmu", DOMAINS[0]), write_map(folder / "map.toml", DOMAINS[0])
    path = write_record(folder / "record.csv", record(DOMAINS[0], (), np.random.default_rng(11), 1500))
    table = np.genfromtxt(path, delimiter=",", names=True)
    return fmu, given, {name: table[name] for name in table.dtype.names}


def test_records_of_any_fmu_are_looked_at_too(spring, tmp_path: Path) -> None:
    fmu, given, log = spring
    clean = calibrate(written(tmp_path / "clean.csv", log), fmu, given).results(tmp_path)
    failed, rows = log["x"].copy(), np.arange(log["x"].size)
    failed[[300, 600]] = 10.0 * np.ptp(failed)
    said = {"failed": "rows 301, 601 of `x` jump away", "stale": "each reading of `x` is repeated in 3 rows: read at"}
    for name, x in (("failed", failed), ("stale", log["x"][rows // 3 * 3])):
        found = calibrate(written(tmp_path / f"{name}.csv", log | {"x": x}), fmu, given).results(tmp_path)
        assert any(note.startswith(said[name]) for note in found.notes)
        for parameter, one in found.parameters.items():
            low, high = one.interval
            assert low < clean.parameters[parameter].value < high
    row = 400 + int(np.argmax(np.abs(np.diff(log["x"]))[400:-400]))
    jumped = written(tmp_path / "jumped.csv", log | {"time": log["time"] + 0.05 * (rows >= row)})
    with pytest.raises(
        RecordError, match=rf"row {row + 1} the stamps jump by \+50 ms .*: the clock was set, .*; put 0.01 s"
    ):
        calibrate(jumped, fmu, given)
