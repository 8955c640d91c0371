"""A reader that goes away early loses what is printed, never a result."""

import json
import subprocess
import sys
from pathlib import Path


def test_a_closed_pipe_loses_no_result_and_is_no_failure(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "orchestrator", "regulator", "--out", str(tmp_path / "regulator")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    process.stdout.close()  # before the first line: every line that is printed finds no reader
    _, said = process.communicate()
    assert (process.returncode, said) == (0, "")
    assert json.loads((tmp_path / "regulator" / "regulator.json").read_text())["results"]
    assert (tmp_path / "regulator" / "report.html").exists()
