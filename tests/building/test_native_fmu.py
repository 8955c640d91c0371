"""Native FMUs against the Python FMUs of the same source: values to the last bit, statuses, messages, states."""

import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from orchestrator.building.build import ensure_built
from orchestrator.building.compilers import find_compiler
from orchestrator.building.sources import recipe_of
from pyfmu_sources.train.two_stage_train_slave import TwoStageTrain
from tests.support.native_bits import EFFECTS, MODELS, TRAIN, Comparison, drivetrain_values
from tests.support.native_pair import Driver, random_calls

pytestmark = pytest.mark.skipif(find_compiler(here=True) is None, reason="no C compiler")

NAMES = (
    "Drivetrain",
    "LqrController",
    "KalmanEstimator",
    "BacklashEstimator",
    "BacklashCompensator",
    "ServoAxis",
    "TwoStageTrain",
)


@pytest.fixture(scope="module")
def native(build_native: Callable[..., dict[str, Path]]) -> dict[str, Path]:
    return build_native(list(NAMES))


@pytest.mark.parametrize("seed", [0, *(pytest.param(n, marks=pytest.mark.night) for n in (1, 2, 3))])
@pytest.mark.parametrize("name", NAMES)
def test_random_calls_give_the_same_as_the_python_fmu(native: dict[str, Path], name: str, seed: int) -> None:
    python = ensure_built([name])[name]
    table = getattr(importlib.import_module(f"pyfmu_sources.{recipe_of(name).module}"), name).table
    count = 60 if name == "BacklashEstimator" else 300 if seed or name == "Drivetrain" else 120
    assert random_calls([Driver(python), Driver(native[name])], table, count, seed) > count // 10


def models_and_effects() -> list[Any]:
    """Every pair of a model and an effect; by day three models of each effect, so that all are met in turn."""
    pairs = [(model, effect) for effect in range(len(EFFECTS) + 1) for model in range(len(MODELS))]
    names = ["no effect", *EFFECTS]
    return [
        pytest.param(model + 1, names[effect], marks=[pytest.mark.night] if (model + effect) % 2 else [])
        for model, effect in pairs
    ]


@pytest.mark.parametrize(("model", "effect"), models_and_effects())
def test_every_bit_of_every_model_and_effect(native: dict[str, Path], model: int, effect: str) -> None:
    """A sample; ``python -m benchmarks.native_bits`` does a million."""
    comparison = Comparison(native["Drivetrain"], drivetrain_values(model, EFFECTS.get(effect, {})), seed=10 + model)
    for n in range(150):
        assert comparison.step(), f"{MODELS[model - 1]}, {effect}: step {n}"
    assert comparison.refused or comparison.taken > 130


@pytest.mark.parametrize("case", TRAIN)
def test_every_bit_of_two_stages(native: dict[str, Path], case: str) -> None:
    comparison = Comparison(native["TwoStageTrain"], TRAIN[case], 3, TwoStageTrain)
    for n in range(400):
        assert comparison.step(), f"{case}: step {n}"
    assert comparison.taken > 350


def test_a_difference_in_the_last_bit_is_seen(native: dict[str, Path]) -> None:
    comparison = Comparison(native["Drivetrain"], drivetrain_values(2, {}), seed=1)
    stiffness = 2
    p = comparison.python._p
    comparison.python._p = tuple(x * (1.0 + 2.0**-52) if n == stiffness else x for n, x in enumerate(p))
    assert not all(comparison.step() for _ in range(300))
