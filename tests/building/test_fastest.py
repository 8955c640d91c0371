"""Which builds run here: native ones, if their bits are those of the Python slaves."""

from pathlib import Path

import pytest

from orchestrator.building import fastest
from orchestrator.building.compilers import find_compiler
from orchestrator.building.native_sources import slave_class
from orchestrator.building.sources import recipe_of
from orchestrator.paired.cosimulation import FMUS

pytestmark = pytest.mark.skipif(find_compiler(here=True) is None, reason="no C compiler")


@pytest.fixture(scope="module")
def builds() -> fastest.FmuBuilds:
    return fastest.ensure_fastest(FMUS)


def test_native_builds_have_the_bits_and_are_the_default(builds: fastest.FmuBuilds) -> None:
    assert builds.kind == fastest.NATIVE
    assert set(builds.paths) == set(FMUS)


@pytest.mark.parametrize(("name", "parameter"), [("Drivetrain", "k"), ("KalmanEstimator", "theta_l_hat_start")])
def test_another_bit_is_noticed(builds: fastest.FmuBuilds, name: str, parameter: str) -> None:
    cls = slave_class(recipe_of(name))
    assert fastest._agree(name, cls, builds.paths[name], {})
    start = next(float(v.start or 0.0) for v in cls.table if v.name == parameter)
    cls.customise(name, "other", {parameter: start * (1.0 + 1e-15) or 1e-12})
    assert not fastest._agree(name, cls, builds.paths[name], {})


def test_what_differs_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fastest, "same_bits", lambda name, path: False)
    assert fastest.ensure_fastest(["LqrController"]).kind == fastest.PYTHON


def test_without_a_compiler_python_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fastest, "find_compiler", lambda here: None)
    found = fastest.ensure_fastest(["LqrController"])
    assert (found.kind, Path(found.paths["LqrController"]).is_file()) == (fastest.PYTHON, True)
