"""Coarse runs: of equations that others have written, and beside the exact plant."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numba import njit

from orchestrator.plants.coarse_run import _coarse_runner, coarse_runner_of
from orchestrator.plants.known.drivetrain import PLANT as DRIVETRAIN
from orchestrator.plants.known.servo_axis import PLANT
from orchestrator.plants.learned import with_law
from orchestrator.plants.sample import is_usual
from orchestrator.shared.code_digest import digest_of


def test_equations_of_a_plant_may_make_arrays() -> None:
    stage = PLANT.stage()

    @njit(error_model="numpy")
    def by_an_array(x: Any, signs: Any, p: Any, u: float) -> Any:
        made = np.array([x[1], u])
        rate = stage.rates(x, signs, p, made[1])
        return (made[0], rate[1], rate[2], rate[3], rate[4], rate[5], rate[6], rate[7])

    other = replace(PLANT, stage=lambda: stage._replace(rates=by_an_array), _index={})
    p = PLANT.extend_values([entry.default for entry in PLANT.table])
    angles = [np.empty((50, 2)) for _ in range(2)]
    for plant, out in zip((PLANT, other), angles, strict=True):
        coarse_runner_of(plant, p)((0.0,) * 8, p, np.ones(50), np.ones(50), 0.0, 0.01, (1, 8), out)
    assert angles[0][-1, 0] != 0.0
    assert np.array_equal(*angles)


@pytest.mark.parametrize("plant", [DRIVETRAIN, PLANT, with_law(DRIVETRAIN), with_law(PLANT)], ids=lambda p: p.name)
def test_machine_code_of_a_run_is_kept(plant) -> None:
    for usual in (True, False):
        assert digest_of(_coarse_runner(plant, usual)) is not None
    assert digest_of(plant.runner()) is not None


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
    coarse_runner_of(DRIVETRAIN, p)((0.0,) * 8, p, u, u, 0.0, 0.005, (1, 8), coarse)
    DRIVETRAIN.runner()((0.0,) * 9, DRIVETRAIN.fmu_values(p), u, u, 0.0, 0.005, exact)
    without = drivetrain(**{"effects.coulomb_friction.motor.torque": 0.0, "c": changed.get("c", 1.0)})
    DRIVETRAIN.runner()((0.0,) * 9, DRIVETRAIN.fmu_values(without), u, u, 0.0, 0.005, plain)
    assert np.max(np.abs(exact - plain)) > 0.01
    assert np.max(np.abs(exact - coarse)) < near


def test_equations_without_what_few_models_have_are_the_same_to_the_last_bit() -> None:
    rng, p, angles = np.random.default_rng(3), drivetrain(), []
    early, late = rng.normal(0.0, 20.0, (2, 400))
    for usual in (True, False):
        out = np.empty((400, 2))
        _coarse_runner(DRIVETRAIN, usual)((0.1,) * 8, p, early, late, 3e-4, 1e-3, (2, 16), out)
        angles.append(out)
    assert np.ptp(angles[0][:, 1]) > 0.01
    assert np.array_equal(*angles)


@pytest.mark.parametrize("name", DRIVETRAIN.seldom)
def test_a_model_that_has_one_of_them_runs_whole_equations(name: str) -> None:
    assert is_usual(DRIVETRAIN, drivetrain())
    assert not is_usual(DRIVETRAIN, drivetrain(**{name: 0.25}))
