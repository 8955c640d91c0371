"""The sampled-data loop of plant, estimator and controller in one function, without FMI.

Compiled, it serves calibration, which needs thousands of runs; as plain Python, it is the floor below which no
co-simulation of the same slaves can get. The order at each communication point is that of the master: plant,
estimator, controller.
"""

from typing import Any

from .drivetrain import Mode, Parameters, State, Table, advance
from .kalman import Gain, Matrix6, Vector6, update
from .lqr import Gains, control


def run_loop(
    plant: tuple[State, Mode, Parameters, Table, float],
    reference: Any,
    reference_speed: Any,
    error_m: Any,
    error_l: Any,
    gains: Gains,
    estimator: tuple[Matrix6, Vector6, Gain, tuple[float, float, float]],
    limits: tuple[float, float, float],
    out: Any,
) -> None:
    """Run one loop and fill ``out``.

    Args:
        plant: state, mode, parameters, table and step [s] of the drivetrain.
        reference: wanted load angle [rad] at each of the n communication points.
        reference_speed: wanted load speed [rad/s].
        error_m: error [rad] of the motor's encoder.
        error_l: error [rad] of the load's encoder.
        limits: gear ratio, compliance of the shaft [rad/(N.m)], torque limit [N.m].
        out: array of shape (n, 7), filled with theta_m, theta_l, theta_l_hat, u, contact, T_m, T_l_hat.
    """
    x, mode, p, table, h = plant
    A, B, L, weight = estimator
    i, compliance, u_max = limits
    estimate = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    u = 0.0
    for n in range(len(reference)):
        if n > 0:
            x, mode = advance(x, mode, p, u, 0.0, h, table)
            estimate, _m, _l, _d2 = update(estimate, u, x[0] + error_m[n], x[2] + error_l[n], A, B, L, weight)
        u = control(reference[n], reference_speed[n], estimate, gains, i, compliance, u_max)
        out[n, 0] = x[0]
        out[n, 1] = x[2]
        out[n, 2] = estimate[2]
        out[n, 3] = u
        out[n, 4] = mode[0]
        out[n, 5] = x[4]
        out[n, 6] = estimate[4]
