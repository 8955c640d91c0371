"""The worked example of docs/diagnosis.md, carried out on a copy of the sources."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support import axis_record

ROOT = Path(__file__).resolve().parents[1]
PROGRAM = """
from pathlib import Path
from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.model_file import read_model
from pyfmu_sources import servo_axis as axis
from tests.support.axis_record import axis_record

p = list(axis.DEFAULTS)
p[axis.P_J], p[axis.P_B], p[axis.P_CABLE] = 1.04, 1.95, 3.0
found = diagnose(axis_record(p, 3, "cable"), read_model(Path("model.toml")))
effect = found.effects[0]
print(found.verdict, effect.name, abs(effect.parameters["stiffness"].value - 3.0) < 0.05, len(found.effects))
"""


def apply(edit: str, root: Path) -> None:
    """Make one edit of the page: a line that says where, then what to insert."""
    head, _, text = edit.partition("\n")
    match = re.fullmatch(r'# (\S+): (at the end|after "(.*)")', head)
    assert match, head
    path = root / match[1]
    lines = path.read_text().splitlines(keepends=True)
    at = len(lines) if match[2] == "at the end" else 1 + next(n for n, line in enumerate(lines) if match[3] in line)
    lines.insert(at, text)
    path.write_text("".join(lines))


@pytest.mark.slow
def test_worked_example_adds_an_effect(tmp_path: Path) -> None:
    for package in ("orchestrator", "pyfmu_sources", "tests/support"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    page = (ROOT / "docs" / "diagnosis.md").read_text()
    edits = re.findall(r"```python\n(.*?)```", page[page.index("## Adding an effect") :], re.DOTALL)
    assert len(edits) == 6
    for edit in edits:
        apply(edit, tmp_path)
    (tmp_path / "model.toml").write_text(axis_record.MODEL)
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr[-2000:]
    assert run.stdout.split() == ["effects", "cable_chain", "True", "1"]
