"""Stages on a terminal: the time left is there from the start, follows what is reported, and never goes below zero."""

import io

import pytest
from rich.console import Console

from orchestrator.commands import _stages
from orchestrator.commands._stages import Stages, diagnosis_seconds


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_the_time_left_is_known_from_the_start_and_follows_the_shares(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [100.0]
    monkeypatch.setattr(_stages.time, "monotonic", lambda: now[0])
    stages = Stages(io.StringIO())
    stages.begin("preparing", 60.0)
    assert stages.time_left() == 60.0
    now[0] = 110.0
    assert stages.time_left() == 50.0
    stages.at("a quarter", 0.25)
    assert stages.time_left() == pytest.approx(30.0)
    stages.at("as before", 0.0)
    now[0] = 200.0
    assert stages.time_left() == 0.0
    stages.begin("anew", 5.0)
    assert stages.time_left() == 5.0


def test_a_terminal_shows_stage_and_time_left() -> None:
    terminal = Terminal()
    with Stages(terminal) as stages:
        stages.begin("fitting", 61.0)
        stages._live.refresh()  # type: ignore[union-attr]
    assert "fitting" in terminal.getvalue()
    assert "about 1:01 left" in terminal.getvalue() or "about 1:00 left" in terminal.getvalue()


def test_nothing_is_written_where_nobody_looks() -> None:
    pipe = io.StringIO()
    with Stages(pipe) as stages:
        stages.begin("fitting", 10.0)
        stages.at("fitted", 0.5)
    assert pipe.getvalue() == ""


def test_a_diagnosis_is_expected_to_take_no_longer_beyond_the_rows_that_it_looks_at() -> None:
    assert diagnosis_seconds(2000) < diagnosis_seconds(4000)
    assert diagnosis_seconds(10_000) == diagnosis_seconds(1_000_000)


def test_a_long_stage_stays_on_one_line_of_a_narrow_terminal() -> None:
    stages = Stages(io.StringIO())
    stages.begin("fitted without coulomb_friction@motor, directional_friction@motor and others", 61.0)
    console = Console(file=io.StringIO(), width=80)
    assert len(console.render_lines(stages._line())) == 1
    console.print(stages._line())
    assert "…" in console.file.getvalue()
    assert "left" in console.file.getvalue()
