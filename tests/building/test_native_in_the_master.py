"""Native FMUs in the project's own master: the same bits as the Python FMUs, alone and as the paired loops."""

from pathlib import Path

import numpy as np
import pytest

import orchestrator as oc
from orchestrator.building.compilers import find_compiler
from tests.support import paired_loop

pytestmark = pytest.mark.skipif(find_compiler(here=True) is None, reason="no C compiler")

SCENARIO = """
stop = 0.5
record = ["plant.theta_m", "plant.theta_l", "plant.contact", "plant.T_shaft"]

[master]
algorithm = "gauss_seidel"
step = 1e-3

[instances.plant]
fmu = "{fmu}"
[instances.plant.parameters]
alpha = 0.01

[[sources]]
to = "plant.u"
kind = "square"
amplitude = 20.0
period = 0.3
"""


@pytest.fixture(scope="module")
def native(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    names = ["Drivetrain", "LqrController", "KalmanEstimator"]
    told: list[tuple[str, float]] = []
    built = oc.build(
        names, native=True, directory=tmp_path_factory.mktemp("native"), progress=lambda *what: told.append(what)
    )
    assert sorted(what for what, _ in told) == sorted(f"built {name}" for name in names)
    assert [share for _, share in told] == [(n + 1) / len(names) for n in range(len(names))]
    return {name: built[name] for name in names}


def test_a_scenario_gives_the_same_bits(native: dict[str, Path], fmus: dict[str, Path], tmp_path: Path) -> None:
    found = {}
    for kind, path in (("python", fmus["Drivetrain"]), ("native", native["Drivetrain"])):
        scenario = tmp_path / f"{kind}.toml"
        scenario.write_text(SCENARIO.format(fmu=path.as_posix()), encoding="utf-8")
        found[kind] = oc.simulate(scenario)
    for signal in ("plant.theta_m", "plant.theta_l", "plant.contact", "plant.T_shaft"):
        assert np.array_equal(found["python"][signal], found["native"][signal]), signal
    assert np.ptp(found["native"]["plant.contact"]) > 0


def test_paired_loops_give_the_same_bits(native: dict[str, Path], fmus: dict[str, Path]) -> None:
    assert paired_loop.gauss_seidel(native, 200) == paired_loop.gauss_seidel(fmus, 200)


# A native plant is checked by day in tests/fmi/test_exchange_hosts.py.
@pytest.mark.parametrize(
    "name", ["LqrController", *(pytest.param(n, marks=pytest.mark.night) for n in ("Drivetrain", "KalmanEstimator"))]
)
def test_check_finds_nothing(native: dict[str, Path], name: str) -> None:
    assert not oc.check(native[name]).findings
