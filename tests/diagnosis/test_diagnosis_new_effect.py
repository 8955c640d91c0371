"""The worked example of docs/extending.md, carried out on a copy of the sources."""

import re
from pathlib import Path

import pytest

from tests.support import axis_record
from tests.support.copies import ROOT, copy_project, run_in_copy

PROGRAM = """
from pathlib import Path
from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.diagnosis.selection.outcome import Grade
from orchestrator.records.model_file import read_model
from pyfmu_sources import servo_axis_parameters as axis
from tests.support.axis_record import axis_record

p = axis.DEFAULTS._replace(J=1.04, b=1.95, fan_coefficient=0.2)
found = diagnose(axis_record(p, 3, "fan"), read_model(Path("model.toml")))
effect = found.effects[0]
off = abs(effect.parameters["coefficient"].value - 0.2)
print(found.verdict, effect.name, off < 0.005, len(found.graded(Grade.LIKELY)))
"""


def apply(edit: str, root: Path) -> Path:
    """Make one edit of the page, a line that says where, then what to insert; return the file."""
    head, _, text = edit.partition("\n")
    match = re.fullmatch(r'# (\S+): (at the end|after "(.*)")', head)
    assert match, head
    path = root / match[1]
    lines = path.read_text().splitlines(keepends=True)
    at = len(lines) if match[2] == "at the end" else 1 + next(n for n, line in enumerate(lines) if match[3] in line)
    lines.insert(at, text)
    path.write_text("".join(lines))
    return path


@pytest.mark.slow
def test_worked_example_adds_an_effect(tmp_path: Path) -> None:
    copy_project(tmp_path)
    page = (ROOT / "docs" / "extending.md").read_text()
    start, stop = page.index("## Adding an effect"), page.index("## Adding a plant")
    edits = re.findall(r"```python\n(.*?)```", page[start:stop], re.DOTALL)
    assert len(edits) == 5
    assert len({apply(edit, tmp_path) for edit in edits}) == 3
    (tmp_path / "model.toml").write_text(axis_record.MODEL)
    assert run_in_copy(PROGRAM, tmp_path).split() == ["effects", "fan", "True", "1"]
