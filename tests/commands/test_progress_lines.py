"""``--progress json``: lines that a program reads, and nothing else where a bar would be."""

import io
import json
import sys

import pytest

from orchestrator.commands import _progress_lines
from orchestrator.commands._console import say
from orchestrator.commands._progress import CaseProgress
from orchestrator.commands._progress_lines import ProgressLines, choose_progress
from orchestrator.commands._stages import Stages
from orchestrator.engine import Progress


@pytest.fixture(autouse=True)
def _as_before():
    yield
    choose_progress(None)


def lines_of(text: str) -> list[dict]:
    return [json.loads(line) for line in text.splitlines()]


def test_stages_tell_stage_share_and_time_left(capsys: pytest.CaptureFixture[str]) -> None:
    choose_progress("json")
    with Stages() as stages:
        stages.begin("preparing", 30.0)
        stages.at("fitting", 0.5)
        stages.at("fitting", 2.0)
    first, second = lines_of(capsys.readouterr().err)
    assert first == {"stage": "preparing", "share": 0.0, "left": 30.0}
    assert second["stage"] == "fitting"
    assert second["share"] == 0.5


def test_a_stage_is_told_again_after_a_while_and_a_share_is_at_most_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    choose_progress("json")
    now = [10.0]
    monkeypatch.setattr(_progress_lines.time, "monotonic", lambda: now[0])
    lines = ProgressLines()
    for share in (0.1, 0.2, 7.0):
        lines.tell("running", share, None)
        now[0] += 0.15
    assert [line["share"] for line in lines_of(capsys.readouterr().err)] == [0.1, 1.0]


def test_cases_and_words_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    choose_progress("json")
    with CaseProgress("sweep") as progress:
        progress.update(Progress(done=3, total=12, failed=0, resumed=0))
    say("reading the FMU")
    cases, words = lines_of(capsys.readouterr().err)
    assert cases["share"] == 0.25
    assert cases["left"] is not None
    assert words == {"stage": "reading the FMU", "share": None, "left": None}


def test_without_the_option_nothing_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    with Stages(io.StringIO()) as stages:
        stages.begin("preparing", 30.0)
    say("reading")
    assert capsys.readouterr().err == ""


def test_a_terminal_gets_lines_and_no_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    choose_progress("json")
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with Stages() as stages:
        stages.begin("preparing", 3.0)
    assert lines_of(terminal.getvalue()) == [{"stage": "preparing", "share": 0.0, "left": 3.0}]
