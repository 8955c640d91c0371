"""The program ``fmu-check``: the checks of FMUs alone, which needs few libraries."""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from orchestrator.checking.batch import check_fmus, find_fmus
from orchestrator.commands._check import (
    add_check_arguments,
    check_options,
    mend_fmus,
    read_arguments,
    verdicts_shown,
    write_reports,
)
from orchestrator.commands._outcome import exit_code
from orchestrator.commands._parser import Parser, flags_of
from orchestrator.commands._trust import note_missing_walls
from orchestrator.shared.version import __version__


def main(argv: Sequence[str] | None = None) -> int:
    """Check FMUs and return the exit code: 0 all are ok, 1 one fails, 2 bad input, 130 after Ctrl-C."""
    parser = Parser(prog="fmu-check", description="check FMUs for FMI compliance")
    parser.add_argument("--version", action="version", version=__version__)
    parser.add_argument("fmus", nargs="+", type=Path, metavar="FMU", help="FMUs, unpacked FMUs or folders with FMUs")
    add_check_arguments(parser)
    args = parser.parse_args(sys.argv[1:] if argv is None else argv)

    def run() -> int:
        paths = find_fmus(args.fmus)
        policy = read_arguments(args)
        paths = mend_fmus(args, paths)
        if not (args.static or args.trust):
            note_missing_walls()
        with verdicts_shown(len(paths)) as progress:
            verdicts = check_fmus(paths, replace(check_options(args), tell=progress.tell), policy, progress)
        write_reports(args, verdicts)
        return 0 if all(verdict.ok for verdict in verdicts) else 1

    return exit_code(run, flags_of(parser))
