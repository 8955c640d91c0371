"""A plugin of pytest for :mod:`tools.mutants`: tests that run the changed function come first.

The first run of a room, of the unchanged code, notes which functions each test calls, and how long it takes. Quick
tests come before slow ones. Tests that call the code in a child process come after the others; none is left out.
"""

import json
import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest

# In the environment: limit of processor time [s]; a file of notes; where the change is, as `module:line`.
LIMIT, NOTES, PLACE = "MUTANT_LIMIT", "MUTANT_NOTES", "MUTANT_PLACE"
_tests: dict[str, dict[str, Any]] = {}
_spans: dict[CodeType, list[Any]] = {}


def pytest_configure() -> None:
    """End this process, not its children, when it has computed for too long."""
    signal.setitimer(signal.ITIMER_PROF, float(os.environ[LIMIT]))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Note what a test calls, where nothing is noted yet."""
    if PLACE in os.environ:
        return (yield)
    called: set[CodeType] = set()

    def note(frame: FrameType, event: str, argument: object) -> None:
        del argument
        if event == "call":
            called.add(frame.f_code)

    begun = time.monotonic()
    sys.setprofile(note)
    try:
        return (yield)
    finally:
        sys.setprofile(None)
        seconds = round(time.monotonic() - begun, 2)
        spans = [_spans.setdefault(code, _span(code)) for code in called if "orchestrator" in code.co_filename]
        _tests[item.nodeid] = {"seconds": seconds, "spans": [span for span in spans if span]}


def pytest_sessionfinish() -> None:
    """Write the notes."""
    if PLACE not in os.environ:
        Path(os.environ[NOTES]).write_text(json.dumps(_tests), encoding="utf-8")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests in order."""
    if PLACE not in os.environ:
        return
    module, _, number = os.environ[PLACE].rpartition(":")
    line = int(number)
    notes = json.loads(Path(os.environ[NOTES]).read_text(encoding="utf-8"))

    def order(item: pytest.Item) -> tuple[bool, bool, float]:
        test = notes.get(item.nodeid, {"seconds": 0.0, "spans": []})
        own = [(first, last) for name, first, last in test["spans"] if name == module]
        return not any(first <= line <= last for first, last in own), not own, test["seconds"]

    items.sort(key=order)


def _span(code: CodeType) -> list[Any]:
    """Return module, first and last line of a function; nothing for a module's own code."""
    if code.co_name == "<module>":
        return []
    lines = [line for _, _, line in code.co_lines() if line] or [code.co_firstlineno]
    return [os.path.relpath(code.co_filename), code.co_firstlineno, max(lines)]
