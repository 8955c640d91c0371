"""What the user sees of a run: a bar on a terminal, a line per minute in a pipe, options that are checked."""

import argparse
import io
import itertools

import pytest

from orchestrator.api.cases import RunOptions
from orchestrator.commands import _progress
from orchestrator.commands._progress import CaseProgress, add_engine_arguments, line
from orchestrator.engine import CaseLimits, LocalProcesses, Progress, choose_pool
from orchestrator.errors import ScenarioError


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_a_pipe_gets_one_line_a_minute(monkeypatch):
    clock = itertools.count(0.0, 10.0)
    monkeypatch.setattr(_progress.time, "monotonic", lambda: next(clock))
    stream = io.StringIO()
    with CaseProgress("sweep", stream) as progress:
        for done in range(1, 20):
            progress.update(Progress(done, 100, 2, 0))
    lines = stream.getvalue().splitlines()
    assert len(lines) == 3
    assert lines[0] == "sweep: 6 of 100 cases, 0.1 per second, 0:15:40 left, 2 failed"


def test_the_rate_does_not_count_what_an_earlier_run_has_done(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(_progress.time, "monotonic", lambda: now[0])
    stream = io.StringIO()
    progress = CaseProgress("sweep", stream)
    now[0] = 100.0
    progress.update(Progress(150, 200, 0, 100))
    assert stream.getvalue() == "sweep: 150 of 200 cases, 0.5 per second, 0:01:40 left, 0 failed\n"


def test_nothing_is_known_before_the_first_case():
    assert line(Progress(0, 5, 0, 0), 0.0) == "0 of 5 cases, 0.0 per second, 0 failed"


def test_a_terminal_gets_a_bar_with_counts_rate_and_failures():
    stream = Terminal()
    with CaseProgress("sweep", stream) as progress:
        progress.update(Progress(40, 100, 3, 0))
        progress._live.refresh()
    shown = stream.getvalue()
    assert "sweep: 40 of 100, " in shown
    assert "3 failed" in shown
    assert "/s" in shown
    assert "left" in shown


def options(*words):
    parser = argparse.ArgumentParser()
    add_engine_arguments(parser)
    chosen = parser.parse_args(words)
    limits = RunOptions(time_limit=chosen.time_limit, memory_limit=chosen.memory_limit).limits
    return choose_pool(chosen.workers, chosen.scheduler), limits


def test_options_become_a_pool_and_limits():
    assert options("--workers", "3", "--time-limit", "5", "--memory-limit", "100") == (
        LocalProcesses(3),
        CaseLimits(5.0, 100 * 1024**2),
    )
    assert options() == (LocalProcesses(), CaseLimits())


@pytest.mark.parametrize(
    "words", [["--workers", "0"], ["--time-limit", "0"], ["--time-limit", "nan"], ["--memory-limit", "-1"]]
)
def test_options_out_of_range_are_refused(words):
    with pytest.raises(ScenarioError, match="must"):
        options(*words)
