"""From a result directory to its page."""

from collections.abc import Callable
from pathlib import Path

from orchestrator.errors import OutputError, ScenarioError
from orchestrator.reporting.model import Report
from orchestrator.reporting.page import render
from orchestrator.reporting.pages import (
    calibrate,
    check,
    compensate,
    diagnose,
    estimate,
    generic,
    inspect,
    regulator,
    simulate,
    sweep,
    thesis,
)
from orchestrator.reporting.source import ResultDocument, load
from orchestrator.shared.output import write_whole
from orchestrator.shared.source_tree import import_masters

PAGE = "report.html"
COMMANDS = (
    "build", "check", "simulate", "sweep", "inspect", "estimate", "diagnose", "calibrate", "regulator", "compensate",
    "thesis", "ssp", "bench",
)  # fmt: skip


def _bench_page(source: ResultDocument) -> Report:
    """Return the benchmark's own page in a clone, the generic one where the package alone is installed."""
    try:
        page = import_masters("page")
    except ScenarioError:
        page = generic
    report: Report = page.build(source)
    return report


_BUILDERS: dict[str, Callable[[ResultDocument], Report]] = {
    "bench": _bench_page,
    "calibrate": calibrate.build,
    "check": check.build,
    "compensate": compensate.build,
    "diagnose": diagnose.build,
    "estimate": estimate.build,
    "inspect": inspect.build,
    "regulator": regulator.build,
    "simulate": simulate.build,
    "ssp": simulate.build,
    "sweep": sweep.build,
    "thesis": thesis.build,
}


def report_from_directory(directory: Path, command: str | None = None) -> Report:
    """Return the report of a result directory, from its ``COMMAND.json`` and the CSV files beside it."""
    if not directory.is_dir():
        raise ScenarioError(f"`directory` must be an existing folder, but {directory} is not", "directory")
    if command is not None and command not in COMMANDS:
        raise ScenarioError(f"`command` must be one of {', '.join(COMMANDS)}, but is {command!r}", "command")
    found = [name for name in COMMANDS if (directory / f"{name}.json").is_file()]
    if command is None and len(found) != 1:
        what = f"has those of {', '.join(found)}: choose with `command`" if found else "has none"
        raise ScenarioError(f"{directory} must hold the results of one command, but {what}", "command")
    source = load(directory, command or found[0])
    try:
        return _BUILDERS.get(source.command, generic.build)(source)
    except (KeyError, TypeError, AttributeError, IndexError, ValueError) as error:
        reason = f"{type(error).__name__}: {error}"
        raise ScenarioError(f"{directory / source.command}.json must hold results of this version ({reason})") from None


def write_report(directory: Path, command: str | None = None) -> Path:
    """Write ``report.html`` into a result directory, whole or not at all, and return its path."""
    page = render(report_from_directory(directory, command))
    path = directory / PAGE
    try:
        write_whole(path, page.encode("utf-8", "replace"))  # names in hostile archives
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror}") from None
    return path
