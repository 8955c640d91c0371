"""A record of a ``ServoAxis`` under random steps of torque, made with the axis's own equations, and a model of it."""

from collections.abc import Sequence

import numpy as np

from orchestrator.records.record import Record, record_from_columns
from pyfmu_sources.axis import servo_axis as axis
from pyfmu_sources.axis.axis_equations import AxisParameters

MODEL = """
fmu = "ServoAxis"
[parameters.J]
value = 1.0
relative_uncertainty = 0.1
[parameters.b]
value = 2.0
relative_uncertainty = 0.1
"""


def axis_record(p: Sequence[float], seed: int, name: str, slowest: float = -8.0) -> Record:
    """Return 8 s at 200 Hz of an axis with parameters ``p``, its encoder with a noise of 0.1 mrad.

    Args:
        slowest: least torque of the steps [N.m], up to 8; above the friction the axis turns one way.
    """
    rng, values = np.random.default_rng(seed), AxisParameters._make(p)
    u = np.repeat(rng.uniform(slowest, 8.0, 100), 16)
    x, mode, y = axis.start(0.0, 0.0, 0.0, values), 0, []
    for value in u:
        y.append(x[0])
        x, mode = axis.advance(x, mode, values, float(value), 0.0, 0.005)
    angle = np.array(y) + 1e-4 * rng.standard_normal(len(y))
    return record_from_columns({"time": 0.005 * np.arange(len(u)), "u": u, "theta_m": angle}, name)
