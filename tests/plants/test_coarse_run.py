"""Coarse runs beside the exact plant."""

import numpy as np
import pytest

from orchestrator.plants.known.drivetrain import PLANT as DRIVETRAIN


def drivetrain(**changed: float) -> np.ndarray:
    p = DRIVETRAIN.extend_values([entry.default for entry in DRIVETRAIN.table])
    for name, value in {"effects.coulomb_friction.motor.torque": 0.3, **changed}.items():
        p[DRIVETRAIN.index(name)] = value
    return p


# What is not smooth -> how far a coarse run may be from the exact one [rad].
SHARP = {
    "friction of the shaft's torque alone": (
        {"effects.load_dependent_friction.motor.coefficient": 0.05, "c": 0.0}, 2e-5),
    "end stops": ({"effects.end_stop.lower": -0.1, "effects.end_stop.upper": 0.1}, 6e-5),
    "backlash": ({"alpha": 0.005}, 1e-5),
}  # fmt: skip


@pytest.mark.parametrize("law", SHARP)
def test_a_coarse_run_follows_what_is_not_smooth(law: str) -> None:
    changed, near = SHARP[law]
    p, n = drivetrain(**{"effects.coulomb_friction.motor.torque": 0.0, **changed}), 400
    u = 20.0 * np.sin(0.05 * np.arange(n))
    plain, coarse, exact = (np.empty((n, 2)) for _ in range(3))
    DRIVETRAIN.motion.run_coarsely(np.zeros(8), p, u, u, 0.0, 0.005, 1, 8, coarse)
    DRIVETRAIN.run_exactly(np.zeros(9), DRIVETRAIN.fmu_values(p), u, u, 0.0, 0.005, exact)
    without = drivetrain(**{"effects.coulomb_friction.motor.torque": 0.0, "c": changed.get("c", 1.0)})
    DRIVETRAIN.run_exactly(np.zeros(9), DRIVETRAIN.fmu_values(without), u, u, 0.0, 0.005, plain)
    assert np.max(np.abs(exact - plain)) > 0.01
    assert np.max(np.abs(exact - coarse)) < near
