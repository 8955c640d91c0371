"""FMUs of FMI 3.0 in the loop of a black box: the bits of FMI 2.0, mixed ones too; answers other than OK are told."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from orchestrator.diagnosis.fmu.coupled_fmus import Batch, CoupledFmus, LoadRequest, Run
from orchestrator.errors import FmuError, SlaveError
from tests.support.ball3 import build_ball
from tests.support.c_fmu import have_compiler
from tests.support.typed3_fmu import build_typed3_fmu

pytestmark = pytest.mark.skipif(not have_compiler(), reason="there is no C compiler")

TABLE = np.random.default_rng(0).uniform(-20.0, 20.0, (400, 1))


@pytest.fixture(scope="module")
def halves(build_native: Callable[..., dict[str, Path]]) -> dict[int, dict[str, Path]]:
    names = ["MotorHalf", "LoadHalf"]
    return {fmi: build_native(names, fmi=fmi) for fmi in (2, 3)}


def run(motor: Path, load: Path) -> np.ndarray:
    """Motor and load, joined by the motor's motion and the shaft's torque."""
    inputs = ["motor.u", "motor.T_shaft", "load.theta_m", "load.omega_m"]
    reads = ["motor.theta_m", "motor.omega_m", "load.T_shaft", "load.theta_l"]
    wires = [(1, 2, 1.0, 0.0), (2, 0, 1.0, 0.0), (3, 1, 1.0, 0.0)]
    box = CoupledFmus(LoadRequest({"motor": str(motor), "load": str(load)}, inputs, reads, wires=wires))
    table = np.hstack([TABLE, np.zeros((len(TABLE), 3))])
    job = Run({"load.alpha": 0.02}, table)
    return box.run(job, Batch(0.0, 1e-3, [job]))


def test_both_versions_and_a_mix_have_the_same_bits(halves: dict[int, dict[str, Path]]) -> None:
    expected = run(halves[2]["MotorHalf"], halves[2]["LoadHalf"])
    assert np.ptp(expected, axis=0).min() > 0.0
    for motor, load in ((3, 3), (2, 3), (3, 2)):
        assert run(halves[motor]["MotorHalf"], halves[load]["LoadHalf"]).tobytes() == expected.tobytes()


def box_of(path: Path, read: str = "time") -> CoupledFmus:
    return CoupledFmus(LoadRequest({"": str(path)}, [], [read]))


@pytest.mark.parametrize(
    ("macros", "expected"),
    [
        (("ENDS_AT=0.1",), r"box: fmi3DoStep at t = 0\.1 s asked for the end of the run"),
        (("RETURNS_EARLY",), "box: fmi3DoStep at t = 0 s must do a whole step, for no events are taken"),
        (("FAILS_AT=0.1", "FAILS_WITH=fmi3Error"), r"box: fmi3DoStep at t = 0\.1 s returned Error: the solver failed"),
    ],
)
def test_a_step_that_does_not_end_as_asked_is_an_error(tmp_path: Path, macros: tuple[str, ...], expected: str) -> None:
    job = Run({}, np.zeros((20, 0)))
    with pytest.raises(SlaveError, match=expected):
        box_of(build_typed3_fmu(tmp_path, *macros)).run(job, Batch(0.0, 0.01, [job]))


def test_what_the_loop_cannot_call_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FmuError, match="must be of 64 bits and no part of an array"):
        box_of(build_typed3_fmu(tmp_path), "g")
    with pytest.raises(FmuError, match="must be of 64 bits and no part of an array"):
        box_of(build_typed3_fmu(tmp_path), "y[1]")
    with pytest.raises(FmuError, match=r"its clocks \(tick\) tick in event mode, which is not used here"):
        box_of(build_ball(tmp_path), "x")
