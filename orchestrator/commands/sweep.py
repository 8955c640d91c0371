"""``sweep``: many sizes, noise levels and seeds of the paired loops; or any scenario over any parameters."""

import argparse
import sys
from pathlib import Path

from orchestrator.commands._experiment import add_experiment_arguments, refuse_with_scenario
from orchestrator.commands._paired_sweep import run_paired_sweep
from orchestrator.commands._progress import DEFAULT_SAMPLES, add_engine_arguments
from orchestrator.commands._scenario_sweep import run_scenario_sweep


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what a sweep takes."""
    add_experiment_arguments(parser)
    parser.add_argument(
        "--sizes",
        default="random:20",
        metavar="SPEC",
        help="half-gaps [rad]: 0.01,0.02 or range:LOW:HIGH:N or logrange:LOW:HIGH:N or random:N (default: %(default)s)",
    )
    parser.add_argument("--noise", default="0,1e-4", metavar="LIST", help="encoder noise [rad] (default: %(default)s)")
    parser.add_argument(
        "--seeds", type=int, default=1, metavar="N", help="runs of each size and noise level (default: %(default)s)"
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="N", help="seed of random sizes and of all noise (default: %(default)s)"
    )
    parser.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="NAME=SPEC",
        help="vary a parameter too, such as plant.J_l=range:5.3:5.9:5, also list, logrange, random and sobol",
    )
    parser.add_argument("--scenario", type=Path, metavar="FILE", help="sweep this TOML scenario instead of the pair")
    parser.add_argument(
        "--samples",
        type=int,
        metavar="N",
        help=f"draws of what --vary makes random or sobol (default: {DEFAULT_SAMPLES})",
    )
    parser.add_argument("--parquet", action="store_true", help="write the table as Parquet too (extra [parquet])")
    add_engine_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the sweep, print the table, write the results; 1 when a case failed."""
    chosen = run_paired_sweep if arguments.scenario is None else run_scenario_sweep
    if arguments.scenario is not None:
        refuse_with_scenario(arguments, {"sizes": "random:20", "noise": "0,1e-4", "seeds": 1})
    failed = chosen(arguments)
    figures = ", estimates.png, errors.png, loops.png" if arguments.scenario is None else ""
    sys.stdout.write(f"Written to {arguments.out}: report.html, sweep.csv, sweep.json{figures}\n")
    return 1 if failed else 0
