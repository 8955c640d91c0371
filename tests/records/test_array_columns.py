"""`[i,j]` behind a name is an element of an array, and no unit: in results, records, maps and sources."""

from pathlib import Path

import numpy as np
import pytest

from orchestrator.errors import RecordError
from orchestrator.records.formats import open_source
from orchestrator.records.formats.heads import head_of
from orchestrator.records.record import Column, read_record
from orchestrator.records.tables import Wanted, column_names, read_columns
from orchestrator.scenarios.tables import read_table
from tests.support.independent_plant import make_record

WANTED = Wanted("time", "`time`", "say `unit`")


@pytest.mark.parametrize(
    ("text", "name", "unit"),
    [
        ("n.y[1,2]", "n.y[1,2]", ""),
        ("y[ 1, 2 ]", "y[ 1, 2 ]", ""),
        ("x[1].y[2,3,4]", "x[1].y[2,3,4]", ""),
        ("y[1:3]", "y[1:3]", ""),
        ("y[1,2] [N.m]", "y[1,2]", "N.m"),
        ("y[1,2] / rad", "y[1,2]", "rad"),
        ("y[2,1] (deg)", "y[2,1]", "deg"),
        ("q[1]_rad", "q[1]", "rad"),
        ("speed [1/min]", "speed", "1/min"),
        ("q [1/8192 rev]", "q", "1/8192 rev"),
        ("M [Nm] soll", "M soll", "Nm"),
    ],
)
def test_an_index_is_part_of_the_name(text: str, name: str, unit: str) -> None:
    head = head_of(text)
    assert (head.name, head.unit, head.full) == (name, unit, text)


@pytest.mark.parametrize("head", ['time,"n.y[1,2]","n.y[2,1]"', "time,n.y[1,2],n.y[2,1]", 'time;n.y[1,2];"n.y[2,1]"'])
def test_elements_of_a_result_are_sources(tmp_path: Path, head: str) -> None:
    path = tmp_path / "simulate.csv"
    separator = ";" if ";" in head else ","
    rows = [f"{0.1 * n:.1f}{separator}{2 * n}.0{separator}{3 * n}.0" for n in range(4)]
    path.write_text("\n".join([head, *rows]) + "\n")
    assert column_names(path) == ["time", "n.y[1,2]", "n.y[2,1]"]
    table, unit = read_table(path, "n.y[2,1]")
    assert unit == ""
    np.testing.assert_allclose(table.sample(np.array([0.0, 0.1, 0.3])), [0.0, 3.0, 9.0])
    found = read_columns(path, WANTED, [Wanted("n.y[1,2]", "$.outputs.y", "")])
    assert (found.units, found.labels) == (("",), ("time", "n.y[1,2]"))


def test_elements_of_a_record(tmp_path: Path) -> None:
    columns = make_record({"alpha": 0.01}, seed=3, duration=2.0)[0]
    path = tmp_path / "log.csv"
    names = dict(zip(columns, ("time", "axis.u[1,2]", "axis.q[1,1] [deg]", "axis.q[1,2] [deg]"), strict=True))
    scaled = {key: np.degrees(values) if key.startswith("theta") else values for key, values in columns.items()}
    rows = [",".join(f"{v:.10g}" for v in row) for row in zip(*scaled.values(), strict=True)]
    path.write_text("\n".join([",".join(names.values()), *rows]) + "\n")
    record = read_record(path, {key: Column(name) for key, name in names.items() if key != "time"})
    for key in ("u", "theta_m", "theta_l"):
        np.testing.assert_allclose(getattr(record, key), columns[key], atol=1e-7)


def test_arrays_within_a_cell_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "array.csv"
    path.write_text('"time","y"\n' + "".join(f"{0.1 * n},0 1 2 3 4 {n}\n" for n in range(20)))
    said = r"must hold one value each, .* as FMPy writes arrays: save the elements as"
    with pytest.raises(RecordError, match=said), open_source(path):
        pass
