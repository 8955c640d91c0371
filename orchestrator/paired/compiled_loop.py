"""One closed loop in machine code: the same plant, filter and control law as in the FMUs, in the same order.

Calibration needs thousands of runs. A test holds this loop to the co-simulated one.
"""

from dataclasses import dataclass

import numpy as np

from orchestrator.building.translation.kernels import Kernels
from orchestrator.paired.experiment import Experiment
from orchestrator.plants.design import KalmanFilter
from orchestrator.shared.arrays import Array
from pyfmu_sources.drivetrain.equations import parameters
from pyfmu_sources.laws.backlash_models import BACKLASH_MODELS

COLUMNS = ("theta_m", "theta_l", "theta_l_hat", "u", "contact", "T_m", "T_l_hat")
LOOP = Kernels("orchestrator.paired.loop_kernel", checked=True)


@dataclass(frozen=True)
class CompiledLoop:
    """The parts of a run that do not depend on size or seed."""

    experiment: Experiment
    reference: Array
    reference_speed: Array
    gains: tuple[float, ...]
    estimator: KalmanFilter

    def run(self, alpha: float, errors: tuple[Array, Array]) -> Array:
        """Return the signals ``COLUMNS``, shape (steps + 1, 7), of a loop whose half-gap is ``alpha`` [rad].

        ``alpha``: half-gap [rad]; ``errors``: errors [rad] of both encoders, each of shape (steps + 1,).
        """
        e, S = self.experiment, self.estimator.S_inverse
        out = np.empty((len(self.reference), len(COLUMNS)))
        LOOP.run_loop(
            _plant_parameters(e, alpha), e.sample_time, self.reference, self.reference_speed, *errors, self.gains,
            self.estimator.A, np.ravel(self.estimator.B), self.estimator.L, (S[0, 0], S[0, 1], S[1, 1]), e.values.i,
            1.0 / e.values.k, e.torque_limit, out,
        )  # fmt: skip
        return out


def _plant_parameters(experiment: Experiment, alpha: float) -> tuple[float, ...]:
    """Return the plant's flat parameter tuple for a half-gap ``alpha`` [rad]."""
    v = experiment.values
    return parameters(
        J_m=v.J_m, J_l=v.J_l, k=v.k, c=v.c, b_m=v.b_m, b_l=v.b_l, i=v.i, tau=v.tau, alpha=alpha,
        backlash_model=float(BACKLASH_MODELS.index(experiment.backlash_model)) if alpha else 0.0,
    )  # fmt: skip


def make_loop(experiment: Experiment) -> CompiledLoop:
    """Return the loop of ``experiment``, designed and ready to run."""
    reference, speed = experiment.reference()
    return CompiledLoop(experiment, reference, speed, experiment.regulator().gains, experiment.estimator())
