"""``compensate``: a controller that crosses a machine's gap softly, beside other laws on the same plants."""

import argparse
from pathlib import Path

from orchestrator.api.compensate import compensate
from orchestrator.building.starts import SAMPLE_TIME
from orchestrator.commands._console import print_blocks
from orchestrator.commands._parser import numbers_of, options_for
from orchestrator.commands._stages import Stages
from orchestrator.shared.output import stage_output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add machine, landing, plants and files."""
    text = "corrected.toml of `diagnose` or `estimate`, or estimate.json (default: the thesis's drivetrain)"
    parser.add_argument("--model", type=Path, metavar="FILE", help=text)
    for flag, unit, text in (
        ("--alpha", "RAD", "half-gap (default: the model's, else 0.02)"),
        ("--tau", "S", "without a model, time constant of the drive (default: 0.005)"),
        ("--impact-speed", "RAD/S", "speed at which the teeth meet (default: from the machine, without a model 0.1)"),
        ("--friction", "N.M", "without a model, dry friction at the load that no controller models (default: 2)"),
        ("--torque-limit", "N.M", "limit of the drive (default: the model's, else the record's largest request)"),
    ):
        parser.add_argument(flag, type=float, metavar=unit, help=text)
    parser.add_argument(
        "--state-weights", metavar="Q,Q,Q,Q,Q", help="weights of the LQR; the request has 1 (default: searched)"
    )
    parser.add_argument(
        "--sample-time", type=float, default=SAMPLE_TIME, metavar="S", help="sample time (default: %(default)s)"
    )
    parser.add_argument("--plants", type=int, metavar="N", help="number of plants (default: 100, without a model 5)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of all draws (default: %(default)s)")
    parser.add_argument("--native", action="store_true", help="write native FMUs, which need no Python at run time")
    parser.add_argument(
        "--fmi", type=int, choices=(2, 3), default=2, help="FMI version (default: 2); 3 means native FMUs"
    )
    parser.add_argument("--force", action="store_true", help="continue although the model cannot be trusted")


def run(arguments: argparse.Namespace) -> int:
    """Run all laws, print and write."""
    with stage_output(arguments.out) as folder, Stages() as stages:
        given = options_for(compensate, arguments)
        given["state_weights"] = numbers_of("--state-weights", arguments.state_weights)
        result = compensate(**given, progress=stages.counter("running the laws on the plants"))
        result.write(folder, arguments.out)
    print_blocks(result.blocks())
    print(
        f"Written to {arguments.out}: {', '.join(('report.html', 'compensate.json', 'traversals.csv', *result.files))}"
    )
    return 0
