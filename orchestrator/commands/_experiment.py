"""Options that say which paired experiment is meant."""

import argparse
import math

from orchestrator.errors import ScenarioError
from orchestrator.paired.experiment import BACKLASH_MODELS, EXPERIMENTS, Experiment, named_experiment
from orchestrator.paired.pair import with_settings


def add_experiment_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--experiment`` and ``--backlash-model``."""
    parser.add_argument(
        "--experiment", default="default", metavar="NAME", help=f"{' or '.join(EXPERIMENTS)} (default: %(default)s)"
    )
    parser.add_argument(
        "--backlash-model",
        default="dead_zone",
        metavar="MODEL",
        help=f"of the loop with a gap: {', '.join(BACKLASH_MODELS)} (default: %(default)s)",
    )


def chosen_experiment(arguments: argparse.Namespace) -> Experiment:
    """Return the experiment that the arguments name.

    Raises:
        ScenarioError: a name is unknown.
    """
    if arguments.experiment not in EXPERIMENTS:
        raise ScenarioError(f"`--experiment` must be one of {', '.join(EXPERIMENTS)}, but is {arguments.experiment!r}")
    if arguments.backlash_model not in BACKLASH_MODELS:
        known = ", ".join(BACKLASH_MODELS)
        raise ScenarioError(f"`--backlash-model` must be one of {known}, but is {arguments.backlash_model!r}")
    return with_settings(named_experiment(arguments.experiment), backlash_model=arguments.backlash_model)


def refuse_with_scenario(arguments: argparse.Namespace, defaults: dict[str, object]) -> None:
    """Refuse options of the pair that differ from their ``defaults``: beside ``--scenario`` they would do nothing.

    Raises:
        ScenarioError: one does.
    """
    for name, default in (defaults | {"experiment": "default", "backlash_model": "dead_zone"}).items():
        if getattr(arguments, name) != default:
            option = "--" + name.replace("_", "-")
            raise ScenarioError(f"`{option}` must be left out with `--scenario`, which it does not change")


def require_not_negative(name: str, value: float) -> float:
    """Return ``value`` if it is finite and not negative.

    Raises:
        ScenarioError: it is not.
    """
    if not (math.isfinite(value) and value >= 0.0):
        raise ScenarioError(f"`{name}` must be finite and not negative, but is {value}")
    return value
