"""Weights of an LQR for a machine, searched so that its loop comes to rest in spite of the gap, with margins.

A weight is given by a bandwidth and a damping of the load: with ``M = J_m i + J_l/i`` the request that moves it by
``M (w^2 angle + 2 z w speed)`` costs as much as its error. Motor angle and speed have the shares that damp the
thesis's load best. Bandwidths go down from twice the load's own frequency against a held motor: the first loop
that rests, with margins, is the quickest one.
"""

import numpy as np

from orchestrator.control.machine import Machine
from orchestrator.control.standstill import forecast_rest, loop_margins
from orchestrator.errors import DesignError, ScenarioError
from orchestrator.plants.design import design_regulator, five_state_model

BANDWIDTHS = 2.0 * 0.7 ** np.arange(9)  # over the load's own frequency
DAMPINGS = (5.0, 3.0, 1.5)
SHARE_OF_ANGLE, SHARE_OF_SPEED, OF_TORQUE = 0.16, 0.03, 5.0  # of the motor's, geared, over the load's; of the drive's
LEAST_PHASE = 0.6  # rad
LEAST_GAIN = 1.5  # and its inverse
LEAST_DELAY = 2.0  # samples, beyond those that are told


def choose_weights(machine: Machine, sample_time: float) -> tuple[float, ...]:
    """Return weights of ``REGULATOR_STATES``, for a weight of 1 of the request, whose loop comes to rest.

    If none does, return those with the smallest limit cycle of the load.

    Raises:
        DesignError: no loop has margins.
    """
    v = machine.nominal
    model = five_state_model(v)
    inertia, own = v.J_m * v.i + v.J_l / v.i, float(np.sqrt(v.k / v.J_l))
    found: list[tuple[float, tuple[float, ...]]] = []
    for bandwidth in BANDWIDTHS * own:
        for damping in DAMPINGS:
            angle, speed = (inertia * bandwidth**2) ** 2, (2.0 * damping * inertia * bandwidth) ** 2
            shares = (SHARE_OF_ANGLE * angle / v.i**2, SHARE_OF_SPEED * speed / v.i**2, angle, speed, OF_TORQUE)
            weights = tuple(map(float, shares))
            try:
                gains = design_regulator(model, np.diag(weights), 1.0, sample_time).gains
                m = loop_margins(model, gains, sample_time)
                if m.phase < LEAST_PHASE or m.upper < LEAST_GAIN or m.lower > 1.0 / LEAST_GAIN:
                    continue
                if m.delay < (LEAST_DELAY + machine.delay(sample_time)) * sample_time:
                    continue
                forecast = forecast_rest(v, gains, sample_time)
            except (DesignError, ScenarioError):
                continue
            if not forecast.cycles:
                return weights
            found.append((forecast.load, weights))
    if not found:
        raise DesignError(
            f"{machine.source}: no LQR has the stability margins that the compensator needs at `sample_time` = "
            f"{sample_time:g} s: give a shorter sample time, or `state_weights`",
            "sample_time",
            "state_weights",
        )
    return min(found)[1]
