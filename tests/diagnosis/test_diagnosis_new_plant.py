"""The plant of docs/extending.md, added to a copy of the sources as one module."""

import re
from pathlib import Path

import pytest

from tests.support.copies import ROOT, copy_project, run_in_copy

MODEL = """
fmu = "Pump"
[parameters.J]
value = 0.5
relative_uncertainty = 0.1
[parameters.b]
value = 0.2
relative_uncertainty = 0.1
"""
# The record comes from SciPy's integrator: J = 0.52, b = 0.19, and drag, which the model lacks.
PROGRAM = """
from pathlib import Path
import numpy as np
from scipy.integrate import solve_ivp
from orchestrator.diagnosis.diagnose import diagnose
from orchestrator.records.model_file import read_model
from orchestrator.records.record import record_from_columns

for drag in (0.0, 0.03):
    rng = np.random.default_rng(4)
    u = np.repeat(rng.uniform(-4.0, 4.0, 100), 10)
    x, angles = np.zeros(2), []
    for torque in u:
        angles.append(x[0])
        rates = lambda t, x: (x[1], (torque - 0.19 * x[1] - drag * abs(x[1]) * x[1]) / 0.52)
        x = solve_ivp(rates, (0.0, 0.01), x, rtol=1e-9, atol=1e-11).y[:, -1]
    angle = np.array(angles) + 1e-4 * rng.standard_normal(len(angles))
    record = record_from_columns({"time": 0.01 * np.arange(len(u)), "u": u, "theta_m": angle}, "pump")
    found = diagnose(record, read_model(Path("model.toml")))
    sizes = [effect.parameters["coefficient"].value for effect in found.effects]
    print(found.verdict, *(effect.name for effect in found.effects), *sizes)
    signal = found.test[0].signals[0]
    print(signal.final / signal.noise)
"""


@pytest.mark.slow
def test_a_plant_is_one_module(tmp_path: Path) -> None:
    copy_project(tmp_path)
    page = (ROOT / "docs" / "extending.md").read_text()
    (module,) = re.findall(r"```python\n(.*?)```", page[page.index("## Adding a plant") :], re.DOTALL)
    path, _, text = module.removeprefix("# ").partition("\n")
    assert not (tmp_path / path).exists()
    (tmp_path / path).write_text(text)
    (tmp_path / "model.toml").write_text(MODEL)
    plain, plain_misfit, dragged, dragged_misfit = run_in_copy(PROGRAM, tmp_path).splitlines()
    assert plain == "parameters"
    assert dragged.split()[:2] == ["effects", "quadratic_drag"]
    assert [float(value) for value in dragged.split()[2:]] == [pytest.approx(0.03, rel=0.01)]
    assert float(plain_misfit) < 1.5
    assert float(dragged_misfit) < 1.5
