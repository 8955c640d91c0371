"""Shapes of MAT files as people have them, and MDF samples that are marked invalid."""

import struct
from pathlib import Path

import numpy as np
import pytest
import scipy.io

from orchestrator.records.formats import open_source
from orchestrator.records.record import read_record
from tests.support.independent_plant import make_record

N = 250
TIME = 0.01 * np.arange(N)
VALUES = {"time": TIME, "u": np.sin(TIME), "theta_m": TIME**2, "theta_l": np.cos(TIME)}


def _read(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str], str]:
    with open_source(path) as source:
        values = source.load(range(len(source.heads)))
        heads = source.heads
        return (
            {head.name: found for head, found in zip(heads, values, strict=True)},
            {head.name: head.unit for head in heads},
            source.dialect,
        )


def _has_all(path: Path) -> tuple[dict[str, str], str]:
    values, units, said = _read(path)
    for name, expected in VALUES.items():
        np.testing.assert_allclose(values[name], expected, err_msg=name)
    return units, said


def _element(kind: int, data: bytes) -> bytes:
    return struct.pack("<2I", kind, len(data)) + data + bytes(-len(data) % 8)


def _object(name: str, kind: str) -> bytes:
    """A variable as MATLAB 7 writes an object of a class: no dimensions, three texts and the object's number."""
    numbers = _element(6, struct.pack("<2I", 13, 0)) + _element(5, struct.pack("<2i", 6, 1)) + _element(1, b"")
    numbers += _element(6, struct.pack("<6I", 0xDD000000, 2, 1, 1, 1, 1))
    body = _element(6, struct.pack("<2I", 17, 0)) + b"".join(_element(1, t.encode()) for t in (name, "MCOS", kind))
    return _element(14, body + _element(14, numbers))


@pytest.mark.parametrize("compressed", [False, True])
def test_vectors_beside_objects(compressed: bool, tmp_path: Path) -> None:
    path = tmp_path / "log.mat"
    scipy.io.savemat(
        path, VALUES | {"note": "bench", "names": np.array(["a", 1], dtype=object)}, do_compression=compressed
    )
    data = path.read_bytes()
    objects = [_object(name, kind) for name, kind in (("who", "string"), ("when", "datetime"), ("all", "table"))]
    path.write_bytes(data[:128] + objects[0] + data[128:] + b"".join(objects[1:]))
    _, said = _has_all(path)
    for name in ("`who` (string)", "`when` (datetime)", "`all` (table)", "`note` (text)", "`names` (cell)"):
        assert name in said
    assert read_record(path).size == N


def test_structure_with_time(tmp_path: Path) -> None:
    signals = np.zeros(3, dtype=[("values", object), ("dimensions", object), ("label", object), ("title", object)])
    for n, name in enumerate(("u", "theta_m", "theta_l")):
        signals[n] = (VALUES[name][:, None], 1.0, name, "")
    scope = {"time": TIME[:, None], "signals": signals, "blockName": "model/Scope"}
    scipy.io.savemat(tmp_path / "scope.mat", {"ScopeData": scope})
    _has_all(tmp_path / "scope.mat")


def test_arrays_of_structures(tmp_path: Path) -> None:
    log = np.zeros(4, dtype=[("name", object), ("unit", object), ("data", object)])
    for n, (name, unit) in enumerate((("time", "s"), ("u", "Nm"), ("theta_m", "rad"), ("theta_l", "rad"))):
        log[n] = (name, unit, VALUES[name])
    scipy.io.savemat(tmp_path / "log.mat", {"log": log})
    units, _ = _has_all(tmp_path / "log.mat")
    assert units == {"time": "s", "u": "Nm", "theta_m": "rad", "theta_l": "rad"}
    samples = np.zeros(N, dtype=[(name, object) for name in VALUES])
    for n in range(N):
        samples[n] = tuple(values[n] for values in VALUES.values())
    scipy.io.savemat(tmp_path / "samples.mat", {"s": samples})
    _has_all(tmp_path / "samples.mat")


def test_nested_structures_keep_their_names_apart(tmp_path: Path) -> None:
    axes = {"motor": {"pos": TIME, "note": "a"}, "load": {"pos": -TIME}, "time": TIME}
    scipy.io.savemat(tmp_path / "log.mat", {"log": axes})
    values, _, _ = _read(tmp_path / "log.mat")
    np.testing.assert_allclose(values["pos"], TIME)
    np.testing.assert_allclose(values["load.pos"], -TIME)


def test_version_4_in_both_orders(tmp_path: Path) -> None:
    path = tmp_path / "log.mat"
    scipy.io.savemat(path, VALUES, format="4")
    _has_all(path)
    text = b""
    for name, values in VALUES.items():
        text += (
            struct.pack(">5i", 1000, N, 1, 0, len(name) + 1) + name.encode() + b"\x00" + values.astype(">f8").tobytes()
        )
    path.write_bytes(text)
    _has_all(path)


@pytest.mark.parametrize("form", ["binTrans", "binNormal"])
def test_results_of_modelica_tools(form: str, tmp_path: Path) -> None:
    names = ["Time", "J", "u", "theta_m", "theta_l", "minus"]
    said = ["Simulation time [s]", "Inertia [kg.m2]", "Torque [N.m]", "Angle [rad|deg]", "Angle [rad|deg]", "Negated"]
    info = np.array([[0, 1, 0, -1], [1, 2, 0, 0], *([2, k, 0, -1] for k in (2, 3, 4)), [2, -2, 0, -1]], dtype=np.int32)
    data = np.vstack(list(VALUES.values()))

    def texts(lines: list[str], transposed: bool) -> np.ndarray:
        width = max(map(len, lines))
        table = np.array([list(line.ljust(width)) for line in lines])
        return np.ascontiguousarray(table.T) if transposed else table

    over = form == "binTrans"
    content = {
        "Aclass": texts(["Atrajectory", "1.1", "", form], False), "name": texts(names, over),
        "description": texts(said, over), "dataInfo": info.T if over else info,
        "data_1": np.array([[0.0, 1.0], [2.0, 2.0]]), "data_2": data if over else data.T,
    }  # fmt: skip
    path = tmp_path / "result.mat"
    scipy.io.savemat(path, content, format="4")
    units, told = _has_all(path)
    assert units["theta_m"] == "rad"
    assert "passed over: 1 variables that do not change" in told
    np.testing.assert_allclose(_read(path)[0]["minus"], -VALUES["u"])
    assert read_record(path).size == N


def test_hdf5_objects_and_references(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        data = file.create_group("#refs#")
        signals = file.create_group("scope/signals")
        file["scope"].create_dataset("time", data=TIME)
        columns: dict[str, list] = {"values": [], "label": []}
        for name in ("u", "theta_m", "theta_l"):
            columns["values"].append(data.create_dataset(f"v_{name}", data=VALUES[name]).ref)
            label = data.create_dataset(f"l_{name}", data=np.array([[ord(c)] for c in name], dtype=np.uint16))
            label.attrs["MATLAB_class"] = np.bytes_("char")
            columns["label"].append(label.ref)
        for name, references in columns.items():
            signals.create_dataset(name, data=np.array(references, dtype=h5py.ref_dtype))
        for name, kind in (("who", "string"), ("f", "function_handle"), ("n", "int32")):
            file.create_dataset(name, data=np.zeros((1, 6), np.int32)).attrs["MATLAB_class"] = np.bytes_(kind)
        file["who"].attrs["MATLAB_object_decode"] = 3
        file["nothing"] = h5py.Empty(float)
    _, said = _has_all(path)
    assert said.endswith("passed over: `f` (function_handle), `who` (string)")
    assert _read(path)[0]["n"].tolist() == [0.0] * 6


@pytest.mark.parametrize("channel", ["u", "theta_m", "theta_l"])
def test_invalid_samples_are_missing_at_their_own_rows(channel: str, tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf")
    columns = make_record({"alpha": 0.01}, seed=3, duration=4.0)[0]
    bad = np.zeros(columns["time"].size, dtype=bool)
    bad[[7, 300, 301, 650]] = True
    path = tmp_path / "log.mf4"
    signals = []
    for name in ("u", "theta_m", "theta_l"):
        values = np.where(bad & (name == channel), 999.0, columns[name])
        bits = asammdf.signal.InvalidationArray(bad, (0, 0)) if name == channel else None
        signals.append(asammdf.Signal(values, columns["time"], name=name, invalidation_bits=bits))
    with asammdf.MDF(version="4.10") as file:
        file.append(signals)
        file.save(path, overwrite=True)
    record = read_record(path)
    assert np.flatnonzero(record.is_missing).tolist() == [7, 300, 301, 650]
    np.testing.assert_allclose(getattr(record, channel)[~bad], columns[channel][~bad])
    assert abs(record.u).max() < 900.0
