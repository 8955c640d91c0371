"""The examples of the pages on sweeps and reports run as they stand there."""

import csv
import os
import re
import subprocess
import sys
from pathlib import Path

from tests.support.waiting import HANGS

ROOT = Path(__file__).resolve().parents[2]


def example(page):
    return re.search(r"^```python\n(.*?)^```", (ROOT / "docs" / page).read_text(), re.MULTILINE | re.DOTALL)[1]


def run(code, folder):
    environment = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{folder}"}
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=HANGS,
        check=False,
    )


def test_the_sweep_in_the_docs_runs(tmp_path, fmus):
    (tmp_path / "my_sweep.py").write_text(example("sweeps.md"))
    (tmp_path / "out").mkdir()
    done = run("import my_sweep; my_sweep.main()", tmp_path)
    assert done.returncode == 0, done.stderr
    rows = list(csv.DictReader((tmp_path / "out" / "sweep.csv").read_text().splitlines()))
    assert [r["status"] for r in rows] == ["done"] * 6
    tight, loose = (float(rows[i]["angle"]) for i in (0, 1))
    assert 0.0 < loose < tight


def test_the_report_in_the_docs_renders(tmp_path):
    done = run(example("reports.md") + "\nprint(len(page))", tmp_path)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 10_000


def test_work_in_the_main_program_is_refused_with_the_reason(tmp_path):
    (tmp_path / "my_sweep.py").write_text(example("sweeps.md"))
    done = run("exec(open('my_sweep.py').read()); main()", tmp_path)
    assert "must be in a module that workers can import" in done.stderr
    assert not (tmp_path / "out").exists()
