"""Model exchange of the native plant, integrated by CVode, against its own co-simulation and against located events."""

from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu

from orchestrator.building.compilers import find_compiler
from orchestrator.building.native_build import ensure_native
from pyfmu_sources import drivetrain
from pyfmu_sources.drivetrain_parameters import parameters

pytestmark = pytest.mark.skipif(find_compiler(here=True) is None, reason="no C compiler")

STEP, END = 1e-2, 2.0
CASES = {
    "none": {"backlash_model": 1},
    "dead_zone": {"alpha": 0.02},
    "nordin": {"alpha": 0.02, "backlash_model": 3},
    "hysteresis": {"alpha": 0.02, "backlash_model": 4},
    "rigid_impact": {"alpha": 0.02, "backlash_model": 5, "restitution": 0.3},
    "elastic_impact": {"alpha": 0.02, "backlash_model": 6},
    "stick_slip": {
        "alpha": 0.02,
        "effects.coulomb_friction.motor.torque": 2.0,
        "effects.coulomb_friction.load.torque": 4.0,
    },
    "stribeck_and_ripple": {
        "alpha": 0.02,
        "effects.stribeck_friction.load.coulomb": 2.0,
        "effects.stribeck_friction.load.breakaway": 3.0,
        "effects.torque_ripple.amplitude": 1.0,
    },
}
OUTPUTS = ["theta_m", "theta_l", "contact"]


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return ensure_native(["Drivetrain"], tmp_path_factory.mktemp("native"), here=True)["Drivetrain"]


def request(n: int) -> float:
    """The torque [N.m] held over step ``n``."""
    return float(20.0 * np.sign(np.sin(2.0 * np.pi * 0.9 * n * STEP + 0.3)))


def exchanged(plant: Path, start: dict[str, float], tolerance: float, events: bool) -> np.ndarray:
    """Integrate by CVode; inputs jump where the co-simulation's do."""
    rows = [(t, request(n)) for n in range(round(END / STEP)) for t in (n * STEP, (n + 1) * STEP)]
    signals = np.array(rows, dtype=[("time", float), ("u", float)])
    return simulate_fmu(
        str(plant),
        fmi_type="ModelExchange",
        solver="CVode",
        stop_time=END,
        output_interval=STEP,
        relative_tolerance=tolerance,
        start_values=start,
        input=signals,
        output=OUTPUTS,
        record_events=events,
    )


@pytest.mark.parametrize("name", CASES)
def test_the_motion_is_that_of_the_cosimulation(plant: Path, name: str) -> None:
    count = round(END / STEP)
    held = np.array([(n * STEP, request(n)) for n in range(count)], dtype=[("time", float), ("u", float)])
    stepped = simulate_fmu(
        str(plant),
        fmi_type="CoSimulation",
        stop_time=END,
        step_size=STEP,
        output_interval=STEP,
        start_values=CASES[name],
        input=held,
        output=OUTPUTS,
    )
    integrated = exchanged(plant, CASES[name], 1e-12, events=False)
    assert len(integrated) == len(stepped) == count + 1
    assert np.count_nonzero(np.diff(stepped["contact"])) >= 1
    assert np.max(np.abs(integrated["theta_l"] - stepped["theta_l"])) < 1e-6
    assert np.max(np.abs(integrated["theta_m"] - stepped["theta_m"])) < 1e-6
    assert np.array_equal(integrated["contact"], stepped["contact"])


@pytest.mark.parametrize(("model", "number"), [("dead_zone", 1.0), ("rigid_impact", 4.0), ("nordin", 2.0)])
def test_events_are_met_at_their_time(plant: Path, model: str, number: float) -> None:
    """The first contact, against the time found by halving a step of the exact linear solution."""
    p = parameters(alpha=0.02, backlash_model=number, restitution=0.3)
    start = (0.0,) * 8
    x = drivetrain.consistent_start(start, p)
    mode = drivetrain.initial_mode(x, p)
    n = 0
    while True:
        after, mode_after = drivetrain.advance(x, mode, p, request(n), 0.0, STEP, drivetrain.prepare(p, STEP))
        if touched(after, mode_after, x):
            break
        x, mode, n = after, mode_after, n + 1
    low, high = 0.0, STEP
    while high - low > 1e-13:
        middle = 0.5 * (low + high)
        after, mode_after = drivetrain.advance(x, mode, p, request(n), 0.0, middle, drivetrain.prepare(p, middle))
        low, high = (low, middle) if touched(after, mode_after, x) else (middle, high)
    rows = exchanged(plant, CASES[model], 1e-12, events=True)
    doubled = rows["time"][1:][np.diff(rows["time"]) == 0.0]
    inside = [t for t in doubled if abs(t / STEP - round(t / STEP)) > 1e-6]
    assert inside[0] == pytest.approx(n * STEP + high, abs=1e-9)


def touched(x: tuple[float, ...], mode: tuple[int, int, int], before: tuple[float, ...]) -> bool:
    """Tell whether the teeth touch, or have bounced: only an impact takes closing speed away."""
    rate, rate_before = x[1] / 3.984 - x[3], before[1] / 3.984 - before[3]
    return mode[0] != 0 or rate < 0.5 * rate_before
