"""One record in twelve dialects through the command line: the same half-gap from each, by one command."""

import json
from pathlib import Path

import numpy as np
import pytest

from orchestrator.cli import main
from tests.support.dialects import DIALECTS
from tests.support.independent_plant import make_record, write_csv


@pytest.fixture(scope="module")
def columns() -> dict[str, np.ndarray]:
    return make_record({"alpha": 0.01}, seed=3, duration=4.0)[0]


def estimated(path: Path, out: Path, model: str) -> float:
    words = ["estimate", str(path), "--method", "ekf", "--out", str(out)]  # the quick method: the record is the matter
    if model:
        file = out.parent / "model.toml"
        file.write_text(model)
        words += ["--model", str(file)]
    assert main(words) == 0
    return float(json.loads((out / "estimate.json").read_text())["results"]["alpha"])


@pytest.fixture(scope="module")
def plain(columns: dict[str, np.ndarray], tmp_path_factory: pytest.TempPathFactory) -> float:
    folder = tmp_path_factory.mktemp("plain")
    write_csv(folder / "plain.csv", columns)
    return estimated(folder / "plain.csv", folder / "out", "")


@pytest.mark.parametrize("write", DIALECTS, ids=lambda f: f.__name__)
def test_a_dialect_gives_the_same_half_gap(write, columns: dict[str, np.ndarray], plain: float, tmp_path: Path) -> None:
    path, model = write(tmp_path, columns)
    assert estimated(path, tmp_path / "out", model) == pytest.approx(plain, rel=1e-6)
