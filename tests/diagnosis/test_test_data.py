"""Test data takes no part in any choice: only the report opens it."""

import ast
from pathlib import Path

import numpy as np
import pytest

from orchestrator.diagnosis.data.records import TestData, split_records
from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.records.model_file import default_model
from orchestrator.records.record import record_from_columns
from tests.support.independent_plant import make_record

ROOM = Path(__file__).resolve().parents[2] / "orchestrator"
OPENER = ROOM / "diagnosis" / "report" / "open_test_data.py"
HELD = {"_records", "_first_rows"}


def readers_of(root):
    """Files that read what test data holds, and files that import the opener."""
    reading, opening = set(), set()
    for path in root.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and node.attr in HELD and isinstance(node.ctx, ast.Load):
                reading.add(path)
            if isinstance(node, ast.ImportFrom) and (node.module or "").endswith("open_test_data"):
                opening.add(path)
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("getattr", "vars"):
                names = [arg.value for arg in node.args if isinstance(arg, ast.Constant)]
                if HELD & set(names):
                    reading.add(path)
    return reading, opening


def test_only_the_opener_reads_test_data_and_only_the_report_opens_it():
    reading, opening = readers_of(ROOM)
    assert reading == {OPENER}
    assert opening
    assert all("report" in (path.parent.name, path.stem) for path in opening), opening


def test_the_walk_finds_a_reader(tmp_path):
    (tmp_path / "search.py").write_text("def choose(data):\n    return data._records[0]\n")
    reading, _ = readers_of(tmp_path)
    assert reading == {tmp_path / "search.py"}


def test_the_last_rows_are_split_off():
    columns, _ = make_record({}, 3, 6.0, substeps=20)
    record = record_from_columns(columns, "record")
    (fitted,), data = split_records([record], 0.15)
    assert fitted.size == round(0.85 * record.size)
    assert isinstance(data, TestData)
    other = record_from_columns(columns, "other")
    (whole,), _ = split_records([record], 0.15, other)
    assert whole.size == record.size


@pytest.mark.slow
@pytest.mark.parametrize("effects", [["coulomb_friction@motor"], pytest.param(None, marks=pytest.mark.night)])
def test_what_test_data_hold_changes_no_name_and_no_size(effects):
    columns, _ = make_record({"Fc_m": 0.8}, 5, 12.0, substeps=50)
    size = columns["time"].size
    changed = {name: values.copy() for name, values in columns.items()}
    rows = slice(round(0.86 * size), size)
    changed["theta_m"][rows] += 0.3 * np.sin(np.arange(size)[rows] / 7.0)
    found, other = (
        diagnose(record_from_columns(c, "record"), default_model(), effects=effects) for c in (columns, changed)
    )
    assert [e.label for e in found.effects] == [e.label for e in other.effects]
    assert all(spoilt.grade <= whole.grade for whole, spoilt in zip(found.effects, other.effects, strict=True))
    assert found.effects[0].parameters == other.effects[0].parameters
    assert other.test[0].signals[0].final > 10.0 * found.test[0].signals[0].final
    assert other.trust.level > found.trust.level
