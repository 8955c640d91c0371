"""The MPC beside the other laws."""

import control
import numpy as np
import pytest

import orchestrator as oc
from orchestrator.control.loops import ControlTask
from orchestrator.control.machine import thesis_machine
from orchestrator.control.measures import least_time
from orchestrator.plants.design import DrivetrainValues, six_state_model
from orchestrator.records.model_file import read_model
from tests.support.c_fmu import have_compiler

pytest.importorskip("daqp")
from benchmarks.predictive_control import TOUCH, PredictiveLaw, PredictiveSlave, run_predictive

ALPHA = 0.02
AFTER = 10_000  # a sample behind the move


@pytest.fixture(params=[5e-3, 1.0], ids=["fast", "slow"])
def law(request):
    return PredictiveLaw(ControlTask(thesis_machine(read_model(None), ALPHA, request.param, 2.0), 0.1))


def at_rest(task, twist, angle=0.0):
    """An estimate at rest, with a twist and the load at an angle [rad]."""
    return np.array([task.nominal.i * (angle + twist), 0.0, angle, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("flank", [1.0, -1.0])
def test_on_a_flank_it_asks_for_what_the_lqr_asks_for(law, flank):
    task = law.task
    rest = at_rest(task, flank * (ALPHA + 1e-6), angle=task.height)
    still = law.request(AFTER, rest, flank, ALPHA)
    for n, size in ((0, 1e-3 * flank), (1, 1e-2), (2, -1e-4 * flank), (3, 1e-3), (5, 0.1)):
        moved = rest.copy()
        moved[n] += size
        gain = task.gains[min(n, 4)]
        change = law.request(AFTER, moved, flank, ALPHA) - still
        assert change / -size == pytest.approx(gain, rel=0.2)  # requests are held in blocks
    held = rest.copy()
    load = 33.0 * flank
    held[[0, 4, 5]] += [task.nominal.i * load / task.nominal.k, load, load / task.nominal.i]
    assert law.request(AFTER, held, flank, ALPHA) - still == pytest.approx(load / task.nominal.i, rel=1e-3)


def test_it_knows_the_move_ahead_and_the_torque_limit(law):
    task = law.task
    rest = at_rest(task, ALPHA + 1e-6)
    assert law.request(499, rest, 1.0, ALPHA) > 1.0
    far = at_rest(task, ALPHA + 1e-6, angle=1.0)
    assert law.request(AFTER, far, 1.0, ALPHA) == pytest.approx(-task.machine.torque_limit)


@pytest.mark.parametrize("flank", [1.0, -1.0])
def test_it_crosses_quickly_and_lands_softly(law, flank):
    task = law.task
    free = six_state_model(DrivetrainValues(tau=task.nominal.tau, k=0.0, c=0.0, b_m=0.0, b_l=0.0))
    sampled = control.c2d(control.ss(*free, 0), task.sample_time)
    A, B = sampled.A, sampled.B
    x = at_rest(task, -flank * ALPHA, angle=-0.25 * flank)
    samples = 0
    bound = least_time(task, task.impact_speed)
    while flank * (x[0] / task.nominal.i - x[2]) < ALPHA - TOUCH:
        request = law.request(0, x, flank, ALPHA)
        assert abs(request) <= 1.0001 * task.machine.torque_limit
        x = A @ x + B[:, 0] * request
        samples += 1
        assert samples * task.sample_time < 2.0 * bound
    assert samples * task.sample_time > 0.95 * bound
    assert 0.5 < flank * (x[1] / task.nominal.i - x[3]) / task.impact_speed < 1.4


def test_the_twist_is_zero_in_mid_gap(law):
    asked = []
    law.request = lambda *given: asked.append(given) or 7.0
    slave = PredictiveSlave("controller", law)
    given = {"theta_m_hat": 1.0, "theta_l_hat": 0.2, "offset_hat": 0.1, "alpha_hat": 0.03, "flank": -1.0}
    buffer = np.array(list(given.values()))
    slave.sends(list(given), buffer)()
    slave.do_step(0.004, 0.001)
    sample, x, flank, alpha = asked[0]
    assert (sample, flank, alpha) == (5, -1.0, 0.03)
    assert x == pytest.approx((1.0 - 0.1 * law.task.nominal.i, 0.0, 0.2, 0.0, 0.0, 0.0))
    assert slave.get(["u"]) == [7.0]


@pytest.mark.skipif(not have_compiler(), reason="Python FMUs take half a minute")
def test_it_stands_beside_the_other_laws():
    found = oc.compensate(plants=1)
    plain, shifted, _ = found.laws
    predictive = run_predictive(found.task, 1, 0)
    assert predictive.impact < 0.6 * shifted.impact
    assert predictive.error < 0.4 * plain.error
