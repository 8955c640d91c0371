"""LabVIEW's measurement files: one time for all channels, one for each, none, and several segments."""

from pathlib import Path

import numpy as np
import pytest

from orchestrator.errors import RecordError
from orchestrator.records.model_file import read_model
from orchestrator.records.record import Column, Reading, read_record
from tests.support.independent_plant import make_record

NAMES = ("u", "theta_m", "theta_l")


@pytest.fixture(scope="module")
def columns() -> dict[str, np.ndarray]:
    return make_record({"alpha": 0.01}, seed=4, duration=4.0)[0]


def _head(x_columns: str, steps: list[str], names: list[str], comma: bool = False, dimension: str = "Time") -> str:
    channels = len(NAMES)
    lines = [
        "LabVIEW Measurement", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab",
        f"Decimal_Separator\t{',' if comma else '.'}", "Multi_Headings\tNo", f"X_Columns\t{x_columns}",
        "Time_Pref\tRelative", "Date\t2026/01/02", "Time\t12:00:00.5", "***End_of_Header***", "",
        f"Channels\t{channels}", "Samples" + "\t800" * channels, "Y_Unit_Label\tN.m\trad\trad",
        "X_Dimension" + f"\t{dimension}" * channels, "X0" + "\t0.0000000000000000E+0" * channels,
        "Delta_X\t" + "\t".join(steps), "***End_of_Header***", "\t".join([*names, "Comment"]),
    ]  # fmt: skip
    return "\n".join(lines) + "\n"


def _rows(table: list[np.ndarray], comma: bool = False) -> str:
    lines = ["\t".join("" if v != v else f"{v:.9f}" for v in row) for row in np.column_stack(table).tolist()]  # noqa: PLR0124
    text = "\n".join(lines) + "\n"
    return text.replace(".", ",") if comma else text


@pytest.mark.parametrize("comma", [False, True])
def test_one_time_for_all_channels(tmp_path: Path, columns: dict[str, np.ndarray], comma: bool) -> None:
    path = tmp_path / "log.lvm"
    text = _head("One", ["0.005"] * 3, ["X_Value", *NAMES], comma) + _rows(list(columns.values()), comma)
    path.write_text(text.replace("0.005", "0,005") if comma else text)
    record = read_record(path)
    assert record.notes[1].startswith("X_Value in s")
    for name in ("time", *NAMES):
        np.testing.assert_allclose(getattr(record, name), columns[name], atol=1e-8)
    named = read_record(path, {"time": Column("X_Value")})
    np.testing.assert_allclose(named.time, columns["time"], atol=1e-8)


@pytest.mark.parametrize("times", [["X_Value"], []])
def test_a_comment_on_the_data_stands_behind_the_first_row(
    times: list[str], tmp_path: Path, columns: dict[str, np.ndarray]
) -> None:
    names = [*("time" for _ in times), *NAMES]
    first, *rows = _rows([columns[name] for name in names]).splitlines()
    path = tmp_path / "log.lvm"
    path.write_text(_head("One", ["0.005"] * 3, [*times, *NAMES]) + "\n".join([first + "\trun 1, slow", *rows]) + "\n")
    record = read_record(path)
    assert record.size == columns["u"].size
    np.testing.assert_allclose(record.theta_l, columns["theta_l"], atol=1e-8)


@pytest.mark.parametrize(("x_columns", "old", "new"), [
    ("One", "X0\t0.0000000000000000E+0", "X0\t5.0E-2"), ("No", "X0\t0.0000000000000000E+0", "X0\t5.0E-2"),
    ("Multi", "Channels\t3", "Channels\t3\nTime\t12:00:00.5\t12:00:00.5\t12:00:01"),
])  # fmt: skip
def test_channels_that_begin_apart_are_refused(
    x_columns: str, old: str, new: str, tmp_path: Path, columns: dict[str, np.ndarray]
) -> None:
    text = _head(x_columns, ["0.005"] * 3, ["X_Value", *NAMES]) + _rows(list(columns.values()))
    path = tmp_path / "log.lvm"
    path.write_text(text.replace(old, new))
    with pytest.raises(RecordError, match="all channels must begin together, but begin at"):
        read_record(path)


def test_no_time_but_a_step(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path = tmp_path / "log.lvm"
    path.write_text(_head("No", ["0.005"] * 3, list(NAMES)) + _rows([columns[name] for name in NAMES]))
    record = read_record(path)
    assert "time from the row and 200 Hz" in record.notes[1]
    np.testing.assert_allclose(record.theta_l, columns["theta_l"], atol=1e-8)


def test_an_empty_time_and_a_step(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path = tmp_path / "log.lvm"
    rows = _rows([np.full(columns["u"].size, np.nan), *(columns[name] for name in NAMES)])
    path.write_text(_head("No", ["0.005"] * 3, ["X_Value", *NAMES]) + rows)
    record = read_record(path)
    np.testing.assert_allclose(record.time, columns["time"], atol=1e-9)
    np.testing.assert_allclose(record.theta_l, columns["theta_l"], atol=1e-8)
    path.write_text(_head("No", ["0.005", "0.01", "0.005"], ["X_Value", *NAMES]) + rows)
    with pytest.raises(RecordError, match=r"say `\[columns\.time\] rate"):
        read_record(path)
    np.testing.assert_allclose(read_record(path, {"time": Column(rate=200.0)}).time, columns["time"], atol=1e-9)


def test_no_time_and_several_steps_are_refused(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path = tmp_path / "log.lvm"
    path.write_text(_head("No", ["0.005", "0.01", "0.005"], list(NAMES)) + _rows([columns[name] for name in NAMES]))
    with pytest.raises(RecordError, match="column `time` must be there"):
        read_record(path)


def test_a_time_for_each_channel(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path = tmp_path / "log.lvm"
    time = columns["time"]
    slow = np.full(time.size, np.nan)  # the load's angle at half the rate: its columns end half-way
    half = (time.size + 1) // 2
    clock, load = slow.copy(), slow.copy()
    clock[:half], load[:half] = time[::2], columns["theta_l"][::2]
    names = ["X_Value", "u", "X_Value", "theta_m", "X_Value", "theta_l"]
    path.write_text(
        _head("Multi", ["0.005", "0.005", "0.01"], names)
        + _rows([time, columns["u"], time, columns["theta_m"], clock, load])
    )
    with pytest.raises(RecordError, match=r"column `theta_l` has its own time stamps: .* `resample` linear or cubic"):
        read_record(path)
    record = read_record(path, None, (), Reading(resample="cubic"))
    np.testing.assert_allclose(record.theta_m, columns["theta_m"], atol=1e-8)
    np.testing.assert_allclose(record.u, columns["u"], atol=1e-8)
    np.testing.assert_allclose(record.theta_l[:-2], columns["theta_l"][:-2], atol=2e-3)


def test_a_spectrum_has_no_time(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path = tmp_path / "log.lvm"
    text = _head("One", ["0.005"] * 3, ["X_Value", *NAMES], dimension="Frequency") + _rows(list(columns.values()))
    path.write_text("\n".join(line for line in text.split("\n") if not line.startswith("Delta_X")))
    with pytest.raises(RecordError, match="column `time` must be there"):
        read_record(path)


def test_a_second_segment_is_refused_and_the_cure_works(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path = tmp_path / "log.lvm"
    whole = _head("One", ["0.005"] * 3, ["X_Value", *NAMES]) + _rows(list(columns.values()))
    segment = whole[whole.index("Channels") :]
    path.write_text(whole + segment)
    with pytest.raises(RecordError, match=r"must hold one segment, but another one has its head above line \d+: keep"):
        read_record(path)
    path.write_text(whole[: whole.index("Channels")] + segment)
    np.testing.assert_allclose(read_record(path).theta_m, columns["theta_m"], atol=1e-8)


def test_a_model_file_names_the_time(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path, model = tmp_path / "log.lvm", tmp_path / "model.toml"
    path.write_text(_head("One", ["0.005"] * 3, ["X_Value", *NAMES]) + _rows(list(columns.values())))
    model.write_text('[columns.time]\nname = "X_Value"\nrate = 400\n')
    np.testing.assert_allclose(read_record(path, read_model(model).columns).step, 0.0025, atol=1e-12)
