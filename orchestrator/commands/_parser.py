"""A parser of command lines whose complaints read like all others: "`--alpha` must ..., but is ...", on one line."""

import argparse
import difflib
import inspect
import math
import re
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NoReturn

from orchestrator.commands._lines import fold
from orchestrator.errors import ScenarioError
from orchestrator.plain_text import plain_text, shorten

LARGEST_WHOLE_NUMBER = 10**18
_NUMBERS = re.compile(r"-\.?\d")  # begins a value and no option: argparse's own knows neither 1e-3 nor lists
# What argparse says of an argument, and how that is said here.
_REWORDED = (
    (
        r"invalid choice: (.*) \(choose from (.*)\)",
        lambda m: f"must be one of {m[2].replace(chr(39), '')}, but is {m[1]}",
    ),
    (r"expected (one|at least one) arguments?", lambda m: "must be followed by a value, but is not"),
    (r"ignored explicit argument (.*)", lambda m: f"must be given without a value, but has {m[1]}"),
)


class Parser(argparse.ArgumentParser):
    """A parser of which ``type=int``, ``float`` and ``Path`` take finite numbers and paths that are not empty."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self._negative_number_matcher = _NUMBERS  # argparse has no public way
        readers: tuple[tuple[type, Callable[[str], object]], ...] = ((int, _whole), (float, number), (Path, _path))
        for kind, reader in readers:
            self.register("type", kind, reader)

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and where help is, unless the message says so, and exit with 2."""
        text = shorten(plain_text(_word_message(message)))
        text += "" if " --help" in message else f"; see {self.prog} --help"
        self.exit(2, fold(f"error: {text}", sys.stderr) + "\n")


def _whole(text: str) -> int:
    """Return a whole number of a size that everything can handle."""
    try:
        value = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a whole number, but is {text!r}") from None
    if abs(value) > LARGEST_WHOLE_NUMBER:
        raise argparse.ArgumentTypeError(f"must be a whole number of at most 18 digits, but is {text!r}")
    return value


def number(text: str) -> float:
    """Return a finite number."""
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"must be a number, but is {text!r}") from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"must be finite, but is {text!r}")
    return value


def _path(text: str) -> Path:
    """Return a path; an empty one, which would mean the working directory, is a mistake of a script."""
    if not text:
        raise argparse.ArgumentTypeError("must be a path, but is empty")
    return Path(text)


def flags_of(parser: argparse.ArgumentParser) -> dict[str, str]:
    """Return what the command line calls each argument, by its name in Python."""
    actions = parser._actions  # argparse has no public list of them
    return {a.dest: a.option_strings[-1] if a.option_strings else str(a.metavar or a.dest) for a in actions}


def numbers_of(flag: str, text: str | None) -> tuple[float, ...] | None:
    """Return the numbers of a list with commas."""
    try:
        return None if text is None else tuple(float(word) for word in text.split(","))
    except ValueError:
        raise ScenarioError(f"`{flag}` must be numbers separated by commas, but is {text!r}") from None


def options_for(function: Callable[..., Any], args: argparse.Namespace) -> dict[str, Any]:
    """Return the options that a function has arguments for, by their names."""
    known = inspect.signature(function).parameters
    return {name: value for name, value in vars(args).items() if name in known}


def word_unknown(word: str, command: str, flags: Mapping[str, str]) -> str:
    """Return the complaint about a word that a command does not take: the option that is meant, and where help is."""
    if not word.startswith("-"):
        takers = [f": say `{flags[name]} {word}`" for name in ("scenario", "model") if name in flags]
        one_log = "record" in flags and not word.endswith(".toml")
        cure = f": run `{command}` once for each log" if one_log else "".join(takers[:1])
        return f"`{word}` must be left out of `{command}`, but is given{cure}"
    option = word.partition("=")[0]
    near = difflib.get_close_matches(option, [flag for flag in flags.values() if flag.startswith("--")], 1)
    meant = f": perhaps `{near[0]}`" if near else ""
    return f"`{option}` must be an option of `{command}`, but is none{meant}"


def word_error(error: BaseException, flags: Mapping[str, str]) -> str:
    """Return an error's text in which the arguments that it speaks of have their names of the command line."""
    text = str(error)
    for name in getattr(error, "arguments", ()):
        text = text.replace(f"`{name}`", f"`{flags.get(name, name)}`")
    return text


def _word_message(message: str) -> str:
    named = re.fullmatch(r"argument (.+?): (.*)", message, re.DOTALL)
    if named is None:
        return re.sub(r"^the following arguments are required: (.*)", r"`\1` must be given, but is not", message)
    name, complaint = named.groups()
    for pattern, reworded in _REWORDED:
        match = re.fullmatch(pattern, complaint, re.DOTALL)
        if match is not None:
            complaint = reworded(match)
    return f"`{name}` {complaint}"
