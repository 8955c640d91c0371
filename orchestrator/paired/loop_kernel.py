"""One closed loop of plant, estimator and controller in one function, without FMI: a kernel.

Calibration needs thousands of runs. The order at each communication point is that of the master: plant, estimator,
controller.
"""

from typing import Annotated, Any

from orchestrator.building.translation.kernel_arrays import Reals
from orchestrator.building.translation.kinds import REAL, ArrayKind
from pyfmu_sources.controllers.lqr import control
from pyfmu_sources.drivetrain.drivetrain import advance, consistent_start, initial_mode, prepare
from pyfmu_sources.drivetrain.equations import COUNT, DrivetrainParameters
from pyfmu_sources.estimators.kalman import Vector6, update

__all__ = ["run_loop"]

Gains = Annotated[Any, ArrayKind(REAL, (5,))]
Transition = Annotated[Any, ArrayKind(REAL, (6, 6))]
Input = Annotated[Any, ArrayKind(REAL, (6,))]
Correction = Annotated[Any, ArrayKind(REAL, (6, 2))]
Weights = Annotated[Any, ArrayKind(REAL, (3,))]
Signals = Annotated[Any, ArrayKind(REAL, (None, 7))]


def run_loop(
    parameters: Reals, h: float, reference: Reals, reference_speed: Reals, error_m: Reals, error_l: Reals,
    gains: Gains, transition: Transition, by_input: Input, correction: Correction, weights: Weights, i: float,
    compliance: float, u_max: float, out: Signals,
) -> None:  # fmt: skip
    """Run one loop from rest.

    Args:
        parameters: (n,) of the drivetrain, in the order of its table.
        h: communication step [s].
        reference: (n,) wanted load angle [rad].
        reference_speed: (n,) wanted load speed [rad/s].
        error_m: (n,) of the motor's encoder [rad].
        error_l: (n,) of the load's encoder [rad].
        gains: (5,) of the controller.
        transition: (6, 6) of the estimator over a step.
        by_input: (6,) of the estimator.
        correction: (6, 2) of the estimator.
        weights: (3,) of the estimator.
        i: turns of the motor for one of the load.
        compliance: of the shaft [rad/(N.m)].
        u_max: torque limit [N.m].
        out: (n, 7) filled with theta_m, theta_l, theta_l_hat, u, contact, T_m, T_l_hat.
    """
    p = DrivetrainParameters._make(parameters[n] for n in range(COUNT))
    A = tuple(tuple(transition[r, c] for c in range(6)) for r in range(6))
    B = tuple(by_input[r] for r in range(6))
    L = tuple(tuple(correction[r, c] for c in range(2)) for r in range(6))
    K = tuple(gains[n] for n in range(5))
    weight = (weights[0], weights[1], weights[2])
    x = consistent_start((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), p)
    table = prepare(p, h)
    mode = initial_mode(x, p)
    estimate: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    u = 0.0
    for n in range(len(reference)):
        if n > 0:
            x, mode = advance(x, mode, p, u, 0.0, h, table)
            theta_m, theta_l = x[0] + error_m[n], x[2] + error_l[n]
            estimate, _, _, _ = update(estimate, u, theta_m, theta_l, A, B, L, weight)  # type: ignore[arg-type]
        u = control(reference[n], reference_speed[n], estimate, K, i, compliance, u_max)
        out[n, 0], out[n, 1], out[n, 2], out[n, 3] = x[0], x[2], estimate[2], u
        out[n, 4], out[n, 5], out[n, 6] = float(mode[0]), x[4], estimate[4]
