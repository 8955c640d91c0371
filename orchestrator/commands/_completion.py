"""The option that prints a script with which a shell completes commands, options and files."""

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

SHELLS = ("bash", "zsh", "tcsh")
MISSING = "shell completion needs the extra [completion]: pip install 'backlash-cosim[completion]'"


class PrintCompletion(argparse.Action):
    """Print the script for a shell, and end."""

    def __init__(self, build: Callable[[], argparse.ArgumentParser], **options: Any) -> None:
        super().__init__(**options)
        self.build = build

    def __call__(self, parser: argparse.ArgumentParser, _namespace: Any, values: Any, _option: Any = None) -> None:
        """Print the script of the parser with all commands."""
        try:
            import shtab
        except ImportError:
            parser.error(MISSING)
        whole = self.build()
        for action in _actions(whole):
            if action.type is Path:
                action.complete = shtab.DIRECTORY if action.metavar == "DIR" else shtab.FILE  # type: ignore[attr-defined]
        print(shtab.complete(whole, values))
        parser.exit(0)


def add_completion_argument(parser: argparse.ArgumentParser, build: Callable[[], argparse.ArgumentParser]) -> None:
    """Add the option; ``build`` makes the parser with the options of all commands."""
    text = f"print a completion script for a shell ({', '.join(SHELLS)})"
    options: dict[str, Any] = {"action": PrintCompletion, "build": build}
    parser.add_argument("--print-completion", choices=SHELLS, metavar="SHELL", help=text, **options)


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    for action in parser._actions:  # argparse has no public list of them
        if isinstance(action, argparse._SubParsersAction):
            for sub in action.choices.values():
                yield from _actions(sub)
        else:
            yield action
