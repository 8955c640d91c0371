"""One record in twelve dialects is the same record, to the digits that the dialect keeps."""

from pathlib import Path

import numpy as np
import pytest

from orchestrator.records.model_file import read_model
from orchestrator.records.record import Record, read_record
from tests.support.dialects import DIALECTS
from tests.support.independent_plant import make_record, write_csv


@pytest.fixture(scope="module")
def columns() -> dict[str, np.ndarray]:
    return make_record({"alpha": 0.01}, seed=3, duration=4.0)[0]


@pytest.fixture(scope="module")
def plain(columns: dict[str, np.ndarray], tmp_path_factory: pytest.TempPathFactory) -> Record:
    path = tmp_path_factory.mktemp("plain") / "plain.csv"
    write_csv(path, columns)
    return read_record(path)


@pytest.mark.parametrize("write", DIALECTS, ids=lambda f: f.__name__)
def test_a_dialect_gives_the_same_arrays(write, columns: dict[str, np.ndarray], plain: Record, tmp_path: Path) -> None:
    path, text = write(tmp_path, columns)
    model = tmp_path / "model.toml"
    model.write_text(text)
    record = read_record(path, read_model(model).columns)
    assert record.n_missing == 0
    assert record.size == plain.size
    assert record.step == pytest.approx(plain.step, rel=1e-6)
    np.testing.assert_allclose(record.u, plain.u, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(record.theta_m, plain.theta_m, rtol=1e-8, atol=1e-8)
    np.testing.assert_allclose(record.theta_l, plain.theta_l, rtol=1e-8, atol=1e-8)
    assert record.notes
