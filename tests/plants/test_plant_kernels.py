"""Kernels of the plants: plain Python and C give the same bits."""

from typing import Any

import numpy as np
import pytest

from orchestrator.building.translation.kernel_arrays import PlainArray, plain_array
from orchestrator.building.translation.kernels import Kernels
from orchestrator.plants.description import Plant
from orchestrator.plants.known.drivetrain import PLANT as DRIVETRAIN
from orchestrator.plants.known.servo_axis import PLANT as AXIS

N, H = 60, 2e-3
PLANTS = (DRIVETRAIN, AXIS)
SMOOTH = {"effects.torque_ripple.amplitude": 0.4, "effects.quadratic_drag.coefficient": 0.1, "tau": 0.01}
DRY = {"effects.coulomb_friction.motor.torque": 0.8, "effects.stribeck_friction.motor.breakaway": 0.5, "tau": 0.02}
GAP = {"alpha": 0.004, "effects.load_dependent_friction.motor.coefficient": 0.05, "c": 20.0}
STOPS = {"effects.end_stop.lower": -0.01, "effects.end_stop.upper": 0.01, "effects.rate_limit.rate": 200.0}
U = 20.0 * np.sin(0.3 * np.arange(N)) + 5.0 * np.cos(1.1 * np.arange(N))


def bits(kernels: Kernels, name: str, *arguments: Any) -> list[float]:
    """All numbers of the arrays that a kernel is given, after it ran in C, which plain Python must leave as well."""
    in_c = [a.copy() if isinstance(a, np.ndarray) else a for a in arguments]
    plain = [plain_array(a) if isinstance(a, np.ndarray) else a for a in arguments]
    getattr(kernels, name)(*in_c)
    getattr(kernels.python, name)(*plain)
    found = [n for a in in_c if isinstance(a, np.ndarray) for n in a.ravel().tolist()]
    assert found == [n for a in plain if isinstance(a, PlainArray) for n in a.tolist()]
    assert np.isfinite(found).all()
    return found


def values(plant: Plant, changed: dict[str, float]) -> np.ndarray:
    p = plant.extend_values([entry.default for entry in plant.table])
    for name, value in changed.items():
        if name in plant.names:
            p[plant.index(name)] = value
    return p


@pytest.mark.parametrize("plant", PLANTS, ids=["drivetrain", "axis"])
@pytest.mark.parametrize("changed", [SMOOTH, DRY, GAP, STOPS], ids=["smooth", "dry", "gap", "stops"])
def test_runs_and_balances_are_those_of_plain_python(plant: Plant, changed: dict[str, float]) -> None:
    time = H * np.arange(N)
    motion = np.column_stack([3 * np.sin(time), 3 * np.cos(time), 0.7 * np.sin(time), 0.7 * np.cos(time)])
    signs = np.sign(motion[:, [1, 3]])
    p, early = values(plant, changed), np.roll(U, 1)
    found = bits(plant.motion, "run_coarsely", np.zeros(8), p, early, U, 7e-4, H, 1, 8, np.empty((N, 2)))
    assert len(set(found)) > N
    for moves in (False, True):
        bits(plant.motion, "accelerate", motion, signs, p, H, moves, np.empty((N, 2)))
    if plant.shaft:
        bits(
            plant.motion, "accelerate_with_hidden_load", motion[:, :2].copy(), 1e-3, p, H, 2, signs[:, 0].copy(),
            np.empty((N, 2)), np.empty(N), np.empty(N),
        )  # fmt: skip


@pytest.mark.parametrize("plant", PLANTS, ids=["drivetrain", "axis"])
@pytest.mark.parametrize("changed", [SMOOTH, DRY, GAP, STOPS], ids=["smooth", "dry", "gap", "stops"])
def test_exact_runs_are_those_of_plain_python(plant: Plant, changed: dict[str, float]) -> None:
    own = np.array(plant.fmu_values(values(plant, changed)))
    kernels = Kernels(plant.kernel, checked=True)
    for first in (0.0, 7e-4):
        bits(kernels, "run", np.zeros(9), own, np.roll(U, 1), U, first, H, np.empty((N, 2)))


def test_slides_and_requests_are_those_of_plain_python() -> None:
    bits(DRIVETRAIN.motion, "slide_bristle", U, 7.0, np.empty(N))
    bits(Kernels("orchestrator.plants.kernels.requests"), "follow", U, 0.01, 300.0, H, np.empty(N), np.empty(N))
    rng = np.random.default_rng(1)
    bits(
        Kernels("orchestrator.plants.kernels.linear"), "repeat", rng.normal(size=3), 0.3 * rng.normal(size=(3, 3)),
        rng.normal(size=3), rng.normal(size=3), U, np.roll(U, 1), np.array([0, -1]), np.empty(3), np.empty((N, 2)),
    )  # fmt: skip
