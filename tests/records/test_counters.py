"""Counters that start again or have their sign in a bit: what is said of them, and that it helps when followed."""

import re
from pathlib import Path

import numpy as np
import pytest

from orchestrator.errors import RecordError
from orchestrator.records.columns import Column
from orchestrator.records.record import Record, read_record

TIME = 0.005 * np.arange(1200)
ANGLE = 40.0 * np.sin(0.9 * TIME) + 10.0 * np.sin(2.5 * TIME)  # rad
COUNTS = np.round(ANGLE / (2.0 * np.pi) * 4096.0)
TORQUE = np.round(3.0 * np.cos(0.9 * TIME + 0.3), 4)


def _read(path: Path, motor: np.ndarray, torque: np.ndarray = TORQUE, **columns: Column) -> Record:
    rows = np.column_stack([TIME, torque, motor])
    np.savetxt(path, rows, delimiter=",", header="time,u,theta_m", comments="", fmt=["%.4f", "%.6g", "%.12g"])
    return read_record(path, columns)


def _advice(path: Path, key: str, motor: np.ndarray, torque: np.ndarray = TORQUE, **columns: Column) -> str:
    with pytest.raises(RecordError, match=rf"say `\[columns\.\w+\] {key} = ") as caught:
        _read(path, motor, torque, **columns)
    found = re.search(rf"{key} = ([^`]+)`", str(caught.value))
    assert found is not None
    return found[1]


@pytest.mark.parametrize("size", [2**12, 2**16, 2**20, 2**24, 2**32, 10_000, 1_000_000])
def test_the_range_of_a_counter_is_told_with_all_its_digits(size: int, tmp_path: Path) -> None:
    motor = (COUNTS + size - 1500) % size
    counts = Column(unit="counts", counts_per_rev=4096.0)
    said = _advice(tmp_path / "log.csv", "modulo", motor, theta_m=counts)
    assert said == str(size)
    right = Column(unit="counts", counts_per_rev=4096.0, modulo=float(said))
    record = _read(tmp_path / "log.csv", motor, theta_m=right)
    np.testing.assert_allclose(np.diff(record.theta_m), np.diff(COUNTS) / 4096.0 * 2.0 * np.pi, atol=1e-5)


@pytest.mark.parametrize(
    ("unit", "turn", "said"),
    [("deg", 360.0, "360"), ("rad", 2.0 * np.pi, "6.283185307179586"), ("rev", 1.0, "1"), ("0.1 deg", 3600.0, "3600")],
)
def test_an_angle_that_wraps_is_told_its_turn(unit: str, turn: float, said: str, tmp_path: Path) -> None:
    motor = np.round((ANGLE / (2.0 * np.pi) * turn) % turn, 6)
    assert _advice(tmp_path / "log.csv", "modulo", motor, theta_m=Column(unit=unit)) == said


@pytest.mark.parametrize("speed", [100.0, 150.0])  # rad/s
def test_a_fast_angle_that_wraps_in_every_tenth_row_is_told(speed: float, tmp_path: Path) -> None:
    angle = ANGLE + speed * TIME
    motor = np.round(np.degrees(angle) % 360.0, 6)
    assert np.mean(np.abs(np.diff(motor)) > 180.0) > 0.07
    said = _advice(tmp_path / "log.csv", "modulo", motor, theta_m=Column(unit="deg"))
    record = _read(tmp_path / "log.csv", motor, theta_m=Column(unit="deg", modulo=float(said)))
    np.testing.assert_allclose(np.diff(record.theta_m), np.diff(angle), atol=1e-6)


def test_a_count_that_goes_to_and_fro_wraps_nowhere(tmp_path: Path) -> None:
    motor = 0.001 * (np.arange(TIME.size) % 3 == 0)
    assert np.ptp(_read(tmp_path / "log.csv", motor).theta_m) == pytest.approx(0.001)


def test_a_range_that_nobody_knows_is_not_guessed(tmp_path: Path) -> None:
    counts = Column(unit="counts", counts_per_rev=4096.0)
    with pytest.raises(RecordError, match=r"modulo = \.\.\.`.*near 5734\d"):
        _read(tmp_path / "log.csv", (COUNTS + 56000) % 57344, theta_m=counts)
    turns = Column(unit="counts", counts_per_rev=57344.0)
    assert _advice(tmp_path / "log.csv", "modulo", (COUNTS + 56000) % 57344, theta_m=turns) == "57344"


@pytest.mark.parametrize("bit", [2**15, 2**16, 2**23, 2**31])
def test_a_sign_that_is_a_bit_is_named_and_read(bit: int, tmp_path: Path) -> None:
    motor = np.where(COUNTS < 0.0, bit - COUNTS, COUNTS)
    counts = Column(unit="counts", counts_per_rev=4096.0)
    said = _advice(tmp_path / "log.csv", "sign_bit", motor, theta_m=counts)
    assert said == str(bit)
    right = Column(unit="counts", counts_per_rev=4096.0, sign_bit=float(said))
    np.testing.assert_allclose(
        _read(tmp_path / "log.csv", motor, theta_m=right).theta_m, COUNTS / 4096.0 * 2.0 * np.pi, atol=1e-9
    )


def test_a_sign_bit_in_degrees_is_told_to_the_count(tmp_path: Path) -> None:
    count = 360.0 / 4096.0
    motor = count * np.where(COUNTS < 0.0, 2**15 - COUNTS, COUNTS)
    said = _advice(tmp_path / "log.csv", "sign_bit", motor, theta_m=Column(unit="deg"))
    assert float(said) == pytest.approx(count * 2**15, abs=0.01 * count)


@pytest.mark.parametrize("square", [False, True])
def test_a_torque_whose_sign_is_a_bit(square: bool, tmp_path: Path) -> None:
    signed = np.where(TORQUE > 0.0, 300.0, -300.0) if square else np.round(100.0 * TORQUE)
    torque = np.where(signed < 0.0, 1024.0 - signed, signed)
    said = _advice(tmp_path / "log.csv", "sign_bit", ANGLE, torque)
    record = _read(tmp_path / "log.csv", ANGLE, torque, u=Column(sign_bit=float(said)))
    np.testing.assert_array_equal(record.u, signed)


def test_values_that_are_right_are_left_alone(tmp_path: Path) -> None:
    counts = Column(unit="counts", counts_per_rev=4096.0)
    for motor in (COUNTS, COUNTS + 2**15, COUNTS + 2**24):
        record = _read(tmp_path / "log.csv", motor, theta_m=counts)
        np.testing.assert_allclose(np.ptp(record.theta_m), np.ptp(ANGLE), rtol=1e-4)
    steps = np.where(TORQUE > 0.0, 1500.0, 300.0)
    np.testing.assert_array_equal(_read(tmp_path / "log.csv", ANGLE, steps).u, steps)


def test_a_sign_bit_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordError, match="must be 0 or more and below twice its `sign_bit`, 32768, but is -"):
        _read(tmp_path / "log.csv", COUNTS, theta_m=Column(unit="counts", counts_per_rev=4096.0, sign_bit=32768.0))


def _levels(torque: np.ndarray) -> np.ndarray:
    """A request of random levels in place of a smooth one."""
    return np.repeat(np.random.default_rng(3).integers(-3000, 3000, torque.size // 40), 40).astype(float)


@pytest.mark.parametrize("size", [2**16, 2**32])
@pytest.mark.parametrize("kind", ["smooth", "two levels", "many levels"])
def test_a_torque_written_as_a_twos_complement_is_told_and_read(kind: str, size: int, tmp_path: Path) -> None:
    whole = np.rint(1000.0 * TORQUE)
    torque = {"smooth": whole, "two levels": 2500.0 * np.sign(whole + 0.5), "many levels": _levels(whole)}[kind]
    unsigned = torque % size
    rows = np.column_stack([TIME, unsigned, ANGLE])
    path = tmp_path / "log.csv"
    np.savetxt(path, rows, delimiter=",", header="time,u,theta_m", comments="", fmt="%.12g")
    stated = {"unit": "0.1 %", "rated_value": 2.0}
    with pytest.raises(RecordError, match=rf"say `\[columns.u\] modulo = {size}`"):
        read_record(path, {"u": Column(**stated)})  # type: ignore[arg-type]
    record = read_record(path, {"u": Column(modulo=float(size), **stated)})  # type: ignore[arg-type]
    np.testing.assert_allclose(record.u, 0.002 * torque, atol=1e-12)


def test_a_torque_of_two_levels_and_one_sign_is_left_alone(tmp_path: Path) -> None:
    torque = np.where(np.sin(5.0 * TIME) > 0.0, 65_000.0, 0.0)
    np.testing.assert_array_equal(_read(tmp_path / "log.csv", ANGLE, torque).u, torque)


def test_an_angle_that_wraps_with_its_sign_in_a_bit(tmp_path: Path) -> None:
    hundredths = np.rint(np.rad2deg(ANGLE) * 100.0)
    wrapped = (hundredths + 18_000.0) % 36_000.0 - 18_000.0
    motor = np.where(wrapped < 0.0, 32_768.0 - wrapped, wrapped)
    assert _advice(tmp_path / "log.csv", "sign_bit", motor, theta_m=Column(unit="0.01 deg")) == "32768"
    signed = Column(unit="0.01 deg", sign_bit=32_768.0)
    assert _advice(tmp_path / "log.csv", "modulo", motor, theta_m=signed) == "36000"
    right = Column(unit="0.01 deg", sign_bit=32_768.0, modulo=36_000.0)
    record = _read(tmp_path / "log.csv", motor, theta_m=right)
    np.testing.assert_allclose(np.diff(record.theta_m), np.diff(np.deg2rad(hundredths / 100.0)), atol=1e-9)
