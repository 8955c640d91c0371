"""Arguments that several workflows take, checked."""

import math

from orchestrator.errors import ScenarioError
from orchestrator.paired.experiment import BACKLASH_MODELS, EXPERIMENTS, Experiment, experiment_of
from orchestrator.paired.pair import with_settings
from orchestrator.shared.numbers import exact_text


def choose_experiment(experiment: str | Experiment, backlash_model: str | None = None) -> Experiment:
    """Return the experiment that is meant."""
    if isinstance(experiment, str):
        if experiment not in EXPERIMENTS:
            known = ", ".join(EXPERIMENTS)
            raise ScenarioError(f"`experiment` must be one of {known}, but is {experiment!r}", "experiment")
        experiment = experiment_of(experiment)
    if backlash_model is not None and backlash_model not in BACKLASH_MODELS:
        known = ", ".join(BACKLASH_MODELS)
        raise ScenarioError(f"`backlash_model` must be one of {known}, but is {backlash_model!r}", "backlash_model")
    return with_settings(experiment, backlash_model=backlash_model)


def not_negative(name: str, value: float) -> float:
    """Return ``value``, a number that must be finite and not negative."""
    if not (math.isfinite(value) and value >= 0.0):
        raise ScenarioError(f"`{name}` must be finite and not negative, but is {value}", name)
    return value


def within(name: str, value: float, least: float, most: float) -> float:
    """Return ``value``, a number that must lie between two bounds."""
    if not least <= value <= most:
        raise ScenarioError(
            f"`{name}` must be between {exact_text(least)} and {exact_text(most)}, but is {value:g}", name
        )
    return value
