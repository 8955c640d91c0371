"""What ``inspect --columns`` says of a log: what was recognised, what not, and what a choice would change."""

import json
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cli import main
from orchestrator.errors import RecordError
from orchestrator.records.columns import Column
from orchestrator.records.preview import preview_log


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A drive's log in amperes and degrees, whose second encoder has a name that nobody knows."""
    time = np.arange(400) * 2.0
    rows = np.column_stack([time, np.sin(time / 90), 40 * np.sin(time / 100), 3 * np.sin(time / 100)])
    lines = ["Export of a drive", "Device;D7", "t [ms];Current setpoint [A];Motor position [deg];Achse B [deg]"]
    path = tmp_path / "axis.csv"
    path.write_text("\n".join([*lines, *(";".join(f"{v:.6g}" for v in row) for row in rows)]) + "\n")
    return path


def columns_of(preview) -> dict:
    return {one.column: one for one in preview.columns}


def test_what_is_recognised_what_is_not_and_what_is_missing(log: Path) -> None:
    seen = preview_log(log, {})
    columns = columns_of(seen)
    assert (seen.names_line, seen.lines[0]) == (3, "Export of a drive")
    assert [channel.taken_as for channel in seen.channels] == ["time", "u", "theta_m", ""]
    assert columns["theta_l"].how == "absent"
    assert columns["u"].needs == ("torque_constant",)
    assert "torque_constant" in seen.problem
    assert (columns["u"].most, columns["theta_m"].most) == (None, pytest.approx(np.deg2rad(40.0), rel=1e-3))
    assert seen.channels[3].rows[0] == "0"


def test_a_column_that_is_missing_hides_no_other(log: Path) -> None:
    log.write_text(log.read_text().replace("Motor position [deg]", "Achse A [deg]"))
    seen = preview_log(log, {})
    assert [channel.taken_as for channel in seen.channels] == ["time", "u", "", ""]
    assert seen.missing == ("theta_m",)
    assert "both look like the motor's angle" in seen.problem


def test_a_stated_name_that_is_wrong_hides_no_other(log: Path) -> None:
    seen = preview_log(log, {"theta_l": Column(name="Achse Q")})
    assert [channel.taken_as for channel in seen.channels] == ["time", "u", "theta_m", ""]
    assert seen.missing == ("theta_l",)
    assert "did you mean `Achse B [deg]`?" in seen.problem


def test_a_channel_that_is_stated_is_taken_from_the_column_of_its_own_name(tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    rows = "\n".join(f"{n / 100},{n % 7},{n / 9:.3f},{n / 90:.4f}" for n in range(60))
    path.write_text(f"time,u,theta_m,theta_l\n{rows}\n")
    moved = preview_log(path, {"theta_m": Column(name="theta_l")})
    assert [channel.taken_as for channel in moved.channels] == ["time", "u", "", "theta_m"]
    assert columns_of(moved)["theta_l"].how == "absent"
    assert moved.problem == ""
    twice = preview_log(path, {"theta_m": Column(name="u"), "theta_l": Column(name="u"), "u": Column(name="theta_m")})
    assert twice.missing == ("theta_l",)
    assert "`u` must be one column of a record, but is named for `theta_m` and for `theta_l`" in twice.problem


def test_choices_change_ranges_in_si(log: Path) -> None:
    stated = {"u": Column(torque_constant=0.5), "theta_l": Column(name="#4")}
    seen = preview_log(log, stated)
    columns = columns_of(seen)
    assert seen.problem == ""
    assert columns["theta_l"].how == "named"
    assert columns["u"].most == pytest.approx(0.5, rel=1e-3)
    assert columns["theta_l"].most == pytest.approx(np.deg2rad(3.0), rel=1e-3)
    assert columns["time"].most == pytest.approx(0.798)
    doubled = columns_of(preview_log(log, stated | {"u": Column(torque_constant=1.0)}))
    assert doubled["u"].most == pytest.approx(2.0 * columns["u"].most)


def test_another_line_of_names_is_taken(log: Path) -> None:
    seen = preview_log(log, {}, 0)
    assert [channel.label for channel in seen.channels] == ["#1", "#2", "#3", "#4"]
    assert seen.problem


def test_the_command_prints_it_and_writes_nothing(
    log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "model.toml"
    model.write_text('[columns.u]\ntorque_constant = 0.5\n[columns.theta_l]\nname = "Achse B [deg]"\n')
    out = tmp_path / "out"
    assert main(["inspect", str(log), "--columns", "--model", str(model), "--out", str(out)]) == 0
    seen = json.loads(capsys.readouterr().out)
    assert seen["problem"] == ""
    assert seen["columns"][3]["place"] == 3
    assert not out.exists()


def test_columns_of_words_and_files_of_others(tmp_path: Path) -> None:
    path = tmp_path / "words.csv"
    path.write_text("time,u,theta_m,state\n" + "\n".join(f"{n},1,{n % 7},run" for n in range(300)))
    seen = preview_log(path, {})
    assert [channel.rows[:1] for channel in seen.channels] == [("0",), ("1",), ("0",), ()]
    (tmp_path / "picture.csv").write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(3000))
    with pytest.raises(RecordError):
        preview_log(tmp_path / "picture.csv", {})


def test_the_lines_of_a_text_are_shown_though_no_table_was_found(log: Path, tmp_path: Path) -> None:
    seen = preview_log(log, {}, 1)
    assert (seen.names_line, seen.lines[0], seen.channels) == (1, "Export of a drive", ())
    assert [one.how for one in seen.columns] == ["absent"] * 4
    assert "line 1, which `header` names, must have 4 names" in seen.problem
    first, *rows = ["t;u;m", *(f"{n};1;{n % 7}" for n in range(300))]
    twice = tmp_path / "twice.csv"
    twice.write_text("\n".join([first, *rows[:20], "--- trigger ---", first, *rows]) + "\n")
    seen = preview_log(twice, {})
    assert (seen.lines[1], seen.channels) == ("0;1;0", ())
    assert "rows of numbers stand above the names" in seen.problem
    assert [channel.name for channel in preview_log(twice, {}, 23).channels] == ["t", "u", "m"]
    (tmp_path / "empty.csv").write_text("\n")
    with pytest.raises(RecordError, match="empty"):
        preview_log(tmp_path / "empty.csv", {})


def test_a_log_without_any_number_cannot_be_read(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    for row, column in (("nan,nan,nan,nan", "time"), ("{n},nan,1,1", "u"), ("{n},1,nan,1", "theta_m")):
        path.write_text("time,u,theta_m,theta_l\n" + "".join(f"{row.format(n=0.01 * n)}\n" for n in range(300)))
        assert preview_log(path, {}).problem == f"column `{column}` must hold numbers, but is empty in all rows"
