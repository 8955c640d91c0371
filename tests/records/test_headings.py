"""Lines above the data: key-value lines of scopes and loggers, rows of units, a stated line of names."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cli import main
from orchestrator.errors import RecordError, ScenarioError
from orchestrator.records.formats import open_source
from orchestrator.records.model_file import read_model
from orchestrator.records.record import Column, Reading, read_record
from tests.support.independent_plant import make_record


@pytest.fixture(scope="module")
def columns() -> dict[str, np.ndarray]:
    return make_record({"alpha": 0.01}, seed=3, duration=1.5)[0]


def _rows(columns: dict[str, np.ndarray], separator: str = "\t", end: str = "", comma: bool = False) -> str:
    rows = [separator.join(f"{v:.12g}" for v in row) + end for row in zip(*columns.values(), strict=True)]
    text = "\n".join(rows) + "\n"
    return text.replace(".", ",") if comma else text


def _same(path: Path, columns: dict[str, np.ndarray], given: dict[str, Column], header: int | None = None) -> tuple:
    record = read_record(path, given, reading=Reading(header=header))
    np.testing.assert_allclose(record.time, columns["time"], atol=1e-9)
    for name in ("u", "theta_m", "theta_l"):
        np.testing.assert_allclose(getattr(record, name), columns[name], rtol=1e-9, atol=1e-9)
    return record.notes


NUMBERED = {name: Column(f"#{n}") for n, name in enumerate(("time", "u", "theta_m", "theta_l"), start=1)}

SCOPE = """Name\tbench 4
File\tD:\\scope\\bench.tcscope
Starttime of export\t133600000000000000\tMontag, 13. Mai 2024\t09:00:00.000

Name\tSetTorque\tPosM\tPosL
Data-Type\tLREAL\tLREAL\tLREAL
SampleTime[ms]\t5\t5\t5
SymbolName\tAxis.fSet\tAxis.fPosM\tAxis.fPosL
Port\t852\t852\t852
Offset\t0\t0\t0
ScaleFactor\t1\t1\t1
Unit\tmN·m (Torque)\tdeg (Angle)\tmrad (Angle)

"""


def test_key_value_lines_of_a_scope(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path = tmp_path / "scope.csv"
    scaled = {
        "time": 1e3 * columns["time"], "u": 1e3 * columns["u"], "theta_m": np.degrees(columns["theta_m"]),
        "theta_l": 1e3 * columns["theta_l"],
    }  # fmt: skip
    path.write_text(SCOPE + _rows(scaled), encoding="utf-8")
    _same(path, columns, NUMBERED | {"time": Column("#1", "ms")})
    notes = _same(path, columns, {"time": Column("#1", "ms")}, header=5)
    assert "not used" not in notes[0]
    assert any("`SetTorque` taken as u" in note for note in notes)


TWINCAT = {
    "Name": ("Torque", "PosMotor", "PosLoad"), "SymbolComment": ("", "", ""), "SampleTime[ms]": ("5", "5", "5"),
    "SymbolName": ("MAIN.u", "MAIN.qm", "MAIN.ql"), "Port": ("851", "851", "851"), "ScaleFactor": ("1", "1", "1"),
    "BitMask": ("0xffff", "0xffff", "0xffff"), "Unit": ("(None)", "deg (Angle)", "mrad (Angle)"),
    "Unit ScaleFactor": ("1", "1", "1"), "Unit Offset": ("0", "0", "0"),
}  # fmt: skip


@pytest.mark.parametrize("keys", [TWINCAT, ("Name", "SymbolName", "BitMask", "Unit"), ("Name", "Unit")])
@pytest.mark.parametrize("late", [0, 2])
def test_columns_of_a_twincat_scope_have_times_of_their_own(
    keys: Sequence[str], late: int, tmp_path: Path, columns: dict[str, np.ndarray]
) -> None:
    head = ["Name\tDrive Scope", "Starttime of export\t133964386997165000\tMontag, 1. Januar 2024\t10:00:00.000", ""]
    head += ["\t".join(f"{key}\t{cell}" for cell in TWINCAT[key]) for key in keys]
    milliseconds, torque = 1e3 * columns["time"], columns["u"]
    times = np.append(milliseconds[late:], milliseconds[-1] + 5.0 * np.arange(1, late + 1))  # of the torque
    table = {
        "a": times, "u": np.append(torque[late:], torque[:late]), "b": milliseconds,
        "theta_m": np.degrees(columns["theta_m"]), "c": milliseconds, "theta_l": 1e3 * columns["theta_l"],
    }  # fmt: skip
    path = tmp_path / "scope.csv"
    path.write_text("\n".join([*head, "", _rows(table, comma=True)]))
    record = read_record(path)
    assert record.step == pytest.approx(0.005)
    for name in ("u", "theta_m", "theta_l"):
        np.testing.assert_allclose(getattr(record, name), columns[name][late:], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("header", [None, 1])
def test_rows_of_simulink_that_say_what_they_are(
    header: int | None, tmp_path: Path, columns: dict[str, np.ndarray]
) -> None:
    head = "".join(
        f",{key}: {u},{key}: {angle},{key}: {angle}\n"
        for key, u, angle in (
            ("Type", "double", "double"), ("Unit", "mN*m", "deg"), ("Interp", "zoh", "linear"),
            ("BlockPath", "drive/Torque", "drive/Shaft"), ("PortIndex", "1", "2"),
        )
    )  # fmt: skip
    scaled = {
        "time": columns["time"], "u": 1e3 * columns["u"], "theta_m": np.degrees(columns["theta_m"]),
        "theta_l": np.degrees(columns["theta_l"]),
    }  # fmt: skip
    path = tmp_path / "run.csv"
    path.write_text("time,u,theta_m,theta_l\n" + head + _rows(scaled, ","))
    _same(path, columns, {}, header)


def test_key_value_lines_of_a_measurement_file(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    head = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nMulti_Headings\tNo\nDate\t2024/05/13\n"
        "***End_of_Header***\t\n\t\nChannels\t3\t\t\t\nSamples\t800\t800\t800\t\n"
        "Y_Unit_Label\tNcm\trad\trad\t\nX0\t0,0\t0,0\t0,0\t\nDelta_X\t0,005\t0,005\t0,005\t\n***End_of_Header***\t\t\t\t\n"
        "X_Value\tTorque\tMotor angle\tLoad angle\tComment\n"
    )
    path = tmp_path / "log.lvm"
    path.write_text(head + _rows(columns | {"u": 100.0 * columns["u"]}, comma=True), encoding="utf-8")
    _same(path, columns, {"time": Column("X_Value")})
    path.write_text(head + _rows(columns | {"u": 100.0 * columns["u"]}, end="\t", comma=True), encoding="utf-8")
    _same(path, columns, {"time": Column("X_Value")})


def test_key_value_lines_of_an_oscilloscope(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    head = (
        "Model,DPO\nFirmware Version,2.1\n\nSample Interval,0.005\nRecord Length,800\nProbe Attenuation,1,1,1\n"
        "Vertical Units,V,V,V\nVertical Offset,0,0,0\n,,,\nLabel,torque,motor angle,load angle\nTIME,CH1,CH2,CH3\n"
    )
    path = tmp_path / "scope.csv"
    path.write_text(head + _rows(columns, ","), encoding="utf-8")
    notes = _same(path, columns, NUMBERED)
    assert "`Vertical Units` above the names not used" in notes[0]
    _same(path, columns, {"time": Column("#1")}, header=10)


def test_key_value_lines_of_a_controller(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    head = "PLC;S7\nCycle;5\nOperator;bench\nRow;1;2;3\nZeit;Drehmoment;Winkel Motor;Winkel Last\ns;Nm;rad;rad\n"
    path = tmp_path / "plc.csv"
    path.write_text(head + _rows(columns, ";", comma=True), encoding="cp1252")
    _same(path, columns, {})


def test_a_stated_line_of_names_in_model_file_and_option(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path, model = tmp_path / "log.csv", tmp_path / "model.toml"
    path.write_text("time,u,theta_m,theta_l\nfilter,none,none,none\n" + _rows(columns, ","), encoding="utf-8")
    with pytest.raises(RecordError, match="must be there"):
        read_record(path)
    model.write_text("header = 1\n")
    assert read_model(model).header == 1
    words = ["inspect", str(path), "--out", str(tmp_path / "out")]
    assert main([*words, "--model", str(model)]) == 0
    assert "header = 1" in (tmp_path / "out" / "model.toml").read_text()
    assert main([*words, "--header", "1"]) == 0
    assert (
        main(["inspect", str(path), "--out", str(tmp_path / "again"), "--model", str(tmp_path / "out/model.toml")]) == 0
    )
    _same(path, columns, NUMBERED, header=0)


@pytest.mark.parametrize("text", ["header = -1", "header = 1.5", "header = '3'", "header = true"])
def test_a_line_that_cannot_be_one(tmp_path: Path, text: str) -> None:
    (tmp_path / "model.toml").write_text(text + "\n")
    with pytest.raises(ScenarioError, match="`header` in"):
        read_model(tmp_path / "model.toml")


def test_a_stated_line_beyond_the_file_or_of_another_width(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path = tmp_path / "log.csv"
    path.write_text("note\ntime,u,theta_m,theta_l\n" + _rows(columns, ","), encoding="utf-8")
    with pytest.raises(RecordError, match="`header` must be a line of the file, but is 5000"):
        read_record(path, reading=Reading(header=5000))
    with pytest.raises(RecordError, match="line 1, which `header` names, must have 4 names"):
        read_record(path, reading=Reading(header=1))
    npy = tmp_path / "log.npy"
    np.save(npy, np.column_stack(list(columns.values())))
    with pytest.raises(RecordError, match="`header` must be left out"):
        read_record(npy, reading=Reading(header=1))


def test_rows_above_a_bad_one_are_not_lost(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    rows = _rows(columns, ",").splitlines()
    path = tmp_path / "log.csv"
    for place in (1, 3, 30):
        for bad in ("0.1,2", "0.1,off,off,off"):
            path.write_text("\n".join(["time,u,theta_m,theta_l", *rows[:place], bad, *rows[place:]]) + "\n")
            with pytest.raises(RecordError, match=f"row {place + 1}"):
                read_record(path)


def test_two_records_in_one_file_are_refused(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    rows = _rows(columns, ",").splitlines()
    path = tmp_path / "log.csv"
    head = "time,u,theta_m,theta_l"
    path.write_text("\n".join([head, *rows[:50], head, *rows]) + "\n")
    with pytest.raises(RecordError, match="rows of numbers stand above the names, from line 2 on"):
        read_record(path)
    _same(path, columns, {}, header=52)  # the advice: LINE of the names that are meant


@pytest.mark.parametrize("more", ["motor angle error [rad]", "motor speed [rad/s]", "motor angle limit", "motor rpm"])
def test_a_channel_beside_the_angle_is_not_taken_for_it(
    tmp_path: Path, columns: dict[str, np.ndarray], more: str
) -> None:
    path = tmp_path / "log.csv"
    further = {"further": 0.0 * columns["time"]}
    path.write_text(f"{more},time,u,motor angle [rad],load angle [rad]\n" + _rows(further | columns, ","))
    notes = _same(path, columns, {})
    assert "`motor angle [rad]` taken as theta_m" in notes


def test_numbers_of_channels_above_the_names(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path = tmp_path / "log.csv"
    path.write_text("1,2,3,4\ntime,u,theta_m,theta_l\n" + _rows(columns, ","))
    _same(path, columns, {})


@pytest.mark.parametrize("end", ["", "\n", "\n\n"])
def test_a_row_that_is_cut_off_at_the_end_is_left_out(tmp_path: Path, end: str) -> None:
    path = tmp_path / "log.csv"
    rows = "n;stamp\n" + "".join(f"{n};2024-05-13 08:00:{n:02d}\n" for n in range(20))
    path.write_text(rows + "20;2024-05-13 08:00:20" + end)
    with open_source(path) as source:
        numbers, stamps = source.load((0, 1))
        assert (numbers.size, stamps.size) == (21, 21)
    path.write_text(rows + "20" + end)
    with open_source(path) as source:
        assert [values.size for values in source.load((0, 1))] == [20, 20]
        assert source.dialect.endswith("line 22 `20` is no row and is left out")


def test_a_long_cell_is_shown_by_its_beginning(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    for cell, shown in (("x" * 60, "x" * 60), ("x" * 61, "x" * 57 + "...")):
        path.write_text("a;b\n" + "1;2\n" * 30 + f"1;{cell}\n")
        with open_source(path) as source, pytest.raises(RecordError, match=rf"row 31, .* but is `{shown}`"):
            source.load((0, 1))


def test_truth_values_are_numbers(tmp_path: Path) -> None:
    path = tmp_path / "on.csv"
    path.write_text("time;on\n0;TRUE\n1;false\n2;True\n")
    with open_source(path) as source:
        assert [values.tolist() for values in source.load((0, 1))] == [[0.0, 1.0, 2.0], [1.0, 0.0, 1.0]]
