"""Effects along the measured motion, against the motion itself: free runs that go astray, and what takes them there."""

from types import SimpleNamespace

import numpy as np
import pytest

import orchestrator as oc
from orchestrator.diagnosis.blackbox.bank import BANK, BoxEffect, Surroundings
from orchestrator.diagnosis.blackbox.followed import answers, measured_motions
from orchestrator.diagnosis.blackbox.mapping import PortEntry
from orchestrator.diagnosis.blackbox.settings import BoxSettings
from orchestrator.diagnosis.blackbox.whitening import realised
from tests.support.box_fmu import DOMAINS, write_fmu
from tests.support.c_fmu import have_compiler

H, N, FINE, MASS, NOISE = 0.01, 800, 50, 2.0, 1e-4


def controlled(push):
    """Return force and position of a mass that a controller keeps on its way, against ``push(x, v)``."""
    x, v, u, rows = 0.0, 0.0, np.zeros(N), np.zeros(N)
    for k in range(N):
        rows[k] = x
        u[k] = 400.0 * (0.1 * np.sin(3.0 * k * H) + 0.04 * np.sin(11.0 * k * H) - x) - 40.0 * v
        for _ in range(FINE):
            a = (u[k] - push(x + 0.5 * v * H / FINE, v)) / MASS
            x, v = x + v * H / FINE + 0.5 * a * (H / FINE) ** 2, v + a * H / FINE
    return u, rows


def free(u):
    """Return the position of the mass under the force alone."""
    x, v, rows = 0.0, 0.0, np.zeros(N)
    for k in range(N):
        rows[k] = x
        x, v = x + v * H + 0.5 * u[k] / MASS * H * H, v + u[k] / MASS * H
    return rows


def problem_of(x):
    return SimpleNamespace(
        outputs=("x",), n=N, h=H, data=SimpleNamespace(outputs=x[:, None]), sign={"port": 1.0}, noise_places=[0],
        map=SimpleNamespace(ports={"port": PortEntry(input="F", position="x")}),
        runner=SimpleNamespace(inputs=("F",)), settings=BoxSettings(), drive=lambda places: np.ones(len(places)),
    )  # fmt: skip


def effect_of(name):
    return BoxEffect(BANK[name], "port", Surroundings(H, 1.0, 1.0, np.zeros(N)))


@pytest.mark.parametrize(
    ("name", "values", "push"),
    [
        ("spring", (120.0,), lambda x, v: 120.0 * x),
        ("ripple", (3.0, 1.0, 60.0), lambda x, v: 3.0 * np.sin(60.0 * x) + np.cos(60.0 * x)),
        ("quadratic_drag", (30.0,), lambda x, v: 30.0 * v * abs(v)),
        ("directional_friction", (20.0,), lambda x, v: 20.0 * abs(v)),
    ],
)
def test_what_an_effect_pushes_along_the_measured_motion_is_what_a_free_run_lacks(name, values, push):
    u, x = controlled(push)
    astray = x - free(u)
    assert np.max(np.abs(astray)) > 3.0 * np.std(x)
    impulses = ((np.arange(1, N // 2) - 0.5) * H * H / MASS / NOISE)[:, None, None]
    measured = x + NOISE * np.random.default_rng(2).standard_normal(N)
    problem = problem_of(measured)
    motion = measured_motions(problem)["port"]
    found = answers(problem, realised(impulses), motion, effect_of(name), np.array(values), N)
    assert np.max(np.abs(NOISE * found[:, 0] - astray)) < 0.05 * np.max(np.abs(astray))


def test_a_port_has_no_motion_where_its_position_is_not_measured():
    problem = problem_of(np.zeros(N))
    problem.outputs = ("y",)
    assert measured_motions(problem) == {}


@pytest.mark.skipif(not have_compiler(), reason="no C compiler")
def test_a_spring_beside_a_mass_that_a_controller_keeps_is_named(tmp_path):
    """The FMU's free run leaves the record by metres."""
    u, x = controlled(lambda x, v: 20.0 * x)
    x += NOISE * np.random.default_rng(4).standard_normal(N)
    record, map_path = tmp_path / "record.csv", tmp_path / "map.toml"
    np.savetxt(record, np.column_stack([np.arange(N) * H, u, x]), delimiter=",", header="time,F,x", comments="")
    map_path.write_text(
        """[inputs]
F = { hold = "zero" }
[outputs]
x = { noise = 1e-4 }
[parameters]
m = { value = 2.04, uncertainty = "5 %" }
k = { value = 0.0 }
c = { value = 0.0 }
[ports.mass]
input = "F"
position = "x"
"""
    )
    found = oc.diagnose(record, write_fmu(tmp_path / "Spring.fmu", DOMAINS[0]), map_path)
    found.close()
    assert [f.name for f in found.effects] == ["spring"]
    assert found.effects[0].estimates[0].value == pytest.approx(20.0, rel=0.01)
