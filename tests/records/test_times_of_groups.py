"""Channels with times of their own in formats that have no channel groups, and clocks of any kind for them."""

from collections.abc import Mapping
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from orchestrator.errors import RecordError
from orchestrator.records.preview import preview_log
from orchestrator.records.record import Column, Reading, read_record
from orchestrator.records.tables import Wanted, read_columns
from orchestrator.scenarios.tables import read_table

ROWS, EVERY = 1500, 10
TIME = 0.002 * np.arange(ROWS)
ANGLE = 9.0 * np.sin(4.1 * TIME) + 2.0 * np.sin(9.7 * TIME)
OWN = TIME[::EVERY]
LEVELS = np.random.default_rng(5).uniform(-2.0, 2.0, OWN.size)
HELD = np.repeat(LEVELS, EVERY)

Groups = Mapping[str, Mapping[str, np.ndarray]]


def _hdf5(folder: Path, groups: Groups) -> Path:
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "log.h5", "w") as file:
        for group, vectors in groups.items():
            for name, values in vectors.items():
                file[f"{group}/{name}"] = values
    return folder / "log.h5"


def _tables(folder: Path, groups: Groups) -> Path:
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "log.h5", "w") as file:
        for group, vectors in groups.items():
            file[group] = _structured(vectors)
    return folder / "log.h5"


def _mat(folder: Path, groups: Groups) -> Path:
    from scipy.io import savemat

    savemat(folder / "log.mat", {group: dict(vectors) for group, vectors in groups.items()})
    return folder / "log.mat"


def _npz(folder: Path, groups: Groups) -> Path:
    np.savez(folder / "log.npz", **{group: _structured(vectors) for group, vectors in groups.items()})
    return folder / "log.npz"


def _structured(vectors: Mapping[str, np.ndarray]) -> np.ndarray:
    table = np.zeros(vectors["time"].size, dtype=[(name, "f8") for name in vectors])
    for name, values in vectors.items():
        table[name] = values
    return table


WRITERS = pytest.mark.parametrize("write", [_hdf5, _tables, _mat, _npz])
ORDERS = pytest.mark.parametrize("order", [("drive", "machine"), ("zdrive", "machine")])


@WRITERS
@ORDERS
def test_a_group_has_its_own_time(write: object, order: tuple[str, str], tmp_path: Path) -> None:
    drive, machine = order
    groups = {drive: {"time": OWN, "u": LEVELS}, machine: {"theta_m": ANGLE, "time": TIME}}
    record = read_record(write(tmp_path, groups))  # type: ignore[operator]
    np.testing.assert_allclose(record.u, HELD, atol=1e-9)
    np.testing.assert_allclose(record.theta_m, ANGLE, atol=1e-12)
    assert record.u_raster == pytest.approx(0.02)


@WRITERS
def test_as_many_rows_are_not_the_same_times(write: object, tmp_path: Path) -> None:
    late = 0.2  # s
    groups = {
        "drive": {"time": TIME + late, "u": np.cos(4.1 * (TIME + late))},
        "machine": {"time": TIME, "theta_m": ANGLE},
    }
    record = read_record(write(tmp_path, groups))  # type: ignore[operator]
    assert record.time[0] == pytest.approx(late)
    np.testing.assert_allclose(record.u, np.cos(4.1 * record.time), atol=1e-6)
    np.testing.assert_allclose(record.theta_m, ANGLE[100:], atol=1e-12)


@WRITERS
def test_equal_times_are_one(write: object, tmp_path: Path) -> None:
    groups = {"drive": {"time": TIME, "u": np.cos(TIME)}, "machine": {"time": TIME, "theta_m": ANGLE}}
    record = read_record(write(tmp_path, groups))  # type: ignore[operator]
    np.testing.assert_array_equal(record.u, np.cos(TIME))


def test_a_time_is_in_the_unit_of_its_group(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = _hdf5(tmp_path, {"d": {"time": 1e3 * OWN, "u": LEVELS}, "m": {"time": TIME, "theta_m": ANGLE}})
    with h5py.File(path, "a") as file:
        file["d/time"].attrs["units"] = "ms"
    np.testing.assert_allclose(read_record(path).u, HELD, atol=1e-9)


def test_a_counter_of_a_group_that_overflows_is_named(tmp_path: Path) -> None:
    milliseconds = np.rint(1e3 * TIME) % 2048.0
    machine = {"time": TIME, "theta_m": ANGLE}
    path = _mat(tmp_path, {"d": {"time": milliseconds[::EVERY], "u": LEVELS}, "m": machine})
    with pytest.raises(RecordError, match=r"column `time` must increase, but begins again"):
        read_record(path)
    path = _mat(tmp_path, {"d": {"time": milliseconds[::EVERY], "u": LEVELS}, "m": machine | {"time": milliseconds}})
    record = read_record(path, {"time": Column(unit="ms", modulo=2048.0)})
    np.testing.assert_allclose(record.u, HELD, atol=1e-9)


@pytest.mark.parametrize("name", ["time_u", "t_drive"])
def test_rows_of_another_length_take_the_time_beside_them(name: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", **{"time": TIME, "theta_m": ANGLE, "u": LEVELS, name: OWN})
    np.testing.assert_allclose(read_record(tmp_path / "log.npz").u, HELD, atol=1e-9)


def _pad(values: np.ndarray) -> np.ndarray:
    return np.append(values, np.full(TIME.size - values.size, np.nan))


@pytest.mark.parametrize("names", [("time", "time_u"), ("t", "t.1"), ("Time (motor) [s]", "Time (drive) [s]")])
@pytest.mark.parametrize("kind", ["csv", "npz"])
@pytest.mark.parametrize("part", [None, (0.0, 2.0), (1.0, 3.0)])
def test_signals_beside_each_other_end_with_their_own_times(
    names: tuple[str, str], kind: str, part: tuple[float, float] | None, tmp_path: Path
) -> None:
    columns = {names[1]: _pad(OWN), "u": _pad(LEVELS), names[0]: TIME, "theta_m": ANGLE}
    path = tmp_path / f"log.{kind}"
    if kind == "csv":
        rows = [",".join("" if cell != cell else f"{cell:.12g}" for cell in row) for row in zip(*columns.values())]  # noqa: B905, PLR0124
        path.write_text("\n".join([",".join(columns), *rows]) + "\n")
    else:
        np.savez(path, **columns)
    record = read_record(path, reading=Reading(part=part))
    first, last = (0, TIME.size) if part is None else np.searchsorted(TIME, (part[0] - 1e-9, part[1] + 1e-9))
    np.testing.assert_allclose(record.u, HELD[first:last], atol=1e-9)
    np.testing.assert_allclose(record.theta_m, ANGLE[first:last], atol=1e-9)
    assert record.u_raster == pytest.approx(0.02)
    assert not any("not used" in note for note in record.notes)
    shown = preview_log(path, {})
    assert [shown.problem, *shown.missing] == [""]
    assert {one.column: one.place for one in shown.columns} == {"time": 2, "u": 1, "theta_m": 3, "theta_l": None}


@pytest.mark.parametrize("names", [("time", "time"), ("time", "time.1"), ("t_u", "t_m")])
def test_a_signal_has_the_time_before_it_where_all_have_as_many_rows(names: tuple[str, str], tmp_path: Path) -> None:
    levels = np.random.default_rng(6).uniform(-2.0, 2.0, ROWS)
    table = np.column_stack([2.0 * TIME, levels, TIME, ANGLE])
    path = tmp_path / "log.csv"
    np.savetxt(path, table, "%.12g", ",", header=f"{names[0]},u,{names[1]},theta_m", comments="")
    record = read_record(path)
    assert record.step == pytest.approx(0.002)
    np.testing.assert_allclose(record.u, np.repeat(levels, 2)[:ROWS], atol=1e-9)
    np.testing.assert_allclose(record.theta_m, ANGLE, atol=1e-9)


@pytest.mark.parametrize("further", [1.7e9 + TIME, np.round(20.0 + TIME, 1)], ids=["another clock", "no time"])
def test_a_column_called_a_time_before_others_may_be_none_of_theirs(further: np.ndarray, tmp_path: Path) -> None:
    table = np.column_stack([TIME, HELD, further, ANGLE])
    np.savetxt(tmp_path / "log.csv", table, "%.14g", ",", header="time,u,t_motor,theta_m", comments="")
    record = read_record(tmp_path / "log.csv")
    np.testing.assert_allclose(record.u, HELD, atol=1e-9)
    assert any("not used: `t_motor`" in note for note in record.notes)


def test_times_of_merged_topics_do_not_end_together_by_chance(tmp_path: Path) -> None:
    late = OWN + 0.0007
    time = np.append(TIME, late)
    order = np.argsort(time)
    nothing, rows = np.full(TIME.size, np.nan), np.full(late.size, np.nan)
    columns = {
        "time": time, "t_drive": np.append(nothing, late), "t_motor": np.append(TIME, rows),
        "u": np.append(nothing, LEVELS), "theta_m": np.append(ANGLE, rows),
    }  # fmt: skip
    np.savez(tmp_path / "log.npz", **{name: values[order] for name, values in columns.items()})
    record = read_record(tmp_path / "log.npz", {"time": Column("time")})
    assert any("2 topics with rows of their own" in note for note in record.notes)
    np.testing.assert_allclose(record.theta_m, ANGLE[-record.size :], atol=1e-12)


def test_rows_of_a_torque_without_a_time_are_told(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    own = np.where(np.arange(OWN.size) == 7, np.nan, OWN)
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        for name, values in (("d/time", own), ("d/u", LEVELS), ("m/time", TIME), ("m/theta_m", ANGLE)):
            file[name] = values
    assert any("1 of its rows have no time and are left out" in note for note in read_record(path).notes)


def test_rows_without_a_time_are_refused_and_the_cure_works(tmp_path: Path) -> None:
    np.savez(tmp_path / "log.npz", time=TIME, theta_m=ANGLE, u=LEVELS)
    with pytest.raises(RecordError, match="no time stamps of its own: name channels of one raster, or save its times"):
        read_record(tmp_path / "log.npz")
    np.savez(tmp_path / "log.npz", time=TIME, theta_m=ANGLE, u=LEVELS, u_time=OWN)
    np.testing.assert_allclose(read_record(tmp_path / "log.npz").u, HELD, atol=1e-9)


def _date(start: datetime, seconds: float) -> str:
    return (start + timedelta(seconds=seconds)).isoformat(timespec="milliseconds")


MIDNIGHT = datetime(2026, 3, 1, 23, 59, 59)
CLOCKS = {
    "dates": ("time", lambda t: _date(MIDNIGHT, t), {}),
    "a counter that overflows": ("time [ms]", lambda t: round(1e3 * t + 4090) % 4096, {"modulo": 4096.0}),
    "sample numbers": ("sample", lambda t: round(1e3 * t), {"rate": 1000.0}),
    "seconds since 1970": ("time", lambda t: f"{1.7e9 + t:.3f}", {}),
}


@pytest.mark.parametrize("kind", CLOCKS)
def test_topics_have_times_of_any_kind(kind: str, tmp_path: Path) -> None:
    head, stamp, column = CLOCKS[kind]
    rows = [(t, f"{u:.9f}", "") for t, u in zip(OWN, LEVELS, strict=True)]
    rows += [(t + 0.001, "", f"{a:.9f}") for t, a in zip(TIME, ANGLE, strict=True)]  # each between two of the torque's
    lines = [f"{stamp(t)},{u},{a}\n" for t, u, a in sorted(rows)]
    path = tmp_path / "log.csv"
    path.write_text(f"{head},u,theta_m\n" + "".join(lines))
    record = read_record(path, {"time": Column(**column)})  # type: ignore[arg-type]
    mean = HELD.copy()
    mean[EVERY - 1 :: EVERY] = 0.5 * (LEVELS + np.append(LEVELS[1:], LEVELS[-1]))  # a row lasts over the change
    np.testing.assert_allclose(record.u[:-EVERY], mean[: record.size][:-EVERY], atol=1e-3)
    np.testing.assert_allclose(record.theta_m, ANGLE[: record.size], atol=1e-8)


def test_a_speed_is_summed_over_its_own_times(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    load = np.gradient(0.25 * ANGLE, TIME)[::2]
    with asammdf.MDF(version="4.10") as file:
        for name, values, time, unit in (
            ("u", np.cos(TIME), TIME, "Nm"),
            ("theta_m", ANGLE[: load.size], TIME[: load.size], "rad"),
            ("theta_l", load, TIME[::2], "rad/s"),
        ):
            file.append([asammdf.Signal(values, time, name=name, unit=unit)])
        file.save(tmp_path / "log.mf4", overwrite=True)
    record = read_record(tmp_path / "log.mf4", None, (), Reading(resample="cubic"))
    assert record.theta_l is not None
    assert np.ptp(record.theta_l) == pytest.approx(0.25 * np.ptp(ANGLE[: load.size]), rel=0.01)


def test_a_wrap_at_missing_rows_is_told(tmp_path: Path) -> None:
    wrapped = np.rad2deg(ANGLE) % 360.0
    wraps = np.flatnonzero(np.abs(np.diff(wrapped)) > 180.0)
    wrapped[wraps] = np.nan
    np.savez(tmp_path / "log.npz", time=TIME, theta_m=wrapped, u=np.cos(TIME))
    with pytest.raises(RecordError, match=rf"jumps by 35.* at row {wraps[0] + 2}: .* modulo = 360`"):
        read_record(tmp_path / "log.npz", {"theta_m": Column(unit="deg")})


def test_whole_numbers_are_no_radians_though_the_file_says_so(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["time"], file["u"], file["theta_m"] = TIME, np.cos(TIME), np.rint(1e4 * ANGLE)
        file["theta_m"].attrs.update({"units": "rad", "conversion_factor": 1e-4})
    with pytest.raises(RecordError, match="must not be taken as rad, as it holds whole numbers"):
        read_record(tmp_path / "log.h5")
    record = read_record(tmp_path / "log.h5", {"theta_m": Column(factor=1e-4)})
    np.testing.assert_allclose(record.theta_m, ANGLE, atol=1e-4)
    assert "attribute `conversion_factor` not used" in record.notes[0]


def _mdf(path: Path, times: Mapping[str, np.ndarray]) -> Path:
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        for name, time in times.items():
            file.append([asammdf.Signal(np.sin(time), time, name=name, unit="W" if name == "Q" else "degC")])
        file.save(path, overwrite=True)
    return path


def test_a_table_of_a_scenario_has_the_time_of_its_group(tmp_path: Path) -> None:
    path = _mdf(tmp_path / "log.mf4", {"other": TIME, "T": 3.0 * TIME})
    table, _ = read_table(path, "T")
    np.testing.assert_allclose(table.times, 3.0 * TIME)
    np.testing.assert_allclose(table.values, np.sin(3.0 * TIME))


@pytest.mark.parametrize(("times", "is_right"), [(TIME, True), (TIME + 0.01, False), (TIME[::10], False)])
def test_columns_of_a_record_of_an_fmu_have_one_time(times: np.ndarray, is_right: bool, tmp_path: Path) -> None:
    path = _mdf(tmp_path / "log.mf4", {"Q": TIME, "T": times})
    asked = [Wanted(name, f"`{name}`", "say its unit") for name in ("Q", "T")]
    if is_right:
        read = read_columns(path, Wanted("time", "`time`", ""), asked)
        np.testing.assert_array_equal(read.values[1], np.sin(TIME))
        return
    with pytest.raises(RecordError, match=r"column `T` must have .* `time`, but has .*: name channels of one raster"):
        read_columns(path, Wanted("time", "`time`", ""), asked)
