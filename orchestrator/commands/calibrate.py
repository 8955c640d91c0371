"""``calibrate``: the parameters of any FMU from a measured record, with intervals."""

import argparse
from pathlib import Path

from orchestrator.commands._console import print_blocks, say
from orchestrator.commands._reading import add_settings_argument
from orchestrator.commands._trust import note_missing_walls
from orchestrator.shared.output import stage_output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument("record", type=Path, metavar="DATA.csv", help="measured record")
    parser.add_argument("--fmu", type=Path, required=True, metavar="ANY.fmu", help="any FMU for co-simulation")
    parser.add_argument("--map", type=Path, required=True, metavar="MAP.toml", help="columns and uncertain parameters")
    add_settings_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Fit, print the parameters, write JSON and report."""
    from orchestrator.api.calibrate import calibrate  # seconds of libraries

    note_missing_walls()
    with stage_output(args.out) as folder:
        found = calibrate(args.record, args.fmu, args.map, settings=args.settings, progress=say)
        found.write(folder, args.out)
        print_blocks(found.blocks())
    print_blocks([f"Written to {args.out}: report.html, calibrate.json"])
    return 0
