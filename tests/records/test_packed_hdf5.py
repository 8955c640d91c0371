"""HDF5 files whose numbers are packed, as netCDF does it; tables of pandas in HDF5 are refused."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator.cli import main
from orchestrator.errors import RecordError
from orchestrator.records.record import Column, read_record
from tests.support.independent_plant import make_record

h5py = pytest.importorskip("h5py")
LOST = 300


@pytest.fixture(scope="module")
def columns() -> dict[str, np.ndarray]:
    return make_record({"alpha": 0.01}, seed=6, duration=4.0)[0]


def _write(
    path: Path, columns: Mapping[str, np.ndarray], attributes: Mapping[str, Mapping[str, Any]], **how: Any
) -> None:
    with h5py.File(path, "w") as file:
        for name, values in columns.items():
            data = file.create_dataset(name, data=values, **(how if name == "theta_m" else {}))
            for key, value in attributes.get(name, {}).items():
                data.attrs[key] = value


# What numbers are stored as, scale, offset, the number at the place without a value, attributes.
KINDS: dict[str, tuple[str, float, float, int, dict[str, Any]]] = {
    "scale, offset and fill": ("i2", 1e-3, 5.0, -32768, {"_FillValue": np.int16(-32768)}),
    "scale alone": ("i4", 1e-6, 0.0, -9, {"missing_value": np.int32(-9)}),
    "several numbers for no value": ("i2", 1e-3, 0.0, -998, {"missing_value": np.array([-999, -998], dtype="i2")}),
    "valid range": ("i2", 1e-3, 5.0, 32000, {"valid_range": np.array([-31000, 31000], dtype="i2")}),
    "valid least": ("i2", 1e-3, 5.0, -32000, {"valid_min": np.int16(-31000)}),
    "valid most, of what is unpacked": ("i2", 1e-3, 5.0, 32000, {"valid_max": 30.0}),
    "bits without a sign": ("i2", 1e-3, -5.0, -1, {"_Unsigned": "true", "_FillValue": np.int16(-1)}),
    "bits without a sign, within a range": (
        "i2", 1e-3, -5.0, -2, {"_Unsigned": b"true", "valid_range": np.array([0, -6], dtype="i2")},
    ),
    "bits with a sign": ("u2", 1e-3, 5.0, 2**16 - 9, {"_Unsigned": "false", "_FillValue": np.uint16(2**16 - 9)}),
    "single precision": ("f4", 1.0, 0.0, -9999, {"_FillValue": np.float64(-9999.0)}),
    "attributes of one number each": ("i4", 1e-6, 1.0, -7, {"_FillValue": np.array([-7], dtype="i4")}),
}  # fmt: skip


@pytest.mark.parametrize("name", KINDS)
def test_packed_numbers_become_values(tmp_path: Path, columns: dict[str, np.ndarray], name: str) -> None:
    kind, scale, offset, lost, attributes = KINDS[name]
    given = {**attributes, "units": "rad"}
    if kind != "f4":
        given |= {"scale_factor": np.array([scale]), "add_offset": np.float64(offset)}
        whole = np.rint((columns["theta_m"] - offset) / scale).astype("i8")
        packed = whole.astype(kind.replace("i", "u") if "_Unsigned" in attributes else kind).view(kind)
    else:
        packed = columns["theta_m"].astype("f4")
    packed[LOST] = np.asarray(lost).astype(kind)
    path = tmp_path / "log.nc"
    _write(
        path, {**columns, "theta_m": packed}, {"theta_m": given, "time": {"units": "seconds since 2024-01-01 00:00:00"}}
    )
    record = read_record(path)
    assert np.flatnonzero(record.is_missing).tolist() == [LOST]
    good = ~record.is_missing
    np.testing.assert_allclose(
        record.theta_m[good], columns["theta_m"][good], atol=0.51 * scale if kind != "f4" else 1e-5
    )
    np.testing.assert_allclose(record.theta_l, columns["theta_l"], atol=1e-12)
    assert "`theta_m`" in record.notes[0]
    assert "1 missing" in record.notes[0]


def test_a_packed_torque_is_in_its_unit(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path = tmp_path / "log.h5"
    packed = np.rint(columns["u"] / 1e-3).astype("i4")
    _write(path, {**columns, "u": packed}, {"u": {"scale_factor": 1e-3, "units": "N.m"}})
    record = read_record(path)
    np.testing.assert_allclose(record.u, columns["u"], atol=0.51e-3)
    assert "`u` times 0.001" in record.notes[0]


@pytest.mark.parametrize("kind", ["i2", "f4", "f8"])
def test_what_was_never_written_is_missing(tmp_path: Path, columns: dict[str, np.ndarray], kind: str) -> None:
    path = tmp_path / "log.h5"
    fill = -32767 if kind == "i2" else 9.969209968386869e36  # netCDF's own, without an attribute
    with h5py.File(path, "w") as file:
        for name in ("time", "u", "theta_l"):
            file[name] = columns[name]
        data = file.create_dataset("theta_m", columns["time"].shape, dtype=kind, fillvalue=fill)
        data[:700] = np.rint(columns["theta_m"][:700] * 1e3) if kind == "i2" else columns["theta_m"][:700]
        if kind == "i2":
            data.attrs["scale_factor"] = 1e-3
    record = read_record(path)
    assert np.flatnonzero(record.is_missing).tolist() == list(range(700, columns["time"].size))
    np.testing.assert_allclose(record.theta_m[:700], columns["theta_m"][:700], atol=1e-3)


def test_zero_and_bytes_are_no_marks(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path = tmp_path / "log.h5"
    packed = np.rint(columns["theta_m"] / columns["theta_m"].max() * 100).astype("i1")
    _write(path, {**columns, "theta_m": packed}, {"theta_m": {"scale_factor": 0.01}}, fillvalue=int(packed[5]) or 1)
    assert read_record(path).n_missing == 0


@pytest.mark.parametrize(
    ("attributes", "said"),
    [
        ({"scale_factor": "0.001"}, "`scale_factor` must be a number, but is '0.001'"),
        ({"scale_factor": np.array([1.0, 2.0])}, "`scale_factor` must be one number, but is 2"),
        ({"scale_factor": 0.0}, "`scale_factor` must be a finite number that is not 0"),
        ({"add_offset": np.nan}, "`add_offset` must be a finite number"),
        ({"valid_range": 3.0}, "`valid_range` must be two numbers"),
    ],
)
def test_attributes_that_say_nothing_are_refused(
    tmp_path: Path,
    columns: dict[str, np.ndarray],
    attributes: dict[str, Any],
    said: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = tmp_path / "log.h5"
    _write(path, columns, {"theta_m": attributes})
    with pytest.raises(RecordError, match=f"column `theta_m`: {said}.*mend the attribute, or save as CSV"):
        read_record(path)
    assert main(["inspect", str(path), "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.count("\n") >= 1


def test_attributes_of_other_conventions_are_named(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path = tmp_path / "log.h5"
    _write(
        path, columns,
        {
            "theta_m": {"gain": 2.0}, "u": {"Offset": 1.0, "note": h5py.Empty("S1")},
            "theta_l": {"FillValue": -9999.0, "no_data": -1.0, "missing_value": -2.0, "FIELD_0_FILL": 0.0},
        },
    )  # fmt: skip
    notes = read_record(path).notes[0]
    assert "`theta_l` attribute `FillValue` not used, attribute `no_data` not used" in notes
    assert "`missing_value`" not in notes
    assert "FIELD" not in notes
    assert "`theta_m` attribute `gain` not used" in notes
    assert "`u` attribute `Offset` not used" in notes


def test_a_dimension_without_values_is_no_time(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path = tmp_path / "log.nc"
    said = "This is a netCDF dimension but not a netCDF variable.       800"
    _write(path, {**columns, "time": np.zeros(columns["time"].size)}, {"time": {"NAME": said}})
    with pytest.raises(RecordError, match="column `time` must be there"):
        read_record(path)
    record = read_record(path, {"time": Column(rate=200.0)})
    np.testing.assert_allclose(record.theta_m, columns["theta_m"], atol=1e-12)


def test_netcdf_of_the_classic_format_is_named(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    from scipy.io import netcdf_file

    path = tmp_path / "log.nc"
    with netcdf_file(path, "w") as file:
        file.createDimension("n", columns["time"].size)
        for name, values in columns.items():
            file.createVariable(name, "d", ("n",))[:] = values
    with pytest.raises(RecordError, match="netCDF file of the classic format: save it as netCDF-4"):
        read_record(path)


@pytest.mark.parametrize("members", [
    ("table",), ("axis0", "axis1", "block0_items", "block0_values"),
])  # fmt: skip
def test_a_table_of_pandas_is_refused_with_the_cure(
    tmp_path: Path, columns: dict[str, np.ndarray], members: tuple[str, ...]
) -> None:
    path = tmp_path / "log.h5"
    rows = np.zeros(columns["time"].size, dtype=[("index", "i8"), *((name, "f8") for name in columns)])
    with h5py.File(path, "w") as file:
        for name in members:
            file[f"logs/machine/{name}"] = rows
    with pytest.raises(RecordError, match="`/logs/machine` is a table of pandas: save it by `to_parquet` or `to_csv`"):
        read_record(path)
