"""The command line: parses, dispatches to ``orchestrator.commands`` and turns errors into exit codes."""

import argparse
import importlib
import logging
import sys
from collections.abc import Sequence
from pathlib import Path

from orchestrator.commands._completion import add_completion_argument
from orchestrator.commands._outcome import exit_code
from orchestrator.commands._parser import Parser, flags_of, word_unknown
from orchestrator.commands._progress_lines import add_progress_argument, choose_progress
from orchestrator.shared.version import __version__

PROGRAM = "backlash-cosim"
COMMANDS = {
    "build": "build the FMUs into fmus/",
    "check": "check FMUs for FMI compliance",
    "simulate": "run the pair of loops, or a scenario of FMUs",
    "sweep": "run many half-gaps, noise levels and seeds",
    "inspect": "read a log, and report what it can show",
    "estimate": "estimate the half-gap, with interval, from a measured record",
    "diagnose": "identify the effects that a model lacks, from a measured record",
    "calibrate": "fit parameters of any FMU to a measured record, with intervals",
    "regulator": "design an LQR, and predict the limit cycle that the gap causes",
    "compensate": "design a controller that crosses the gap softly, and test it on simulated plants",
    "ssp": "export the pair of loops as an SSP file, or run any SSP file",
    "workbench": "run the commands from the browser, on this machine only",
    "report": "rebuild the HTML report of a result directory",
}
OWN_PLACE = frozenset(
    {"build", "report"}
)  # FMUs have places of their own; a report's is the directory that it is given
PICTURED = frozenset({"simulate", "inspect", "estimate", "diagnose"})


def build_parser(command: str | None, every: bool = False) -> argparse.ArgumentParser:
    """Return the parser.

    Only the module of ``command`` is imported, so that start-up stays quick; with ``every``, those of all commands.
    """
    called = Path(sys.argv[0]).name  # the module itself when run by `python -m`
    program = PROGRAM if every or called == PROGRAM else "python -m orchestrator"
    parser = Parser(prog=program, description=importlib.import_module("orchestrator").__doc__)
    parser.add_argument("--version", action="version", version=__version__)
    add_completion_argument(parser, lambda: build_parser(None, every=True))
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, summary in COMMANDS.items():
        sub = subparsers.add_parser(name, help=summary, description=summary)
        if name != command and not every:
            continue
        module = importlib.import_module(f"orchestrator.commands.{name}")
        module.add_arguments(sub)
        add_progress_argument(sub)
        if name in PICTURED:
            text = f"draw the plots of the page into {name}.png too"
            sub.add_argument("--pictures", action="store_true", help=text)
        if name not in OWN_PLACE:
            sub.add_argument(
                "--out",
                type=Path,
                default=Path("results") / name,
                metavar="DIR",
                help="where results go (default: %(default)s)",
            )
        sub.set_defaults(run=module.run, flags=flags_of(sub) | getattr(module, "FLAGS", {}))
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code: 0 done, 1 a check or a run found problems, 2 bad input.

    Returns:
        The exit code; see ``exit_code`` for those after signals.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # a home that cannot be written is no news to the user
    command = next((w for w in words if not w.startswith("-")), None)
    parser = build_parser(command)
    arguments, rest = parser.parse_known_args(words)
    flags = vars(arguments).pop("flags")
    if rest:
        help_text = f"; see {parser.prog} {arguments.command} --help"
        parser.error(word_unknown(rest[0], arguments.command, flags) + help_text)
    choose_progress(vars(arguments).pop("progress"))
    return exit_code(lambda: arguments.run(arguments), flags)
