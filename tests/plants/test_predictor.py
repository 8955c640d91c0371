"""The predictor of a plant whose equations others have written."""

from dataclasses import replace
from typing import Any

import numpy as np
from numba import njit

from orchestrator.plants.description import CompiledEquations
from orchestrator.plants.known.servo_axis import PLANT
from orchestrator.plants.predictor import coarse_runner_of


def test_equations_of_a_plant_may_make_arrays() -> None:
    friction, rates, presliding = PLANT.stage()

    @njit(error_model="numpy")
    def by_an_array(x: Any, signs: Any, p: Any, u: float) -> Any:
        made = np.array([x[1], u])
        rate = rates(x, signs, p, made[1])
        return (made[0], rate[1], rate[2], rate[3], rate[4], rate[5], rate[6], rate[7])

    other = replace(PLANT, stage=lambda: CompiledEquations(friction, by_an_array, presliding), _index={})
    p = PLANT.extended([entry.default for entry in PLANT.table])
    angles = [np.empty((50, 2)) for _ in range(2)]
    for plant, out in zip((PLANT, other), angles, strict=True):
        coarse_runner_of(plant, p)((0.0,) * 8, p, np.ones(50), np.ones(50), 0.0, 0.01, (1, 8), out)
    assert angles[0][-1, 0] != 0.0
    assert np.array_equal(*angles)
