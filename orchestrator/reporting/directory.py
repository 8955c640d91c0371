"""From a result directory to its page."""

import importlib
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from orchestrator.errors import OutputError, ScenarioError
from orchestrator.reporting.model import Report
from orchestrator.reporting.page import render
from orchestrator.reporting.pages import generic
from orchestrator.reporting.source import load
from orchestrator.shared.output import write_whole

PAGE = "report.html"
COMMANDS = (
    "build", "check", "simulate", "sweep", "inspect", "estimate", "diagnose", "calibrate", "regulator", "compensate",
    "ssp",
)  # fmt: skip


def _page_of(command: str) -> Any:
    """Return the module of a command's page, or the generic one."""
    name = f"orchestrator.reporting.pages.{'simulate' if command == 'ssp' else command}"
    return generic if find_spec(name) is None else importlib.import_module(name)


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
        report: Report = _page_of(source.command).build(source)
        made = source.origin(*report.origin)
        return replace(report, about=source.about(), origin=made, downloads=source.downloads())
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
