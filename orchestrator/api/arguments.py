"""The experiment that several workflows take."""

from orchestrator.errors import ScenarioError
from orchestrator.paired.experiment import BACKLASH_MODELS, EXPERIMENTS, Experiment, experiment_of
from orchestrator.paired.pair import with_settings


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
