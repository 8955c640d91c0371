"""What is just allowed in a record, and what is just not: shares, ranges, gaps, depths."""

import math
from pathlib import Path

import numpy as np
import pytest

from orchestrator.errors import RecordError
from orchestrator.records.checks import (
    LARGEST_ANGLE,
    LARGEST_VALUE,
    check_finite,
    check_moving,
    check_range,
    motion_span,
    quantisation_step,
)
from orchestrator.records.formats import open_source
from orchestrator.records.formats.nested import DEEPEST
from orchestrator.records.plausibility import lag_torque, momentum_balance
from orchestrator.records.timing import grid_of, interpolate, interpolation_cost, resample_grid


def angle_that_moves(blocks: range) -> tuple[np.ndarray, np.ndarray]:
    """Angle and time of 50 blocks of ten rows, in some of which the motor turns."""
    speed = np.zeros((50, 10))
    speed[blocks.start : blocks.stop] = 0.1
    return np.cumsum(speed), 0.01 * np.arange(500)


@pytest.mark.parametrize(
    ("blocks", "span"),
    [(range(10, 20), (1.0, 1.99)), (range(20), (0.0, 1.99)), (range(5, 35), (0.5, 3.49)), (range(5, 36), None)],
)
def test_a_motor_that_moves_in_a_part_of_the_record(blocks, span) -> None:
    found = motion_span(*angle_that_moves(blocks))
    assert (found is None) == (span is None)
    if span is not None:
        assert found == pytest.approx(span)


def test_a_motor_that_never_moves_has_no_span() -> None:
    assert motion_span(np.zeros(500), 0.01 * np.arange(500)) is None


def test_at_most_a_fifth_of_a_column_is_missing() -> None:
    values = np.arange(10.0)
    values[[3, 7]] = np.nan
    check_finite(values, "u", "a.csv")
    values[5] = np.nan
    with pytest.raises(RecordError, match=r"row 4, column `u` must have at most 20 % .* but 3 of 10 are"):
        check_finite(values, "u", "a.csv")


@pytest.mark.parametrize(
    ("bad", "said"),
    [
        ([2.0 * LARGEST_VALUE], r"row 2, column `u` must be between -1e\+12 and 1e\+12, but is 2e\+12: mend"),
        ([-math.inf, math.inf], r"row 2, column `u` must be a finite number, but is -inf \(and 1 more rows\)"),
    ],
)
def test_values_beyond_all_measure(bad, said) -> None:
    check_finite(np.array([0.0, LARGEST_VALUE, -LARGEST_VALUE]), "u", "a.csv")
    with pytest.raises(RecordError, match=said):
        check_finite(np.array([0.0, *bad]), "u", "a.csv")


def test_angles_that_no_encoder_reaches() -> None:
    check_range(np.array([0.0, -LARGEST_ANGLE]), "theta_m", "a.csv")
    with pytest.raises(
        RecordError, match=r"row 2, column `theta_m` must be an angle below 1e\+07 rad, but is -1.1e\+07"
    ):
        check_range(np.array([0.0, -1.1 * LARGEST_ANGLE]), "theta_m", "a.csv")


def held(start: int, stop: int, rows: int = 200) -> np.ndarray:
    """A ramp that sticks from one row to another."""
    ramp = 0.01 * np.arange(rows)
    ramp[1] = 1e-4  # its smallest change: more than a count in each row tells how fast it turns
    ramp[start:stop] = ramp[start]
    return ramp


def test_an_encoder_that_sticks_is_named_with_its_rows() -> None:
    check_moving({"u": np.ones(2000), "theta_m": held(50, 69, 2000)}, "theta_m", "pos", "a.csv")
    with pytest.raises(
        RecordError, match=r"row 51, column `pos` must follow the motion, but is 0.5 for 40 rows.*stuck"
    ):
        check_moving({"u": np.ones(2000), "theta_m": held(50, 90, 2000)}, "theta_m", "pos", "a.csv")
    clipped = np.minimum(held(0, 1), 1.5)
    arrays = {"theta_m": 30.0 * held(0, 1), "theta_l": clipped}
    with pytest.raises(RecordError, match=r"row 151, .* is 1.5 for 50 rows: the encoder is saturated at an end"):
        check_moving(arrays, "theta_l", "pos", "a.csv")


def test_a_motor_that_stands_still_is_stuck_where_something_drives_it() -> None:
    still, moving = np.ones(100), np.arange(100.0)
    for arrays in ({"u": moving, "theta_m": still}, {"theta_m": still, "theta_l": moving}):
        with pytest.raises(RecordError, match=r"column `pos` must change, but is 1 in all 100 rows"):
            check_moving(arrays, "theta_m", "pos", "a.csv")
    for arrays in ({"u": still, "theta_m": still}, {"u": still, "theta_m": still, "theta_l": still}):
        check_moving(arrays, "theta_m", "pos", "a.csv")


def test_a_load_that_rests_while_the_motor_crosses_the_gap_is_well() -> None:
    motor = 4.0 * held(0, 1)
    check_moving({"theta_m": motor, "theta_l": held(50, 78)}, "theta_l", "pos", "a.csv")
    with pytest.raises(RecordError, match="for 34 rows"):
        check_moving({"theta_m": motor, "theta_l": held(50, 84)}, "theta_l", "pos", "a.csv")


def test_the_count_of_an_encoder() -> None:
    angle = 3.0 * np.sin(0.01 * np.arange(1000))
    assert quantisation_step(0.01 * np.round(angle / 0.01)) == pytest.approx(0.01)
    assert quantisation_step(angle) == 0.0
    assert quantisation_step(np.zeros(10)) == 0.0


@pytest.mark.parametrize(("repeats", "cure"), [(2, "sort the rows by time"), (3, "the stamps are too coarse")])
def test_stamps_that_repeat(repeats: int, cure: str) -> None:
    time = np.arange(10.0)
    for n in range(repeats):
        time[3 * n + 1] = time[3 * n]
    with pytest.raises(RecordError, match=rf"row 2, column `t` must increase, but repeats the row before.*{cure}"):
        grid_of(time, "t", "a.csv")


def test_a_grid_with_gaps() -> None:
    place = np.array([0, 1, 2, 3, 6, 7, 8, 10, 11, 12, 13, 14, 15])
    grid = grid_of(5.0 + 0.25 * place, "t", "a.csv")
    assert (grid.start, grid.size, grid.place.tolist()) == (5.0, 16, place.tolist())
    assert (grid.timing.step, grid.timing.missing) == (pytest.approx(0.25), 3)
    assert grid.timing.gaps == ((4, 2), (9, 1))
    assert grid.timing.rounded == 0.01
    assert grid.timing.describe() == "4 Hz, no jitter, 3 rows missing in 2 gaps (longest 0.5 s)"


def test_gaps_between_stamps_that_jitter_lose_no_rows() -> None:
    """Most steps are longer than the mean one: counted in those, a gap of six rows would be one of five."""
    stamps = 0.005 * np.concatenate([[0.0], np.cumsum(np.resize([1.08, 1.08, 0.84], 599))])
    place = np.flatnonzero(np.arange(600) % 40 < 34)
    grid = grid_of(stamps[place], "t", "a.csv")
    assert grid.place.tolist() == place.tolist()
    assert grid.timing.step == pytest.approx(0.005, rel=1e-4)


def test_a_record_of_gaps_is_refused_with_the_longest() -> None:
    place = np.array([*range(10), *range(40, 50)])
    with pytest.raises(RecordError, match=r"row 11, .* but 60 % are \(longest gap 7.5 s from 2.25 s after the first"):
        grid_of(5.0 + 0.25 * place, "t", "a.csv")


@pytest.mark.parametrize(
    ("step", "said"),
    [
        (1e-9, "must step by at least"),
        (0.5, "looks like milliseconds"),
        (99.0, "looks like milliseconds"),
        (100.0, "must be in seconds"),  # a log at 10 kHz in microseconds
    ],
)
def test_steps_of_another_unit(step: float, said: str) -> None:
    with pytest.raises(RecordError, match=said) as caught:
        grid_of(step * np.arange(10), "t", "a.csv")
    assert ("milliseconds" in str(caught.value)) == (said == "looks like milliseconds")


def test_resampling_leaves_gaps_and_says_what_it_costs() -> None:
    time = 0.125 * np.array([*range(10), *range(20, 30)])
    grid, step = resample_grid(time)
    assert (step, grid.size) == (0.125, 30)
    values = interpolate(grid, time, 2.0 * time, "linear")
    assert np.flatnonzero(np.isnan(values)).tolist() == list(range(10, 20))
    good = np.isfinite(values)
    np.testing.assert_allclose(values[good], 2.0 * grid[good])
    even = 0.1 * np.arange(41)
    # Left out rows of t^2 are off by h^2 by lines, where h is the step: a quarter of that between the rows themselves.
    assert interpolation_cost(even, even**2, "linear") == pytest.approx(0.01 / 4.0)
    assert interpolation_cost(even, even**3, "cubic") == pytest.approx(0.0, abs=1e-12)
    assert interpolation_cost(even[:7], even[:7] ** 2, "linear") == 0.0


def test_the_momentum_of_a_torque_is_inertia_and_friction() -> None:
    time = 0.01 * np.arange(400)
    angle, speed = np.sin(3.0 * time), 3.0 * np.cos(3.0 * time)
    first = 0.4 * (1.0 - np.exp(-time / 0.4))  # impulse of the unit torque that the drive began with
    impulse = 0.2 * speed + 0.5 * angle + 0.3 * time + 1.0
    for begun in (0.0, 7.0):  # whatever the drive held when the record began
        found = momentum_balance(impulse + begun * first, speed, angle, first)
        assert found == (pytest.approx(0.2), pytest.approx(0.5), pytest.approx(1.0))


def test_the_torque_of_a_drive_lags() -> None:
    expected = 4.0 * (1.0 - np.exp(-0.1 * np.arange(5) / 0.25))
    np.testing.assert_allclose(lag_torque(np.full(5, 4.0), 0.25, 0.1), expected)


def test_a_parquet_file_of_many_row_groups_is_read(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    table = pyarrow.table({"time": 0.01 * np.arange(3000), "u": np.arange(3000.0)})
    parquet.write_table(table, tmp_path / "log.parquet", row_group_size=1)
    with open_source(tmp_path / "log.parquet") as source:
        assert source.load((1,))[0].tolist() == list(range(3000))


def test_groups_of_hdf5_are_read_to_a_depth(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        for name in ("time", "u"):
            file.create_dataset(name, data=np.arange(20.0))
        for depth, name in ((DEEPEST, "last"), (DEEPEST + 1, "beyond")):
            file.create_dataset("/".join([*(f"{name}{n}" for n in range(depth)), name]), data=np.arange(20.0))
        file["last0/round"] = file["last0"]  # a group within itself has no end
    with open_source(tmp_path / "log.h5") as source:
        names = {head.name.rpartition(".")[2] for head in source.heads}
        assert {"time", "u", "last"} <= names
        assert "beyond" not in names
        assert "(structure)" in source.dialect


def test_a_row_of_units_needs_more_units_than_words(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    for row, units in (("s;N.m;rad;note", ["s", "N.m", "rad", "note"]), ("note;N.m;rad;remark", ["", "", "", ""])):
        path.write_text(f"a;b;c;d\n{row}\n" + "".join(f"{n};1;2;3\n" for n in range(20)))
        with open_source(path) as source:
            assert [head.unit for head in source.heads] == units
