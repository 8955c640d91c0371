"""``simulate``: one paired run with its plots, or any scenario file."""

import argparse
from pathlib import Path

from orchestrator.api.pair import PairResult, run_pair
from orchestrator.api.shown import Result
from orchestrator.commands._console import print_blocks
from orchestrator.commands._experiment import add_experiment_arguments, refuse_with_scenario
from orchestrator.commands._parser import options_for
from orchestrator.commands._safety import add_safety_arguments, safety_of
from orchestrator.commands._trust import note
from orchestrator.shared.output import stage_output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what a run takes."""
    add_experiment_arguments(parser)
    parser.add_argument("--alpha", type=float, default=0.02, metavar="RAD", help="half-gap (default: %(default)s)")
    parser.add_argument("--noise", type=float, default=0.0, metavar="RAD", help="encoder noise (default: none)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the noise (default: %(default)s)")
    parser.add_argument("--scenario", type=Path, metavar="FILE", help="run this TOML scenario instead of the pair")
    add_safety_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run, print a table, write CSV, JSON and page."""
    if arguments.scenario is not None:
        refuse_with_scenario(arguments, {"alpha": 0.02, "noise": 0.0, "seed": 0})
    with stage_output(arguments.out, PairResult.replaces) as folder:
        result = _run(arguments)
        result.write(folder, arguments.out, pictures=arguments.pictures)
    print_blocks(result.blocks())
    picture = ", simulate.png" if arguments.pictures else ""
    print_blocks([f"Written to {arguments.out}: report.html, simulate.csv, simulate.json{picture}"])
    return 0


def _run(arguments: argparse.Namespace) -> Result:
    if arguments.scenario is not None:
        from orchestrator.api.simulate import simulate  # what reads scenarios, which a pair does without

        return simulate(arguments.scenario, safety=safety_of(arguments), tell=note)
    return run_pair(**options_for(run_pair, arguments))
