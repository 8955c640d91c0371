"""Holes divide what was logged into parts that are fitted together."""

import numpy as np
import pytest

import orchestrator as oc
from orchestrator.errors import RecordError
from orchestrator.records.record import record_from_columns
from tests.support.independent_plant import make_record

TRUE = {"alpha": 0.0137, "Fc_m": 0.8}
EFFECTS = ["backlash@shaft", "coulomb_friction@motor"]


def _log(lost: list[slice], duration: float = 8.0) -> dict[str, np.ndarray]:
    table = make_record(TRUE, 5, duration, substeps=50)[0]
    kept = np.ones(table["time"].size, dtype=bool)
    for rows in lost:
        kept[rows] = False
    return {name: values[kept] for name, values in table.items()}


def test_the_parts_between_long_holes_are_fitted_together() -> None:
    table = _log([slice(600, 1100)])
    with pytest.raises(RecordError, match="rows missing"):
        record_from_columns(table, "log")
    record = record_from_columns(table, "log", holes=True)
    assert [part.size for part in record.parts_between_holes()] == [600, 500]
    seen = oc.inspect(record).record
    assert seen.size == 600
    assert any("2 parts: the longest one is looked at" in note for note in seen.notes)
    found = oc.diagnose(record, effects=EFFECTS).diagnosis
    assert any("2 parts, which are fitted together" in note for note in found.notes)
    for effect, name, true in zip(found.effects, ("alpha", "torque"), TRUE.values(), strict=True):
        low, high = effect.parameters[name].interval
        assert low - 0.01 * true < true < high + 0.01 * true


def test_short_holes_and_parts_that_are_no_record_divide_nothing() -> None:
    record = record_from_columns(_log([slice(600, 615), slice(1500, 1530)]), "log")
    assert record.parts_between_holes() == [record]
    scattered = _log([slice(n, n + 30) for n in range(20, 1560, 100)])
    with pytest.raises(RecordError, match="between holes"):
        oc.diagnose(record_from_columns(scattered, "log", holes=True))
