"""``compensate``: plain LQR, shifted LQR, an MPC if wanted, and compensator of the gap on the same plants."""

import argparse

from orchestrator.api.compensate import compensate
from orchestrator.commands._console import print_blocks
from orchestrator.shared.output import stage_output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what describes the plants and the landing."""
    for flag, default, unit, text in (
        ("--alpha", 0.02, "RAD", "half-gap"),
        ("--tau", 5e-3, "S", "time constant of the drive"),
        ("--impact-speed", 0.1, "RAD/S", "speed at which the teeth shall meet"),
        ("--friction", 2.0, "N.M", "dry friction at the load, which no law knows"),
    ):
        parser.add_argument(flag, type=float, default=default, metavar=unit, help=f"{text} (default: %(default)s)")
    parser.add_argument("--plants", type=int, default=5, metavar="N", help="how many plants (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of plants and noise (default: %(default)s)")
    parser.add_argument("--mpc", action="store_true", help="a model predictive controller too (extra `mpc`)")


def run(arguments: argparse.Namespace) -> int:
    """Run all laws, print and write."""
    with stage_output(arguments.out) as folder:
        result = compensate(
            arguments.alpha,
            tau=arguments.tau,
            impact_speed=arguments.impact_speed,
            friction=arguments.friction,
            plants=arguments.plants,
            seed=arguments.seed,
            mpc=arguments.mpc,
        )
        result.write(folder, arguments.out)
    print_blocks(result.blocks())
    print(f"Written to {arguments.out}: report.html, compensate.json, traversals.csv")
    return 0
