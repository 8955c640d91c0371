"""Records: what is read, and what is refused with row and column named."""

import itertools
import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orchestrator.errors import RecordError
from orchestrator.records.model_file import default_model, read_model
from orchestrator.records.plausibility import _check_slope, check_plausible
from orchestrator.records.record import (
    Column,
    Record,
    quantisation_step,
    read_record,
    record_from_columns,
)
from tests.support.independent_plant import make_record, write_csv
from tests.support.written_record import write_record

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data" / "hidden-effects"


@pytest.fixture(scope="module")
def columns() -> dict[str, np.ndarray]:
    return make_record({"alpha": 0.01}, seed=3, duration=8.0)[0]


def _lines(columns: dict[str, np.ndarray], tmp_path: Path) -> list[str]:
    path = tmp_path / "good.csv"
    write_csv(path, columns)
    return path.read_text().splitlines()


def _read(lines: list[str], tmp_path: Path) -> Record:
    path = tmp_path / "data.csv"
    path.write_text("\n".join(lines) + "\n")
    return read_record(path)


def test_a_good_record_comes_back_as_written(columns: dict[str, np.ndarray], tmp_path: Path) -> None:
    record = _read(_lines(columns, tmp_path), tmp_path)
    assert record.size == 1600
    assert record.step == pytest.approx(0.005, rel=1e-12)
    np.testing.assert_allclose(record.theta_l, columns["theta_l"], atol=1e-8)
    again = tmp_path / "again.csv"
    write_record(again, record)
    np.testing.assert_array_equal(read_record(again).theta_m, record.theta_m)


def test_columns_are_found_by_name_and_unit(columns: dict[str, np.ndarray], tmp_path: Path) -> None:
    path = tmp_path / "other.csv"
    write_csv(
        path,
        {"extra": columns["u"], "t": 1e3 * columns["time"], "q": np.degrees(columns["theta_m"]), "u": columns["u"]},
    )
    names = {"time": Column("t", "ms"), "theta_m": Column("q", "deg")}
    record = read_record(path, names, further=("extra", "absent"))
    assert "t in ms, u in N.m, q in deg" in record.notes
    assert record.theta_l is None
    assert record.step == pytest.approx(0.005)
    np.testing.assert_allclose(record.theta_m, columns["theta_m"], atol=1e-6)
    np.testing.assert_allclose(record.further["extra"], record.u)


def _drop(rows: slice):
    def change(lines: list[str]) -> None:
        del lines[rows]

    return change


def _cell(row: int, column: int, text: str):
    def change(lines: list[str]) -> None:
        cells = lines[row].split(",")
        cells[column] = text
        lines[row] = ",".join(cells)

    return change


def _text(row: int, text: str):
    def change(lines: list[str]) -> None:
        lines[row] = text

    return change


def _hold(column: int, first: int, last: int):
    def change(lines: list[str]) -> None:
        value = lines[first].split(",")[column]
        for row in range(first, last):
            _cell(row, column, value)(lines)

    return change


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (_drop(slice(150, None)), "at least 200 rows, but has 149"),
        (_drop(slice(500, 1100)), "row 500, column `time` must have at most 20 % of its rows missing, but 37.5 % are"),
        (_cell(700, 0, "0.005"), "row 700, column `time` must increase, but goes back"),
        (_cell(41, 3, "-inf"), "row 41, column `theta_l` must be a finite number, but is -inf"),
        (_cell(41, 1, "1e308"), "row 41, column `u` must be between -1e+12 and 1e+12, but is 1e+308"),
        (_cell(9, 1, "12,5"), "row 9 must have 4 fields like the header, but has 5"),
        (_cell(9, 1, "off"), "row 9, column `u` must be a number, but is `off`"),
        (_text(0, "time,u,value,theta_l"), "column `theta_m` must be there"),
        (_text(0, "time,u,theta_m,theta_m"), "column `theta_m` must appear once, but appears 2 times"),
        (_text(0, "time;u;theta_m;theta_l"), "the header must have 4 names like the rows below it"),
        (_text(0, "0.0,1.0,2.0,3.0"), "the first row must hold names"),
        (_hold(3, 400, 900), "row 400, column `theta_l` must follow the motion"),
        (_hold(2, 1, 1601), "column `theta_m` must change"),
    ],
)
def test_bad_records_name_row_and_column(columns: dict[str, np.ndarray], tmp_path: Path, change, expected: str) -> None:
    lines = _lines(columns, tmp_path)
    change(lines)
    with pytest.raises(RecordError) as caught:
        _read(lines, tmp_path)
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_saturated_encoder_is_told_from_a_stuck_one(columns: dict[str, np.ndarray]) -> None:
    limit = 0.6 * columns["theta_m"].max()
    clipped = dict(columns) | {"theta_m": np.minimum(columns["theta_m"], limit)}
    with pytest.raises(RecordError, match="saturated at an end of its range"):
        record_from_columns(clipped, "clipped")


def test_a_machine_that_stands_still_is_no_stuck_encoder() -> None:
    time = np.arange(1000) * 0.005
    angle = np.round(np.where(time < 2.5, 0.0, 1.0 - np.exp(-((time - 2.5) ** 2))), 4)
    record = record_from_columns({"time": time, "u": np.sin(time), "theta_m": angle}, "rest")
    assert record.size == 1000


@pytest.mark.parametrize("pull", [0.0, 0.3])
def test_an_axis_that_friction_holds_under_load_is_no_stuck_encoder(pull: float) -> None:
    step, angle, speed, rows, torques = 0.01, 0.0, 0.0, [], []
    for n in range(1500):  # inertia 0.01, dry friction 0.5, a weight's pull, a torque that reverses slowly
        torque = pull + 0.8 * np.sin(0.02 * n)
        for _ in range(20):
            push = torque - pull - 0.02 * speed
            if speed == 0.0 and abs(push) < 0.5:
                continue
            way = np.sign(speed) if speed else np.sign(push)
            after = speed + step / 20 * (push - 0.5 * way) / 0.01
            speed = 0.0 if after * way < 0.0 else after
            angle += step / 20 * speed
        rows.append(round(angle, 3))
        torques.append(torque)
    table = {"time": step * np.arange(1500), "u": np.array(torques), "theta_m": np.array(rows)}
    longest = max(len(list(same)) for _, same in itertools.groupby(rows))
    assert longest > 40
    assert record_from_columns(table, "held").size == 1500


def test_steps_of_milliseconds_are_named(columns: dict[str, np.ndarray]) -> None:
    with pytest.raises(RecordError, match="looks like milliseconds"):
        record_from_columns(dict(columns) | {"time": 1e3 * columns["time"]}, "ms")


@pytest.mark.parametrize(
    ("factors", "expected"),
    [
        ({"theta_m": 57.29578}, "column `theta_m` must be in radians, but seems to be in degrees"),
        ({"theta_l": 57.29578}, "column `theta_l` must be in radians, but seems to be in degrees"),
        ({"theta_m": 57.29578, "theta_l": 57.29578}, "column `theta_m` must be in radians, but seems to be in degrees"),
        ({"u": -1.0}, "the sign of `u` or of the angles is wrong"),
        ({"theta_l": -1.0}, "one of them has the wrong sign"),
    ],
)
def test_units_and_signs_are_recognised(factors: dict[str, float], expected: str) -> None:
    columns = make_record({"alpha": 0.02}, seed=5, duration=20.0)[0]
    record = record_from_columns({name: values * factors.get(name, 1.0) for name, values in columns.items()}, "r")
    with pytest.raises(RecordError) as caught:
        check_plausible(record, default_model())
    assert expected in str(caught.value)


def test_a_record_too_slow_for_the_shaft_is_refused(columns: dict[str, np.ndarray]) -> None:
    slow = record_from_columns(dict(columns) | {"time": 20.0 * columns["time"]}, "slow")
    with pytest.raises(RecordError, match=r"must step by at most 0\.045"):
        check_plausible(slow, default_model())


def test_a_record_that_is_shorter_than_a_period_of_the_shaft_is_refused(columns: dict[str, np.ndarray]) -> None:
    seconds_told_as_milliseconds = dict(columns) | {"time": 1e-3 * columns["time"]}
    with pytest.raises(RecordError, match=r"must last at least 0\.18.* say `\[columns\.time\] unit`"):
        check_plausible(record_from_columns(seconds_told_as_milliseconds, "short"), default_model())


def test_exchanged_columns_are_recognised() -> None:
    columns = make_record({"alpha": 0.02}, seed=5, duration=20.0)[0]
    columns["theta_m"], columns["theta_l"] = columns["theta_l"], columns["theta_m"]
    with pytest.raises(RecordError, match="exchanged"):
        check_plausible(record_from_columns(columns, "r"), default_model())


def _turned(motor: float, load: float) -> Record:
    """Return 4 s in which motor and load swing by so many rad."""
    time = np.arange(0.0, 4.0, 0.002)
    shape = np.sin(2.0 * time)
    columns = {"time": time, "u": np.cos(time), "theta_m": motor * shape, "theta_l": load * shape}
    return record_from_columns(columns, "r")


def centred(values: np.ndarray) -> np.ndarray:
    return values - values.mean()


@pytest.mark.parametrize("load", [0.3, 1.0, 4.0])
def test_exchanged_columns_are_recognised_though_one_of_them_moves_little(load: float) -> None:
    right = default_model().parameters["i"].value * load
    record = _turned(right, load)
    _check_slope("r", centred(record.theta_m), centred(record.theta_l), 3.984)
    with pytest.raises(RecordError, match="exchanged"):
        check_plausible(_turned(load, right), default_model())


@pytest.mark.parametrize("wrong", [0.95, 1.05])
def test_a_ratio_that_the_shaft_cannot_twist_to_is_refused(tmp_path: Path, wrong: float) -> None:
    columns, _ = make_record({"alpha": 0.01}, 77, 10.0, 500.0)
    record, path = record_from_columns(columns, "r"), tmp_path / "m.toml"
    ratio = f"[parameters.i]\nvalue = {wrong * default_model().parameters['i'].value}\n"
    path.write_text(f"{ratio}relative_uncertainty = 0\n")
    with pytest.raises(RecordError, match=r"gear ratio .*, but have 3\.9.*parameters\.i\] value"):
        check_plausible(record, read_model(path))
    path.write_text(f"{ratio}relative_uncertainty = 0\n[parameters.k]\nvalue = 400.0\n")
    check_plausible(record, read_model(path))  # so soft a shaft may twist that far
    path.write_text(f"{ratio}relative_uncertainty = 0.05\n")
    check_plausible(record, read_model(path))  # the fit finds it


def test_a_gear_ratio_that_is_the_inverse_is_told_as_that(tmp_path: Path) -> None:
    record = _turned(27.0, 3.0)
    said = {}
    for ratio in (1.0 / 9.0, 9.0):
        (tmp_path / "m.toml").write_text(f"[parameters.i]\nvalue = {ratio}\n[parameters.J_m]\nvalue = 2e-3\n")
        try:
            check_plausible(record, read_model(tmp_path / "m.toml"))
        except RecordError as error:
            said[ratio > 1.0] = str(error)
    assert "put the inverse into `[parameters.i] value`" in said[False]
    assert "inverse" not in said.get(True, "")


@pytest.mark.parametrize(("ratio", "swing"), [(1.0, 1.0), (1.0, 1.08), (1.1, 0.95), (1.3, 1.1)])
def test_a_load_that_swings_a_little_farther_than_its_motor_is_the_load(ratio: float, swing: float) -> None:
    time = np.arange(0.0, 4.0, 0.002)
    motor = 2.0 * np.sin(2.0 * time)
    record = record_from_columns(
        {"time": time, "u": np.cos(time), "theta_m": motor, "theta_l": swing / ratio * motor}, "r"
    )
    angles = centred(record.theta_m), centred(record.theta_l)
    _check_slope("r", *angles, ratio)
    with pytest.raises(RecordError, match=r"exchanged|gear ratio"):
        _check_slope("r", *angles, 1.7 * ratio)


def test_a_wrong_ratio_of_a_train_is_mended_by_a_parameter_that_it_has(tmp_path: Path) -> None:
    (tmp_path / "train.toml").write_text("fmu = 'TwoStageTrain'\n[parameters.i_1]\nvalue = 2.0\n")
    train = read_model(tmp_path / "train.toml")
    time = np.arange(0.0, 4.0, 0.002)
    motor = 20.0 * np.sin(2.0 * time)
    ratio = 1.6 * 2.0 * train.parameters["i_2"].value
    record = record_from_columns({"time": time, "u": np.cos(time), "theta_m": motor, "theta_l": motor / ratio}, "r")
    with pytest.raises(RecordError) as refusal:
        check_plausible(record, train)
    named = re.search(r"`\[parameters\.(\w+)\] value`", str(refusal.value))
    assert named is not None
    assert named[1] in train.parameters


@pytest.mark.parametrize("excitation", ["multisine", "levels", "closed_loop"])
def test_good_records_are_plausible(excitation: str) -> None:
    for effects in ({}, {"alpha": 0.1}, {"Fc_m": 1.0, "Fc_l": 3.0}, {"delay": 0.01}):
        columns = make_record(effects, seed=8, duration=20.0, excitation=excitation)[0]
        record = record_from_columns(columns, "r")
        check_plausible(record, default_model())
        check_plausible(record.without_load_encoder(), default_model())


def test_the_encoder_count_is_found(columns: dict[str, np.ndarray]) -> None:
    assert quantisation_step(columns["theta_m"]) == pytest.approx(2.0 * math.pi / 10_000, rel=1e-4)
    smooth = make_record({}, seed=1, duration=4.0, counts=None)[0]
    assert quantisation_step(smooth["theta_m"]) == 0.0


@pytest.mark.skipif(not SHARED.exists(), reason="the shared example records are not here")
def test_the_shared_records_are_read_and_plausible() -> None:
    paths = sorted(SHARED.glob("*.csv"))
    assert len(paths) == 19
    for path in paths:
        check_plausible(read_record(path), default_model())


@settings(max_examples=60)
@given(st.binary(max_size=400))
def test_no_bytes_whatever_raise_anything_else(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    path = tmp_path_factory.mktemp("fuzz") / "data.csv"
    path.write_bytes(data)
    with pytest.raises(RecordError):
        read_record(path)


@pytest.mark.parametrize("name", [".", "absent.csv", "a\0b"])
def test_paths_that_are_no_files(tmp_path: Path, name: str) -> None:
    with pytest.raises(RecordError):
        read_record(tmp_path / name)
