"""Records that are odd in a way that no column shows by itself: uneven steps, standing still, unsigned torque."""

from pathlib import Path

import numpy as np
import pytest

from orchestrator.api.inspect import inspect
from orchestrator.errors import RecordError
from orchestrator.records.model_file import read_model
from orchestrator.records.plausibility import check_plausible
from orchestrator.records.record import Column, Reading, Record, read_record, record_from_columns
from tests.support.independent_plant import NOMINAL, make_record

Table = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def table() -> Table:
    return make_record({"alpha": 0.01}, seed=3, duration=4.0)[0]


def _write(path: Path, table: Table) -> Path:
    rows = [",".join(f"{v:.9g}" for v in row) for row in zip(*table.values(), strict=True)]
    path.write_text("\n".join([",".join(table), *rows]) + "\n")
    return path


@pytest.mark.parametrize("how", ["linear", "cubic"])
@pytest.mark.parametrize("share", [0.4, 0.5, 0.6])
def test_alternating_steps_are_brought_to_their_mean_rate(how: str, share: float, tmp_path: Path) -> None:
    steps = np.where(np.random.default_rng(1).random(800) < share, 2.8e-3, 10e-3)
    time = np.concatenate([[0.0], np.cumsum(steps)])
    motion = {"time": time, "u": 3.0 * np.cos(4.0 * time), "theta_m": np.sin(4.0 * time), "theta_l": np.sin(4.0 * time)}
    path = _write(tmp_path / "log.csv", motion)
    unasked = read_record(path)  # interpolated, and told
    assert any("resampled (linear)" in note for note in unasked.notes)
    np.testing.assert_allclose(unasked.theta_m, np.sin(4.0 * unasked.time), atol=2e-3)
    record = read_record(path, reading=Reading(resample=how))
    assert record.step == pytest.approx(float(np.mean(steps)), rel=1e-3)
    assert abs(record.size - time.size) <= 1
    assert any("the mean rate of steps of 2.8 to 10 ms" in note for note in record.notes)
    np.testing.assert_allclose(record.theta_m, np.sin(4.0 * record.time), atol=2e-3)


def test_gaps_are_missing_samples_after_resampling(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.uniform(3e-3, 7e-3, 900))
    time = time[(time < 2.0) | (time > 2.3)]
    motion = {"time": time, "u": np.cos(4.0 * time), "theta_m": np.sin(4.0 * time)}
    record = read_record(_write(tmp_path / "log.csv", motion), reading=Reading(resample="linear"))
    assert record.step == pytest.approx(5e-3, rel=0.03)
    lost = record.time[record.is_missing]
    assert lost.min() > 1.99
    assert lost.max() < 2.31
    assert lost.size == pytest.approx(60, abs=4)


def test_a_motor_that_stands_still_in_most_of_a_record_is_said(table: Table, tmp_path: Path) -> None:
    still = {name: np.concatenate([values, np.full(1200, values[-1])]) for name, values in table.items()}
    still["time"] = 0.005 * np.arange(2000)
    record = read_record(_write(tmp_path / "step.csv", still))
    said = [note for note in record.notes if "the rest shows nothing" in note]
    assert len(said) == 1
    assert "the motor moves only from 0.4 to 4 s" in said[0]
    part = read_record(tmp_path / "step.csv", reading=Reading(part=(0.4, 4.0)))  # as it says
    assert not [note for note in part.notes if "the rest shows nothing" in note]
    assert not [
        note for note in read_record(_write(tmp_path / "all.csv", table)).notes if "the rest shows nothing" in note
    ]


def test_an_empty_time_is_refused_in_words_where_its_counter_is_said_to_overflow(table: Table, tmp_path: Path) -> None:
    for first in (np.nan, 1.7e9):
        time = np.full(table["time"].size, np.nan)
        time[0] = first
        path = _write(tmp_path / "log.csv", table | {"time": time})
        for column in (Column(), Column(modulo=65536.0)):
            with pytest.raises(RecordError, match="column `time` must be a finite number"):
                read_record(path, {"time": column})


def _servo(torque: np.ndarray) -> Record:
    time = 0.01 * np.arange(torque.size)
    speed = np.sin(2.0 * time)
    return record_from_columns(
        {"time": time, "u": torque, "theta_m": -0.5 * np.cos(2.0 * time) + 1e-3 * speed}, "servo"
    )


def test_a_torque_without_a_sign_gets_a_hint() -> None:
    time = 0.01 * np.arange(800)
    signed = np.cos(2.0 * time) + 0.3 * np.sign(np.sin(2.0 * time))
    counts = np.abs(signed) * 500.0
    for torque in (counts, np.where(signed < 0.0, 1024.0 + counts, counts)):
        said = inspect(_servo(torque), read_model(None)).verdict()
        assert any("The torque never changes its sign" in text and "Write signed values" in text for text in said)
    said = inspect(_servo(signed), read_model(None)).verdict()  # as it says
    assert not any("never changes its sign" in text for text in said)


def test_a_model_that_is_too_heavy_is_no_angle_in_degrees(table: Table, tmp_path: Path) -> None:
    path = tmp_path / "heavy.toml"
    record = record_from_columns({name: values for name, values in table.items() if name != "theta_l"}, "r")
    for factor, degrees in ((25.0, False), (30.0, False), (57.3, True), (150.0, False)):
        path.write_text(f"[parameters.J_m]\nvalue = {0.4 * factor}\n[parameters.J_l]\nvalue = {5.6 * factor}\n")
        with pytest.raises(RecordError) as caught:
            check_plausible(record, read_model(path))
        assert ("seems to be in degrees" in str(caught.value)) == degrees
        assert "`[parameters.J_m] value` and `[parameters.J_l] value`" in str(caught.value)


def test_a_rate_in_place_of_stamps_of_any_kind(table: Table, tmp_path: Path) -> None:
    dates = _write(tmp_path / "log.csv", table).read_text().splitlines()
    lines = [f"2024-05-13T08:00:0{n // 200},{line.split(',', 1)[1]}" for n, line in enumerate(dates[1:])]
    (tmp_path / "log.csv").write_text("\n".join([dates[0], *lines]) + "\n")
    with pytest.raises(RecordError, match=r"say `\[columns.time\] rate"):
        read_record(tmp_path / "log.csv")
    assert read_record(tmp_path / "log.csv", {"time": Column(rate=200.0)}).step == pytest.approx(5e-3)


def test_a_heavy_load_behind_a_soft_shaft_follows_the_motor_where_it_is_slow(tmp_path: Path) -> None:
    soft = NOMINAL | {"J_l": 200.0, "k": 5000.0, "tau": 0.02}
    columns, _ = make_record({}, 5, 20.0, mismatch=0.0, nominal=soft, torque=8.0)
    assert np.corrcoef(columns["theta_m"], columns["theta_l"])[0, 1] < 0.95
    path = tmp_path / "model.toml"
    path.write_text("".join(f"[parameters.{name}]\nvalue = {value}\n" for name, value in soft.items()))
    check_plausible(record_from_columns(columns, "soft"), read_model(path))
    wandering = np.cumsum(np.random.default_rng(1).normal(size=columns["time"].size)) * 0.02
    for wrong, said in (
        (-columns["theta_l"], "falls"),
        (57.3 * columns["theta_l"], "degrees"),
        (wandering, "foll"),
    ):
        with pytest.raises(RecordError, match=said):
            check_plausible(record_from_columns(columns | {"theta_l": wrong}, "wrong"), read_model(path))
