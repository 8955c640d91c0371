"""Conversions of MDF channels: tables from ranges to values, and formulas wherever they stand."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orchestrator.errors import RecordError
from orchestrator.records.formats import open_source
from orchestrator.records.record import read_record
from tests.support.independent_plant import make_record

asammdf = pytest.importorskip("asammdf")
conversion_utils = pytest.importorskip("asammdf.blocks.conversion_utils")

RANGES = {"lower_0": 0, "upper_0": 2, "phys_0": 10, "lower_1": 3, "upper_1": 5, "phys_1": 20, "default": -1}
FORMULA = {"formula": "X/1000"}
# A raw number that stands for `not available`, and the scale of all others.
SCALED = {"val_0": 2147483647, "text_0": b"not available"}


def _write(channels: dict[str, tuple[np.ndarray, dict[str, Any] | None]], time: np.ndarray) -> Any:
    file = asammdf.MDF(version="4.10")
    file.append(
        [
            asammdf.Signal(
                values, time, name=name, conversion=None if table is None else conversion_utils.from_dict(table)
            )
            for name, (values, table) in channels.items()
        ]
    )
    return file


def _save(file: Any, path: Path) -> Path:
    with file:
        file.save(path, overwrite=True)
    return path


@pytest.mark.parametrize(
    ("raw", "expected"),
    [
        (np.arange(-2, 8, dtype=np.int16), [-1, -1, 10, 10, 10, 20, 20, 20, -1, -1]),
        (np.arange(8, dtype=np.uint8), [10, 10, 10, 20, 20, 20, -1, -1]),
        (np.array([-0.5, 0.0, 1.9, 2.0, 2.5, 3.0, 4.9, 5.0]), [-1, 10, 10, -1, -1, 20, 20, -1]),
    ],
    ids=["int16", "uint8", "float64"],
)
def test_a_table_of_ranges(tmp_path: Path, raw: np.ndarray, expected: list[int]) -> None:
    path = _save(_write({"step": (raw, RANGES)}, np.arange(raw.size) * 0.01), tmp_path / "log.mf4")
    with open_source(path) as source:
        place = [head.name for head in source.heads].index("step")
        assert source.load([place])[0].tolist() == expected


@pytest.fixture(scope="module")
def counts() -> dict[str, np.ndarray]:
    columns = make_record({"alpha": 0.01}, seed=3, duration=4.0)[0]
    raw = {name: np.round(columns[name] * 1000).astype(np.int32) for name in ("theta_m", "theta_l")}
    return {"time": columns["time"], "u": columns["u"], **raw}


def test_a_scale_beside_a_text(tmp_path: Path, counts: dict[str, np.ndarray]) -> None:
    angle = counts["theta_m"].copy()
    angle[77] = 2147483647
    scaled = {**SCALED, "default_addr": conversion_utils.from_dict({"a": 0.001, "b": 0.0})}
    channels = {
        "u": (counts["u"], None),
        "theta_m": (angle, scaled),
        "theta_l": (counts["theta_l"], {"a": 0.001, "b": 0}),
    }
    record = read_record(_save(_write(channels, counts["time"]), tmp_path / "log.mf4"))
    assert np.flatnonzero(record.is_missing).tolist() == [77]
    np.testing.assert_allclose(np.delete(record.theta_m, 77), np.delete(counts["theta_m"], 77) / 1000)


@pytest.mark.parametrize(
    ("inner", "what"), [(FORMULA, "a formula"), (RANGES, "a table of ranges")], ids=["formula", "ranges"]
)
@pytest.mark.parametrize("where", ["beside a text", "of the master"])
def test_what_cannot_be_converted_is_refused(
    tmp_path: Path, counts: dict[str, np.ndarray], inner: dict[str, Any], what: str, where: str
) -> None:
    table = {**SCALED, "default_addr": conversion_utils.from_dict(inner)} if where == "beside a text" else None
    channels = {name: (counts[name], table if name == "theta_m" else None) for name in ("u", "theta_m", "theta_l")}
    file = _write(channels, counts["time"])
    if where == "of the master":
        file.groups[0].channels[file.masters_db[0]].conversion = conversion_utils.from_dict(inner)
    name = "theta_m" if where == "beside a text" else "time"
    with pytest.raises(RecordError, match=f"column `{name}` must have a linear conversion, but has {what}"):
        read_record(_save(file, tmp_path / "log.mf4"))
