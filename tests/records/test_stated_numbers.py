"""Numbers that a model file states of a column, and names and values that say another unit: used or refused."""

from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator.errors import RecordError
from orchestrator.records.columns import Column
from orchestrator.records.record import Record, read_record

ROWS = 1500
TIME = 0.002 * np.arange(ROWS)
ANGLE = 9.0 * np.sin(4.1 * TIME) + 2.0 * np.sin(9.7 * TIME)  # rad; up to 56 rad/s
TORQUE = 1.4 * np.cos(4.1 * TIME + 0.2)
DEGREES = np.rad2deg(ANGLE)
WRAPPED = (DEGREES + 180.0) % 360.0 - 180.0


def _read(
    folder: Path,
    torque: np.ndarray,
    motor: np.ndarray,
    heads: str = "u,theta_m",
    rows: Any = None,
    **columns: Any,
) -> Record:
    kept = np.arange(ROWS) if rows is None else rows
    path = folder / "log.csv"
    table = np.column_stack([TIME, torque, motor])[kept]
    np.savetxt(path, table, delimiter=",", header=f"time,{heads}", comments="", fmt="%.12g")
    return read_record(path, columns)


@pytest.mark.parametrize(
    ("heads", "name", "stated", "unit", "torque", "motor"),
    [
        ("u,theta_m", "u", {"rated_value": 2.5}, "%", TORQUE / 0.025, ANGLE),
        ("u,theta_m", "u", {"torque_constant": 0.7}, "A", TORQUE / 0.7, ANGLE),
        ("u [N.m],theta_m", "u", {"rated_value": 2.5}, "%", TORQUE / 0.025, ANGLE),
        ("u [N.m],theta_m", "u", {"torque_constant": 0.7}, "A", TORQUE / 0.7, ANGLE),
        ("u,theta_m", "theta_m", {"counts_per_rev": 8192.0}, "counts", TORQUE, np.round(ANGLE / 2 / np.pi * 8192)),
        ("u,theta_m [deg]", "theta_m", {"counts_per_rev": 8192.0}, "counts", TORQUE, ANGLE / 2 / np.pi * 8192),
    ],
)
def test_a_number_of_another_unit_is_refused_and_the_advice_works(
    heads: str, name: str, stated: dict[str, Any], unit: str, torque: np.ndarray, motor: np.ndarray, tmp_path: Path
) -> None:
    key = next(iter(stated))
    with pytest.raises(RecordError, match=rf'`\[columns.{name}\] {key}` is for .*unit = "{unit}"`'):
        _read(tmp_path, torque, motor, heads, **{name: Column(**stated)})
    record = _read(tmp_path, torque, motor, heads, **{name: Column(unit=unit, **stated)})
    np.testing.assert_allclose(record.u, TORQUE, atol=1e-9)
    np.testing.assert_allclose(record.theta_m, ANGLE, atol=4e-4)


@pytest.mark.parametrize("name", ["Iq_ref", "Motor current setpoint", "Strom Soll", "Umot"])
def test_a_current_without_a_unit_is_no_torque(name: str, tmp_path: Path) -> None:
    with pytest.raises(RecordError, match=r"its name says that it is a (current|voltage)"):
        _read(tmp_path, TORQUE / 0.7, ANGLE, f"{name},theta_m", u=Column(name))
    stated = Column(name, factor=0.7)  # what makes N.m of it
    np.testing.assert_allclose(_read(tmp_path, TORQUE / 0.7, ANGLE, f"{name},theta_m", u=stated).u, TORQUE, atol=1e-9)


@pytest.mark.parametrize("name", ["current_torque_cmd", "Moment Soll", "torque at current time"])
def test_a_torque_that_is_current_is_a_torque(name: str, tmp_path: Path) -> None:
    np.testing.assert_allclose(_read(tmp_path, TORQUE, ANGLE, f"{name},theta_m", u=Column(name)).u, TORQUE, atol=1e-9)


def test_a_speed_without_a_unit_is_no_angle(tmp_path: Path) -> None:
    speed = np.gradient(ANGLE, TIME)
    with pytest.raises(RecordError, match="its name says that it is a speed"):
        _read(tmp_path, TORQUE, speed, "u,motor_speed", theta_m=Column("motor_speed"))
    record = _read(tmp_path, TORQUE, speed, "u,motor_speed", theta_m=Column("motor_speed", unit="rad/s"))
    assert np.ptp(record.theta_m) == pytest.approx(np.ptp(ANGLE), rel=0.01)


def test_whole_numbers_without_a_unit_are_no_radians(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match=r'whole numbers: say `\[columns.theta_m\] unit = "counts"`'):
        _read(tmp_path, TORQUE, np.round(ANGLE / 2 / np.pi * 8192), "u,ENC_MOT")


@pytest.mark.parametrize(
    ("modulo", "said"),
    [(720.0, "half of its `modulo`, 720"), (3600.0, "modulo = 360`"), (180.0, "goes over 359"), (100.0, "goes over")],
)
def test_a_modulo_that_is_not_the_range_is_refused(modulo: float, said: str, tmp_path: Path) -> None:
    right = _read(tmp_path, TORQUE, WRAPPED, "u,theta_m [deg]", theta_m=Column(modulo=360.0))
    np.testing.assert_allclose(right.theta_m, ANGLE, atol=1e-9)
    with pytest.raises(RecordError, match=said):
        _read(tmp_path, TORQUE, WRAPPED, "u,theta_m [deg]", theta_m=Column(modulo=modulo))


@pytest.mark.parametrize(("size", "is_right"), [(2048.0, True), (1024.0, True), (256.0, False), (64.0, False)])
def test_a_counter_that_is_passed_within_a_row_is_refused(size: float, is_right: bool, tmp_path: Path) -> None:
    counts = np.round(ANGLE / 2 / np.pi * 20_000) % size  # up to 330 counts a row
    column = Column(unit="counts", counts_per_rev=20_000.0, modulo=size)
    if is_right:
        record = _read(tmp_path, TORQUE, counts, theta_m=column)
        np.testing.assert_allclose(np.diff(record.theta_m), np.diff(ANGLE), atol=4e-4)
    else:
        with pytest.raises(RecordError, match="must move by less than half of its `modulo`"):
            _read(tmp_path, TORQUE, counts, theta_m=column)


@pytest.mark.parametrize(("lost", "is_right"), [(3, True), (12, True), (150, False)])
def test_turns_that_nobody_saw_are_not_made_up(lost: int, is_right: bool, tmp_path: Path) -> None:
    """In 150 rows the motor makes more than a turn."""
    rows = np.r_[0:700, 700 + lost : ROWS]
    if is_right:
        record = _read(tmp_path, TORQUE, WRAPPED, "u,theta_m [deg]", rows, theta_m=Column(modulo=360.0))
        seen = np.isfinite(record.theta_m)
        np.testing.assert_allclose(record.theta_m[seen], ANGLE[seen], atol=1e-9)
        return
    with pytest.raises(RecordError, match=r"while rows are missing.*`part` START:END"):
        _read(tmp_path, TORQUE, WRAPPED, "u,theta_m [deg]", rows, theta_m=Column(modulo=360.0))


@pytest.mark.parametrize(("unit", "size"), [("us", 1e6), ("ns", 1e9), ("ms", 1e3)])
def test_the_unit_of_coarse_times_that_is_proposed_is_one_that_fits(unit: str, size: float, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    np.savetxt(path, np.column_stack([TIME * size, TORQUE, ANGLE]), delimiter=",", header="time,u,theta_m",
               comments="", fmt="%.12g")  # fmt: skip
    with pytest.raises(RecordError, match=rf'`\[columns.time\] unit = "{unit}"`'):
        read_record(path)
    assert read_record(path, {"time": Column(unit=unit)}).step == pytest.approx(0.002)


@pytest.mark.parametrize("first", ['"1,{:05.1f}"', "1'{:05.1f}", "1 {:05.1f}"])
def test_rows_with_thousands_separators_are_not_left_out(first: str, tmp_path: Path) -> None:
    times = [f"{t:.1f}" if t < 1000.0 else first.format(t - 1000.0) for t in 2.0 * np.arange(900)]
    path = tmp_path / "log.csv"
    rows = (f"{t},{u:.6f},{a:.6f}\n" for t, u, a in zip(times, TORQUE[:900], ANGLE[:900], strict=True))
    path.write_text("time [ms],u,theta_m\n" + "".join(rows), encoding="utf-8")
    with pytest.raises(RecordError, match=r"row 501, column `time .ms.` must be a number"):
        read_record(path)


@pytest.mark.parametrize(("start", "size"), [
    (datetime(1970, 1, 1), 10**9), (datetime(1970, 1, 1), 10**3), (datetime(1601, 1, 1), 10**7),
    (datetime(1, 1, 1), 10**7),
], ids=["ns", "ms", "Windows", ".NET"])  # fmt: skip
def test_numbers_that_count_from_a_date_are_known(start: datetime, size: int, tmp_path: Path) -> None:
    first = round((datetime(2026, 3, 1) - start).total_seconds()) * size
    stamps = (first + round(size * t) for t in TIME.tolist())
    rows = [f"{stamp},{u:.9g},{a:.9g}" for stamp, u, a in zip(stamps, TORQUE, ANGLE, strict=True)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["timestamp,u,theta_m", *rows]) + "\n")
    record = read_record(path)
    assert record.step == pytest.approx(0.002)
    np.testing.assert_allclose(record.time, TIME, atol=2e-5)  # doubles of .NET's size are 12.8 us apart


@pytest.mark.parametrize(("separator", "mark", "torque"), [
    (";", ".", "{:.0f}"), (";", ",", "{:.0f}"), (",", ",", "{:.0f}"), (";", ".", "0,{:03.0f}"),
])  # fmt: skip
def test_whole_numbers_with_thousands_separators_are_refused(
    separator: str, mark: str, torque: str, tmp_path: Path
) -> None:
    cells = [f"{count:,d}".replace(",", mark) for count in np.rint(1e4 * ANGLE).astype(int).tolist()]
    rows = [
        separator.join((str(2 * n), torque.format(abs(u)), f'"{cell}"' if separator == "," else cell))
        for n, (u, cell) in enumerate(zip(100.0 * TORQUE, cells, strict=True))
    ]
    path = tmp_path / "log.csv"
    path.write_text("\n".join([separator.join(("time [ms]", "u", "theta_m [counts]")), *rows]) + "\n")
    with pytest.raises(RecordError, match=r"column `theta_m .counts.` must hold plain numbers.*without thousands"):
        read_record(path, {"theta_m": Column(counts_per_rev=62_832)})


@pytest.mark.parametrize("digits", ["{:.3f}", "{:g}"])
def test_numbers_of_three_decimals_are_no_thousands(digits: str, tmp_path: Path) -> None:
    levels = np.where(TORQUE > 0.0, 1.125, 0.0)
    angle = np.round(500.0 + 50.0 * ANGLE / np.abs(ANGLE).max(), 3)
    rows = [f"{t:.3f},{u:g},{digits.format(a)}" for t, u, a in zip(TIME, levels, angle, strict=True)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["time,u,theta_m", *rows]) + "\n")
    record = read_record(path)
    np.testing.assert_allclose(record.u, levels)
    np.testing.assert_allclose(record.theta_m, angle, atol=1e-9)


@pytest.mark.parametrize(("stamps", "rate", "said"), [
    (TIME, 500.0, ""), (np.floor(TIME * 100.0) / 100.0, 500.0, ""), (TIME, 1000.0, "though it says 500 Hz"),
    (TIME * 2.0, 500.0, "though it says 250 Hz"), (np.zeros(ROWS), 500.0, ""),
])  # fmt: skip
def test_a_rate_that_contradicts_the_stamps_is_told(stamps: np.ndarray, rate: float, said: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    table = np.column_stack([stamps, TORQUE, ANGLE])
    np.savetxt(path, table, delimiter=",", header="time,u,theta_m", comments="", fmt="%.12g")
    notes = " ".join(read_record(path, {"time": Column(rate=rate)}).notes)
    assert f"time from the row and {rate:g} Hz, `time` not used" in notes

    assert (" though" in notes) == bool(said)
    assert said in notes


def test_a_speed_has_no_modulo(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match=r"is a speed, but `\[columns.theta_m\] modulo` is for an angle"):
        _read(tmp_path, TORQUE, np.gradient(ANGLE, TIME), "u,theta_m [rad/s]", theta_m=Column(modulo=6.28))
