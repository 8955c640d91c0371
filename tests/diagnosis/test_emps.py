"""A measured machine: the Electro-Mechanical Positioning System, with published values (see tests/support/emps.py)."""

from pathlib import Path

import pytest

import orchestrator as oc
from tests.support import emps

MODEL = Path(__file__).resolve().parents[2] / "docs" / "examples" / "emps.toml"


@pytest.mark.skipif(not emps.available(), reason="the public records are not here")
def test_dry_friction_and_parameters_are_the_published_ones(tmp_path: Path) -> None:
    for which in ("estimation", "test"):
        emps.write_csv(tmp_path / f"{which}.csv", which)
    found = oc.diagnose(tmp_path / "estimation.csv", MODEL, validate=tmp_path / "test.csv")
    assert found.effects[0].label == "coulomb_friction@motor"
    assert found.effects[0].parameters["torque"].value == pytest.approx(20.39, rel=0.02)
    values = {name: estimate.value for name, estimate in found.diagnosis.parameters.items()}
    assert values["J"] == pytest.approx(95.1, rel=0.02)
    assert values["b"] == pytest.approx(203.5, rel=0.02)
    assert found.validation is not None
    (position,) = found.validation.signals
    assert position.final < 0.3 * position.parameters
