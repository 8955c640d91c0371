"""Options that say which paired experiment is meant."""

import argparse

from orchestrator.errors import ScenarioError
from orchestrator.paired.experiment import BACKLASH_MODELS, EXPERIMENTS


def add_experiment_arguments(parser: argparse.ArgumentParser) -> None:
    """Add ``--experiment`` and ``--backlash-model``."""
    parser.add_argument(
        "--experiment", default="default", metavar="NAME", help=f"{' or '.join(EXPERIMENTS)} (default: %(default)s)"
    )
    text = f"model of the gap: {', '.join(BACKLASH_MODELS)} (default: %(default)s)"
    parser.add_argument("--backlash-model", default="dead_zone", metavar="MODEL", help=text)


def refuse_with_scenario(arguments: argparse.Namespace, defaults: dict[str, object]) -> None:
    """Refuse options of the pair that differ from their ``defaults``: beside ``--scenario`` they would do nothing."""
    for name, default in (defaults | {"experiment": "default", "backlash_model": "dead_zone"}).items():
        if getattr(arguments, name) != default:
            option = "--" + name.replace("_", "-")
            raise ScenarioError(f"`{option}` must be left out with `--scenario`, which it does not change")
