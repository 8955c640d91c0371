"""The worked examples of docs/extending.md, carried out on copies of the sources."""

import re
from pathlib import Path

import pytest

from tests.support import axis_record
from tests.support.c_fmu import have_compiler
from tests.support.copies import ROOT, copy_project, run_in_copy

PROGRAM = """
from pathlib import Path
from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.diagnosis.selection.outcome import Grade
from orchestrator.records.model_file import read_model
from pyfmu_sources.axis import axis_equations as axis
from tests.support.axis_record import axis_record

p = axis.DEFAULTS._replace(J=1.04, b=1.95, fan_coefficient=0.2)
found = diagnose(axis_record(p, 3, "fan"), read_model(Path("model.toml")))
effect = found.effects[0]
off = abs(effect.parameters["coefficient"].value - 0.2)
print(found.verdict, effect.name, off < 0.005, len(found.graded(Grade.LIKELY)))
"""
# A drivetrain with such a fan, and its torque balances without and with the effect.
BALANCE = """
import numpy as np
from orchestrator.diagnosis.data.signals import prepare_signals
from orchestrator.diagnosis.model.interface import ModelPoint
from orchestrator.diagnosis.model.torque_balance import TorqueBalance
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.records.model_file import default_model
from orchestrator.records.record import record_from_columns
from pyfmu_sources.drivetrain import drivetrain
from pyfmu_sources.drivetrain.equations import DEFAULTS

h, rng = 0.005, np.random.default_rng(3)
time = h * np.arange(1800)
u, speeds = np.repeat(rng.uniform(-40.0, 40.0, 60), 30), []
for size in (0.0, 0.4):
    p = DEFAULTS._replace(fan_coefficient=size)
    x, table, angles = drivetrain.consistent_start((0.0,) * 8, p), drivetrain.prepare(p, h), []
    mode = drivetrain.initial_mode(x, p)
    for torque in u:
        angles.append((x[0], x[2]))
        x, mode = drivetrain.advance(x, mode, p, float(torque), 0.0, h, table)
    speeds.append(x[3])
theta = np.array(angles) + 1e-7 * rng.standard_normal((len(u), 2))
columns = {"time": time, "u": u, "theta_m": theta[:, 0], "theta_l": theta[:, 1]}
settings = DiagnosisSettings()
signals = prepare_signals(record_from_columns(columns, "fan"), None, settings.band, True)
balance = TorqueBalance(default_model(), signals, settings.balance)
point = ModelPoint.nominal(balance.parameters)
without, fan = (
    np.sqrt(np.mean((balance.residual(at) * balance.active) ** 2))
    for at in (point, point.with_effect("fan@load", (0.4,)))
)
print(abs(speeds[1] - speeds[0]) > 0.1, without > 10.0 * fan, without, fan)
"""

# Both plants in quick air, in communication steps from 1 to 100 ms, against scipy and against the shortest.
STEPS = """
import numpy as np
from scipy.integrate import solve_ivp
from pyfmu_sources.axis import axis_equations, servo_axis
from pyfmu_sources.drivetrain import drivetrain, equations

p = axis_equations.DEFAULTS._replace(fan_coefficient=50.0)
want = solve_ivp(lambda t, y: [y[1], 300.0 - y[1] - 50.0 * y[1] ** 3], (0.0, 0.3), [0.0, 30.0], method="DOP853",
                 rtol=1e-12, atol=1e-13).y[:, -1]
ends = []
for h in (1e-3, 5e-3, 0.02, 0.05, 0.1):
    x, mode = servo_axis.start(0.0, 30.0, 0.0, p), 1
    for n in range(round(0.3 / h)):
        x, mode = servo_axis.advance(x, mode, p, 300.0, 0.0, h)
    ends.append(x[:2])
print(np.abs(np.array(ends) - want).max() < 1e-6 * np.abs(want).max())
p, ends = equations.DEFAULTS._replace(fan_coefficient=50.0, alpha=0.01), []
for h in (1e-3, 5e-3, 0.02, 0.05, 0.1):
    x, table = drivetrain.consistent_start((0.0, 20.0, 0.0, 5.0, 100.0, 0.0, 0.0, 0.0), p), drivetrain.prepare(p, h)
    mode = drivetrain.initial_mode(x, p)
    for n in range(round(0.3 / h)):
        x, mode = drivetrain.advance(x, mode, p, 300.0, 0.0, h, table)
    ends.append(x[:5])
print(np.ptp(ends, axis=0).max() < 1e-6 * np.abs(ends).max() and abs(ends[0][3]) > 0.1)
"""

# A foreign FMU, a mass on a spring, whose record was made with such a fan; what is delivered reproduces the fit.
AROUND_AN_FMU = """
from pathlib import Path
import numpy as np
from orchestrator.api.diagnose import diagnose
from orchestrator.diagnosis.selection.outcome import Grade
from tests.support.box_fmu import DOMAINS, write_fmu, write_map

rng, h, parts, fan = np.random.default_rng(5), 0.01, 20, 0.05
u = np.repeat(rng.uniform(-9.0, 9.0, 40), 20)
x, v, rows = 0.0, 0.0, []
for torque in u:
    rows.append(x)
    for _ in range(parts):
        middle = v + 0.5 * h / parts * (torque - 20.0 * x - 0.8 * v - fan * v**3)
        place = x + 0.5 * h / parts * v
        x, v = x + h / parts * middle, v + h / parts * (torque - 20.0 * place - 0.8 * middle - fan * middle**3)
table = np.column_stack([h * np.arange(len(u)), u, np.array(rows) + 2e-4 * rng.standard_normal(len(u))])
np.savetxt("record.csv", table, delimiter=",", header="time [s],F [N],x [m]", comments="", fmt="%.9g")
found = diagnose("record.csv", write_fmu(Path("Spring.fmu"), DOMAINS[0]), write_map(Path("map.toml"), DOMAINS[0]))
size = found.effects[0].parameters["coefficient"]
names = [effect.name for effect in found.diagnosis.graded(Grade.LIKELY)]
print(found.verdict, ",".join(names), abs(size.value - fan) < 0.05 * fan, size.unit)
found.close()
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


def edits_between(start: str, stop: str) -> list[str]:
    page = (ROOT / "docs" / "extending.md").read_text()
    return re.findall(r"```python\n(.*?)```", page[page.index(start) : page.index(stop)], re.DOTALL)


@pytest.mark.slow
@pytest.mark.skipif(not have_compiler(), reason="no C compiler")
@pytest.mark.parametrize("whole", [False, pytest.param(True, marks=pytest.mark.night)], ids=["by day", "whole"])
def test_worked_example_adds_an_effect_to_every_plant_and_any_fmu(tmp_path: Path, whole: bool) -> None:
    copy_project(tmp_path)
    edits = edits_between("## Adding an effect", "### On which plants an effect acts")
    assert len(edits) == 6
    assert len({apply(edit, tmp_path) for edit in edits}) == 2
    assert sum("speed * speed * speed" in edit for edit in edits) == 1
    (tmp_path / "model.toml").write_text(axis_record.MODEL)
    found = run_in_copy(BALANCE, tmp_path).split()
    assert found[:2] == ["True", "True"], found
    if not whole:  # the equations, the translation and the torque balance of an effect
        return
    assert run_in_copy(STEPS, tmp_path).split() == ["True", "True"]
    assert run_in_copy(PROGRAM, tmp_path).split() == ["effects", "fan", "True", "1"]
    assert run_in_copy(AROUND_AN_FMU, tmp_path).split() == ["effects", "fan", "True", "N.s3/m3"]
