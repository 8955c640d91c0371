"""Model exchange of the native plant, integrated by CVode, against its own co-simulation and against located events."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from orchestrator.building.compilers import find_compiler
from pyfmu_sources.drivetrain import drivetrain
from pyfmu_sources.drivetrain.equations import parameters
from tests.support.model_exchange import END, STEP, event_times, first_time, request, stepped_and_exchanged

pytestmark = pytest.mark.skipif(find_compiler(here=True) is None, reason="no C compiler")

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
def plant(build_native: Callable[..., dict[str, Path]]) -> Path:
    return build_native(["Drivetrain"])["Drivetrain"]


@pytest.mark.parametrize("name", CASES)
def test_the_motion_is_that_of_the_cosimulation(plant: Path, name: str) -> None:
    stepped, integrated = stepped_and_exchanged(plant, CASES[name], OUTPUTS)
    assert len(integrated) == len(stepped) == round(END / STEP) + 1
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

    def reached(h: float) -> bool:
        return touched(*drivetrain.advance(x, mode, p, request(n), 0.0, h, drivetrain.prepare(p, h)), x)

    assert event_times(plant, CASES[model])[0] == pytest.approx(n * STEP + first_time(reached), abs=1e-9)


def touched(x: tuple[float, ...], mode: tuple[int, int, int], before: tuple[float, ...]) -> bool:
    """Tell whether the teeth touch, or have bounced: only an impact takes closing speed away."""
    rate, rate_before = x[1] / 3.984 - x[3], before[1] / 3.984 - before[3]
    return mode[0] != 0 or rate < 0.5 * rate_before
