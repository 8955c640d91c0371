"""``regulator``: gains of an LQR for a machine, and what its loop does at rest."""

import argparse
from pathlib import Path
from typing import Any

from orchestrator.api.records import read_model
from orchestrator.api.regulator import design_regulator
from orchestrator.building.starts import SAMPLE_TIME, STATE_WEIGHTS, TORQUE_WEIGHT
from orchestrator.commands._console import print_blocks
from orchestrator.commands._parser import numbers_of, options_for
from orchestrator.shared.output import stage_output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add machine, weights and timing."""
    parser.add_argument(
        "--model", type=Path, metavar="FILE.toml", help="model file of the machine (default: the thesis's drivetrain)"
    )
    weights = ",".join(f"{weight:g}" for weight in STATE_WEIGHTS)
    text = f"of theta_m, omega_m, theta_l, omega_l, T_m (default: {weights})"
    parser.add_argument("--state-weights", metavar="Q,Q,Q,Q,Q", help=text)
    parser.add_argument(
        "--torque-weight", type=float, default=TORQUE_WEIGHT, metavar="R", help="of the request (default: %(default)s)"
    )
    parser.add_argument("--gains", metavar="K,K,K,K,K", help="evaluate these gains instead of a design")
    parser.add_argument(
        "--sample-time", type=float, default=SAMPLE_TIME, metavar="S", help="sample time (default: %(default)s)"
    )
    parser.add_argument("--delay", type=int, default=0, metavar="N", help="samples of delay (default: %(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Design, print and write."""
    with stage_output(arguments.out) as folder:
        lists = {name: getattr(arguments, name) for name in ("state_weights", "gains")}
        given: dict[str, Any] = {name: numbers_of(f"--{name.replace('_', '-')}", text) for name, text in lists.items()}
        given["model"] = read_model(arguments.model)
        result = design_regulator(**options_for(design_regulator, arguments) | given)
        result.write(folder, arguments.out)
    print_blocks(result.blocks())
    print(f"Written to {arguments.out}: report.html, regulator.json, parameters.toml, loop.csv")
    return 0
