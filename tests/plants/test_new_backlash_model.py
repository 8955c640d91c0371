"""A backlash model is one row of traits: soft teeth, on their own stiffness and free to pull, added to a copy."""

from pathlib import Path

from tests.support.copies import copy_project, run_in_copy

ROW = """    BacklashModel(
        "soft_teeth", "Elastic teeth on a rigid shaft", plain_when_closed=False, own_contact=True, predicted=True
    ),
"""
# The equations, the FMU's enumeration, the command line, the paired loop and the diagnosis all take it from the row.
PROGRAM = """
from dataclasses import replace
import numpy as np
from scipy.integrate import solve_ivp
from orchestrator.paired.experiment import BACKLASH_MODELS, Experiment
from orchestrator.records.model_file import default_model
from orchestrator.diagnosis.data.records import check_model
from pyfmu_sources.laws import backlash_models as models
from pyfmu_sources.drivetrain import contact
from pyfmu_sources.drivetrain import drivetrain
from pyfmu_sources.drivetrain import equations as dt
from pyfmu_sources.adapters.model_xml import ENUMERATIONS

number = models.BACKLASH_MODELS.index("soft_teeth")
print(number, ENUMERATIONS["BacklashModel"][-1][0], BACKLASH_MODELS[-1])
print(Experiment(backlash_model="soft_teeth").backlash_model)
model = default_model()
chosen = replace(model.parameters["backlash_model"], value=float(number))
check_model(replace(model, parameters={**model.parameters, "backlash_model": chosen}))
p = dt.parameters(backlash_model=float(number), alpha=0.01, contact_stiffness=800.0, contact_damping=2.0)
x = contact.consistent_start((0.0,) * 8, p)
mode, whole, h, I = drivetrain.initial_mode(x, p), drivetrain.prepare(p, 0.002), 0.002, 3.984
y, off = np.zeros(5), 0.0

def rates(t, y, u):
    twist = y[0] / I - y[2]
    deep = np.sign(twist) * max(abs(twist) - 0.01, 0.0)
    torque = 800.0 * deep + 2.0 * (y[1] / I - y[3]) if deep else 0.0
    return (y[1], (y[4] - 0.1 * y[1] - torque / I) / 0.4, y[3], (torque - y[3]) / 5.6, u - y[4])

for n in range(400):
    u = 30.0 if (n // 100) % 2 == 0 else -30.0
    x, mode = drivetrain.advance(x, mode, p, u, 0.0, h, whole)
    y = solve_ivp(rates, (0.0, h), y, args=(u,), rtol=1e-9, atol=1e-12, max_step=2e-4).y[:, -1]
    off = max(off, abs(x[2] - y[2]))
print(off < 1e-6, abs(y[2]) > 0.01)
"""


def test_a_backlash_model_is_one_row(tmp_path: Path) -> None:
    copy_project(tmp_path)
    path = tmp_path / "pyfmu_sources" / "laws" / "backlash_models.py"
    text = path.read_text()
    end = text.index("    # Further models follow here")
    path.write_text(text[:end] + ROW + text[end:])
    found = run_in_copy(PROGRAM, tmp_path).splitlines()
    assert found == ["6 soft_teeth soft_teeth", "soft_teeth", "True True"]
