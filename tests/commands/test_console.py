"""Tables on a terminal: side by side where their words fit, else a list; lines end between words."""

import re
import sys

import pytest

from orchestrator.cli import main
from orchestrator.commands._console import print_blocks, print_table

COLUMNS = ("tool", "version", "wall [s]", "times ours", "note")
ROWS = [["ours", "0.2.0", "1.25", "1", ""], ["another-tool-of-others", "10.11.12", "12.5", "10", "needs an own Python"]]


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch):
    def of(width: int) -> None:
        for stream in (sys.stdout, sys.stderr):
            monkeypatch.setattr(stream, "isatty", lambda: True, raising=False)
        monkeypatch.setenv("COLUMNS", str(width))

    return of


def test_a_table_that_fits_is_a_table(terminal, capsys: pytest.CaptureFixture[str]) -> None:
    terminal(80)
    print_table("Tools", COLUMNS, ROWS)
    told = re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out)
    assert "┃" in told
    assert max(len(line.rstrip()) for line in told.splitlines()) <= 80


def test_one_that_does_not_is_a_list_of_named_values(terminal, capsys: pytest.CaptureFixture[str]) -> None:
    terminal(50)
    print_table("Tools", COLUMNS, ROWS)
    lines = capsys.readouterr().out.splitlines()
    assert lines[:4] == ["Tools", "tool ours", "  version     0.2.0", "  wall [s]    1.25"]
    assert "tool another-tool-of-others" in lines
    assert "  note        needs an own Python" in lines
    assert max(len(line) for line in lines) <= 50


def test_no_number_is_broken_where_all_fit(terminal, capsys: pytest.CaptureFixture[str]) -> None:
    terminal(80)
    columns = ("actual [rad]", "noise [rad]", "S [rad]", "estimate [rad]", "interval [rad]", "error [rad]", "error [%]")
    row = ["0.02", "0.0001", "97.9593", "0.020004066", "0.019998006 .. 0.020010074", "4.07e-06", "0.0203"]
    print_table("Sweep", columns, [row])
    told = re.sub(r"\x1b\[[0-9;]*m", "", capsys.readouterr().out)
    assert all(word in told for cell in row for word in cell.split())
    assert "┃" in told
    assert max(len(line.rstrip()) for line in told.splitlines()) <= 80


def test_what_is_folded_stays_below_its_own_beginning(terminal, capsys: pytest.CaptureFixture[str]) -> None:
    terminal(30)
    print_blocks(["    how sure: " + "very " * 10])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 2
    assert all(line.startswith("      very") for line in lines[1:])


def test_lines_end_between_words_on_a_terminal_only(terminal, capsys: pytest.CaptureFixture[str]) -> None:
    print_blocks(["one two three " * 10])
    assert capsys.readouterr().out.count("\n") == 1
    terminal(40)
    print_blocks(["one two three " * 10])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 2
    assert all(len(line) <= 40 for line in lines)


def test_errors_end_between_words_on_a_terminal_only(terminal, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["estimate", "a_long_name_of_a_record.csv", "--model", "no.toml", "--method", "ekf"]
    assert main(words) == 2
    whole = capsys.readouterr().err
    assert whole.count("\n") == 1
    terminal(40)
    assert main(words) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) > 1
    assert all(len(line) <= 40 or " " not in line.strip() for line in lines)
    assert " ".join(line.strip() for line in lines) == whole.strip()
    with pytest.raises(SystemExit):
        main(["sweep", "--sizes"])
    assert all(len(line) <= 40 for line in capsys.readouterr().err.splitlines())
