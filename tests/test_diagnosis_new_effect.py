"""The worked example of docs/diagnosis.md, carried out on a copy of the sources."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PROGRAM = """
import numpy as np
from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.model_file import read_model
from orchestrator.record import record_from_columns
from pathlib import Path
from pyfmu_sources import servo_axis as axis

rng = np.random.default_rng(3)
p = list(axis.DEFAULTS)
p[axis.P_J], p[axis.P_B], p[axis.P_CABLE] = 1.04, 1.95, 3.0
p = tuple(p)
u = np.repeat(rng.uniform(-8.0, 8.0, 100), 16)
x, mode, y = (0.0, 0.0, 0.0), 0, []
for value in u:
    y.append(x[0])
    x, mode = axis.advance(x, mode, p, float(value), 0.0, 0.005)
y = np.array(y) + 1e-4 * rng.standard_normal(len(y))
record = record_from_columns({"time": 0.005 * np.arange(len(u)), "u": u, "theta_m": y}, "cable")
found = diagnose(record, read_model(Path("model.toml")))
effect = found.effects[0]
print(found.verdict, effect.name, abs(effect.parameters["stiffness"].value - 3.0) < 0.05, len(found.effects))
"""
MODEL = """
fmu = "ServoAxis"
[parameters.J]
value = 1.0
relative_uncertainty = 0.1
[parameters.b]
value = 2.0
relative_uncertainty = 0.1
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
    for package in ("orchestrator", "pyfmu_sources"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    page = (ROOT / "docs" / "diagnosis.md").read_text()
    edits = re.findall(r"```python\n(.*?)```", page[page.index("## Adding an effect") :], re.DOTALL)
    assert len(edits) == 6
    for edit in edits:
        apply(edit, tmp_path)
    (tmp_path / "model.toml").write_text(MODEL)
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr[-2000:]
    assert run.stdout.split() == ["effects", "cable_chain", "True", "1"]
