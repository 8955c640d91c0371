"""The command line: parses, dispatches to ``orchestrator.commands`` and turns errors into exit codes."""

import argparse
import importlib
import io
import sys
from collections.abc import Sequence
from pathlib import Path

from orchestrator import __version__
from orchestrator.commands._parser import Parser, one_line
from orchestrator.errors import InputError, OrchestratorError

COMMANDS = {
    "build": "build the FMUs into fmus/",
    "check": "check FMUs for FMI compliance",
    "simulate": "one paired run: table, CSV, plots",
    "sweep": "many sizes and seeds: the table of estimates, CSV, JSON, plots",
    "estimate": "the gap, with interval, from a measured record",
    "diagnose": "where a record and the model disagree, and which effect is missing",
    "thesis": "every published number beside the recomputed one",
    "ssp": "write the paired loops as an SSP file, or run any SSP file",
    "bench": "speed and accuracy as ratios measured in one run",
    "report": "rebuild the HTML report of a result directory",
}


def build_parser(command: str | None) -> argparse.ArgumentParser:
    """Return the parser; only the module of ``command`` is imported, so that start-up stays quick."""
    parser = Parser(prog="python -m orchestrator", description=importlib.import_module("orchestrator").__doc__)
    parser.add_argument("--version", action="version", version=__version__)
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, summary in COMMANDS.items():
        sub = subparsers.add_parser(name, help=summary, description=summary)
        if name != command:
            continue
        module = importlib.import_module(f"orchestrator.commands.{name}")
        module.add_arguments(sub)
        if name != "report":  # it writes into the directory that it is given
            sub.add_argument(
                "--out",
                type=Path,
                default=Path("results") / name,
                metavar="DIR",
                help="where results go (default: %(default)s)",
            )
        sub.set_defaults(run=module.run)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code: 0 done, 1 a check or a run found problems, 2 bad input."""
    words = list(sys.argv[1:] if argv is None else argv)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # names of any script, whatever the terminal's encoding
    command = next((w for w in words if not w.startswith("-")), None)
    arguments = build_parser(command).parse_args(words)
    try:
        return int(arguments.run(arguments))
    except InputError as error:
        sys.stderr.write(f"error: {one_line(str(error))}\n")
        return 2
    except OrchestratorError as error:
        sys.stderr.write(f"error: {one_line(str(error))}\n")
        return 1
    except KeyboardInterrupt as interruption:  # an engine's says what is kept and how to go on
        sys.stderr.write(f"interrupted: {interruption}\n" if str(interruption) else "interrupted\n")
        return 130
    except BrokenPipeError:
        return 1
