"""``check``: whether FMUs comply with FMI and behave."""

import argparse
from pathlib import Path

import orchestrator
from orchestrator.api.check import check, find_fmus
from orchestrator.commands._check import add_check_arguments, mend_fmus, read_arguments, verdicts_shown, write_reports
from orchestrator.commands._parser import options_for
from orchestrator.commands._trust import note_missing_walls
from orchestrator.shared.output import stage_output


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command."""
    parser.add_argument(
        "fmus", nargs="*", type=Path, metavar="FMU", help="FMUs, unpacked FMUs or folders with FMUs (default: our own)"
    )
    add_check_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Check every FMU; 1 when any fails."""
    paths = find_fmus(args.fmus) if args.fmus else list(orchestrator.build().paths.values())
    policy = read_arguments(args)
    paths = mend_fmus(args, paths)
    if not (args.static or args.trust):
        note_missing_walls()
    with stage_output(args.out) as folder:
        with verdicts_shown(len(paths)) as progress:
            given = options_for(check, args) | {"fmus": paths, "policy": policy}
            result = check(**given, progress=progress, tell=progress.tell)
        result.write(folder, args.out)
        write_reports(args, result.verdicts)
    return 0 if result.ok else 1
