"""MDF groups that are not sampled over time, and times in Parquet that are durations, decimals or times of day."""

from datetime import timedelta
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator.errors import RecordError
from orchestrator.records.formats import open_source
from orchestrator.records.record import Column, Reading, read_record
from tests.support.independent_plant import make_record

NAMES = ("u", "theta_m", "theta_l")


@pytest.fixture(scope="module")
def columns() -> dict[str, np.ndarray]:
    return make_record({"alpha": 0.01}, seed=8, duration=4.0)[0]


def _mdf(path: Path, groups: list[tuple[dict[str, np.ndarray], np.ndarray, tuple[str, int], str]]) -> Path:
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF(version="4.10") as file:
        for channels, master, metadata, unit in groups:
            signals = [
                asammdf.Signal(values, master, name=name, master_metadata=metadata) for name, values in channels.items()
            ]
            number = file.append(signals)
            if unit:
                file.groups[number].channels[file.masters_db[number]].unit = unit
        file.save(path, overwrite=True)
    return path


@pytest.mark.parametrize(
    ("metadata", "shown"),
    [(("shaft", 2), "shaft"), (("time", 2), "angle"), (("travel", 3), "travel"), (("t", 3), "distance")],
)
def test_a_master_that_is_no_time_is_not_taken_for_one(
    tmp_path: Path, columns: dict[str, np.ndarray], metadata: tuple[str, int], shown: str
) -> None:
    channels = {name: columns[name] for name in NAMES}
    path = _mdf(tmp_path / "log.mf4", [(channels, np.linspace(0.0, 8.0, columns["time"].size), metadata, "")])
    with pytest.raises(RecordError, match=rf"column `time` must be there .* but the file has `{shown},u,theta_m"):
        read_record(path)
    record = read_record(path, {"time": Column(rate=200.0)})  # the advice
    np.testing.assert_allclose(record.theta_m, columns["theta_m"], atol=1e-12)
    np.testing.assert_allclose(record.time, columns["time"], atol=1e-12)


@pytest.mark.parametrize("name", ["index", "sample", "t"])
def test_a_master_that_is_an_index_is_a_sample_number(
    tmp_path: Path, columns: dict[str, np.ndarray], name: str
) -> None:
    channels = {name: columns[name] for name in NAMES}
    path = _mdf(tmp_path / "log.mf4", [(channels, np.arange(columns["time"].size, dtype=float), (name, 4), "")])
    with pytest.raises(RecordError, match=r"is a sample number: say `\[columns.time\] rate"):
        read_record(path)
    record = read_record(path, {"time": Column(rate=200.0)})
    np.testing.assert_allclose(record.time, columns["time"], atol=1e-12)
    np.testing.assert_allclose(record.u, columns["u"], atol=1e-12)


def test_a_group_over_an_angle_beside_one_over_time(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    angles = {name: columns[name] for name in ("theta_m", "theta_l")}
    over_angle = np.linspace(0.0, 8.0, columns["time"].size)
    path = _mdf(
        tmp_path / "log.mf4",
        [(angles, columns["time"], ("time", 1), ""), ({"u": columns["u"]}, over_angle, ("shaft", 2), "")],
    )
    for how in (None, "linear"):
        with pytest.raises(RecordError, match=r"column `u` must have as many rows .* name channels of one raster"):
            read_record(path, None, (), Reading(resample=how))
    whole = _mdf(
        tmp_path / "two.mf4",
        [(angles | {"u": columns["u"]}, columns["time"], ("time", 1), ""), (angles, over_angle, ("shaft", 2), "")],
    )
    record = read_record(whole, {"theta_m": Column("#2"), "theta_l": Column("#3")})
    np.testing.assert_allclose(record.theta_l, columns["theta_l"], atol=1e-12)


def test_a_time_is_in_the_unit_that_the_file_states(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    channels = {name: columns[name] for name in NAMES}
    path = _mdf(tmp_path / "log.mf4", [(channels, 1e3 * columns["time"], ("time", 1), "ms")])
    np.testing.assert_allclose(read_record(path).time, columns["time"], atol=1e-9)


def _parquet(path: Path, table: dict[str, Any]) -> Path:
    pyarrow = pytest.importorskip("pyarrow")
    pytest.importorskip("pyarrow.parquet").write_table(pyarrow.table(table), path)
    return path


@pytest.mark.parametrize("kind", ["duration s", "duration ms", "duration us", "duration ns", "time32 ms", "time64 us"])
def test_durations_are_times(tmp_path: Path, columns: dict[str, np.ndarray], kind: str) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    word, unit = kind.split()
    per_second = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}[unit]
    step = 0.005 if unit != "s" else 1.0
    counts = np.rint(columns["time"] * (step / 0.005) * per_second).astype("i8")
    whole = counts.astype("i4") if "32" in word else counts
    times = pyarrow.array(whole).cast(getattr(pyarrow, word)(unit))
    path = _parquet(tmp_path / "log.parquet", {"time": times, **{name: columns[name] for name in NAMES}})
    with open_source(path) as source:
        assert (source.heads[0].name, source.heads[0].unit) == ("time", "s")
        np.testing.assert_allclose(source.load([0])[0], columns["time"] * (step / 0.005), atol=1e-9)
    if unit != "s":
        np.testing.assert_allclose(read_record(path).time, columns["time"], atol=1e-9)


def test_decimals_and_categories_are_numbers(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    decimals: list[Decimal | None] = [Decimal(f"{value:.6f}") for value in columns["theta_m"].tolist()]
    decimals[300] = None
    table = {
        "time": columns["time"],
        "u": pyarrow.array(np.round(columns["u"], 3)).dictionary_encode(),
        "theta_m": pyarrow.array(decimals, pyarrow.decimal128(18, 6)),
        "theta_l": pyarrow.array([Decimal(f"{v:.4f}") for v in columns["theta_l"].tolist()], pyarrow.decimal256(50, 4)),
    }
    record = read_record(_parquet(tmp_path / "log.parquet", table))
    assert np.flatnonzero(record.is_missing).tolist() == [300]
    good = ~record.is_missing
    np.testing.assert_allclose(record.theta_m[good], columns["theta_m"][good], atol=5.1e-7)
    np.testing.assert_allclose(record.theta_l, columns["theta_l"], atol=5.1e-5)
    np.testing.assert_allclose(record.u, np.round(columns["u"], 3), atol=1e-12)


@pytest.mark.parametrize("kind", ["words", "bytes", "lists"])
def test_what_is_no_number_is_refused(tmp_path: Path, columns: dict[str, np.ndarray], kind: str) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    size = columns["time"].size
    times = {
        "words": pyarrow.array(["0.5"] * size),
        "bytes": pyarrow.array([b"\0" * 12] * size, pyarrow.binary(12)),  # intervals of DuckDB
        "lists": pyarrow.array([[1.0]] * size),
    }[kind]
    path = _parquet(tmp_path / "log.parquet", {"time": times, **{name: columns[name] for name in NAMES}})
    with pytest.raises(
        RecordError, match=r"column `time` must hold numbers, but holds .*: save it as numbers, times in"
    ):
        read_record(path)


def test_a_duration_has_the_unit_second_whatever_is_said(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    times = pyarrow.array([timedelta(milliseconds=5 * n) for n in range(columns["time"].size)])
    path = _parquet(tmp_path / "log.parquet", {"t [ms]": times, **{name: columns[name] for name in NAMES}})
    np.testing.assert_allclose(read_record(path).time, columns["time"], atol=1e-9)
