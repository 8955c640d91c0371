"""Dates and times of day: the instants that they mean, and what is refused with its row."""

import datetime
from pathlib import Path

import numpy as np
import pytest

from orchestrator.errors import RecordError
from orchestrator.records.stamps import StampReader, is_stamp, seconds_of

FILE = Path("log.csv")


def _read(cells: list[str], row: int = 0) -> np.ndarray:
    reader = StampReader("t", FILE)
    halves = [reader.read(cells[:2], row), reader.read(cells[2:], row + 2)]  # as from two blocks of a file
    reader.check()
    return np.concatenate(halves).view("datetime64[ns]")


# Stamps, and the seconds from the first one on.
INSTANTS = {
    "zones, one after the other": (
        ["2024-03-31T01:59:59+01:00", "2024-03-31T03:00:00+02:00", "2024-03-31 06:30:01.5+05:30",
         "2024-03-30T20:00:02-0500", "2024-03-31T01:00:03Z"],
        [0.0, 1.0, 2.5, 3.0, 4.0],
    ),
    "a clock past two midnights": (
        ["23:59:59,5", "00:00:00.25", "", "20:00:00", "00:00:01"], [0.0, 0.75, np.nan, 72000.5, 86401.5],
    ),
    "a clock that goes back a little": (["12:00:00", "11:59:59", "12:00:01"], [0.0, -1.0, 1.0]),
    "German, over the end of a leap February": (
        ["29.2.2024 23:59", "01.03.2024 00:00:01", "1.3.2024 01:00:00,000001"], [0.0, 61.0, 3660.000001],
    ),
    "nanoseconds, and more digits than those": (
        ["2024-05-13T08:00:00.1", "2024-05-13T08:00:00.100000001", "2024-05-13T08:00:00.100000002999"],
        [0.0, 1e-9, 2e-9],
    ),
    "twelve hours, over noon": (["11:59:59.5 AM", "12:00:00.25 PM", "", "1:00:00 pm"], [0.0, 0.75, np.nan, 3600.5]),
    "twelve hours, over midnight": (["11:59:59 p.m.", "12:00:01 a.m.", "12:00:03 A.M."], [0.0, 2.0, 4.0]),
    "twelve hours with an American date": (
        ["12/31/2024 11:59:59 PM", "1/1/2025 12:00:00.125 AM", "1/1/2025 12:00:01 AM"], [0.0, 1.125, 2.0],
    ),
    "slashes, the day first": (["31/01/2024 23:59:59", "01/02/2024 00:00:00", "01/02/2024 00:00:01"], [0.0, 1.0, 2.0]),
    "slashes, the year first": (["2024/02/28 23:59:59", "2024/02/29 00:00:01"], [0.0, 2.0]),
    "milliseconds behind a colon": (["08:00:00:5", "08:00:00:10", "08:00:00:995", "08:00:01:0"],
                                    [0.0, 0.005, 0.99, 0.995]),
    "milliseconds behind a semicolon": (["2024-05-13 08:00:00;005", "2024-05-13 08:00:00;010"], [0.0, 0.005]),
    "an empty cell first": (["", "2024-05-13 08:00:00", "2024-05-13_08:00:02"], [np.nan, 0.0, 2.0]),
}  # fmt: skip


@pytest.mark.parametrize("name", INSTANTS)
def test_stamps_are_instants(name: str) -> None:
    cells, seconds = INSTANTS[name]
    assert all(is_stamp(cell) for cell in cells if cell)
    np.testing.assert_allclose(seconds_of(_read(cells), "t", FILE), seconds, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("cell", ["12:00", "2024-05-13", "1.5", "2024-05-13T08:00:00.", "13.05.24 08:00:00"])
def test_other_texts_are_no_stamps(cell: str) -> None:
    assert not is_stamp(cell)


@pytest.mark.parametrize(
    ("cells", "said"),
    [
        (["08:00:00", "", "noon"], "row 13, column `t` must be a time like the first row's, but is `noon`"),
        (["08:00:00", "2024-05-13 08:00:00"], "row 12, column `t` must be a time like the first row's"),
        (["08:00:00 AM", "08:00:00"], "row 12, column `t` must be a time like the first row's"),
        (["08:00:00 AM", "13:00:00 AM"], "row 12, column `t` must have at most 12 hours before noon"),
        (["01/02/2024 10:00:00", "02/02/2024 10:00:01"], "day and month cannot be told apart: write dates as 2024"),
        (["10:00:00:05", "10:00:00:24"], "must have milliseconds of three digits .* but has at most 2"),
        (["2024-02-29 08:00:00", "2023-02-29 08:00:00"], "row 12, column `t` must be a date, but is `2023-02-29 08"),
    ],
)
def test_a_cell_that_is_no_such_stamp_is_named_by_its_row_in_the_file(cells: list[str], said: str) -> None:
    with pytest.raises(RecordError, match=said):
        _read(cells, 10)


def test_a_column_without_a_stamp_is_refused() -> None:
    with pytest.raises(RecordError, match="column `t` must hold times, but is empty"):
        seconds_of(_read(["", ""]), "t", FILE)


@pytest.mark.parametrize(
    "shape", ["%Y-%m-%d %H:%M:%S.%f+02", "%Y-%m-%d %H:%M:%S.%f-0330", "%d-%b-%Y %H:%M:%S.%f", "%d %b %Y %H:%M:%S.%f"]
)
def test_stamps_of_databases_and_of_matlab_are_read_over_midnight(tmp_path, shape):
    begin = datetime.datetime(2026, 3, 31, 23, 59, 59)
    stamps = [(begin + datetime.timedelta(milliseconds=5 * n)).strftime(shape) for n in range(400)]
    found = StampReader("time", tmp_path / "log.csv").read(stamps, 0)
    assert set(np.diff(found).tolist()) == {5_000_000}
    with pytest.raises(RecordError, match="must be a date, but is `29-Xyz-2026"):
        StampReader("time", tmp_path / "log.csv").read(["29-Xyz-2026 01:02:03"], 0)
