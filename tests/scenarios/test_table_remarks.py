"""Tables that a run hardly uses, or that end before it: run as they are, with a word."""

from pathlib import Path

import numpy as np
import pytest

from orchestrator.api.simulate import simulate

TIMES = 0.01 * np.arange(101)  # s
HEAD = (
    'stop = 0.5\nrecord = ["plant.theta_m"]\n[master]\nstep = 1e-2\nalgorithm = "gauss_seidel"\n'
    '[instances.plant]\nfmu = "Drivetrain"\n[[sources]]\nto = "plant.u"\nkind = "table"\nfile = "t.csv"\ncolumn = "u"\n'
)


def remarks(folder: Path, times: np.ndarray, further: str = "", head: str = "time,u") -> list[str]:
    np.savetxt(folder / "t.csv", np.column_stack([times, np.sin(6.0 * TIMES)]), delimiter=",", header=head, comments="")
    (folder / "run.toml").write_text(HEAD + further)
    return [str(remark) for remark in simulate(folder / "run.toml").run.remarks]


@pytest.mark.parametrize("times", [TIMES, TIMES - 0.2, 0.5 * TIMES, 0.495 * TIMES])
def test_a_table_that_covers_the_run_needs_no_word(times: np.ndarray, tmp_path: Path) -> None:
    assert remarks(tmp_path, times) == []


def test_a_unit_in_the_file_needs_no_word(tmp_path: Path) -> None:
    assert remarks(tmp_path, 1000.0 * TIMES, head="time [ms],u") == []


@pytest.mark.parametrize("times", [1000.0 * TIMES, 1e6 * TIMES, TIMES - 3.0, TIMES + 1.7e9])
def test_a_table_of_another_time_is_told(times: np.ndarray, tmp_path: Path) -> None:
    said = remarks(tmp_path, times)
    assert len(said) == 1
    assert "of 101 rows within the run's 0 to 0.5 s: are its times in seconds?" in said[0]


@pytest.mark.parametrize("times", [TIMES + 0.1, 0.3 * TIMES, TIMES - 0.7])
def test_lines_that_end_within_the_run_are_told(times: np.ndarray, tmp_path: Path) -> None:
    said = remarks(tmp_path, times)
    assert len(said) == 1
    assert "plant.u: its table" in said[0]
    assert "does not cover the run's 0 to 0.5 s: outside, its end values hold" in said[0]


def test_steps_may_end_early(tmp_path: Path) -> None:
    assert remarks(tmp_path, 0.3 * TIMES, "hold = true\n") == []
