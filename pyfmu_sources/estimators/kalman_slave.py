"""The FMU ``KalmanEstimator``: adapter from FMI to :mod:`kalman`."""

from __future__ import annotations

from typing import ClassVar

from ..adapters.controller_variables import ENCODERS, ESTIMATED, MEASURED
from ..adapters.fmu_variables import FmuVariable, Terminals
from ..adapters.sampled_slave import SampledSlave
from . import kalman
from .kalman import Gain, Matrix6, Vector6, Weight

U, THETA_M, THETA_L, FIRST_ESTIMATE = range(4)
INNOVATION_M, INNOVATION_L, INNOVATION_SQUARED, SAMPLE_TIME = range(FIRST_ESTIMATE + 6, FIRST_ESTIMATE + 10)
FIRST_START = SAMPLE_TIME + 1
FIRST_A = FIRST_START + 6
FIRST_B = FIRST_A + 36
FIRST_K = FIRST_B + 6
FIRST_S = FIRST_K + 12

_QUOTIENTS = {
    ("rad", "rad/s"): "s",
    ("rad", "N.m"): "rad/(N.m)",
    ("rad/s", "rad"): "1/s",
    ("rad/s", "N.m"): "rad/(N.m.s)",
    ("N.m", "rad"): "N.m/rad",
    ("N.m", "rad/s"): "N.m.s/rad",
}
_MEASURED = ("theta_m", "theta_l")


def _quotient(above: str, below: str) -> str:
    return "1" if above == below else _QUOTIENTS[(above, below)]


def _matrices() -> list[FmuVariable]:
    rows = range(6)
    units = [unit for _, unit, _ in ESTIMATED]
    entries = [
        (f"A_d[{r + 1},{c + 1}]", _quotient(units[r], units[c]), "Discrete state matrix") for r in rows for c in rows
    ]
    entries += [(f"B_d[{r + 1}]", _quotient(units[r], "N.m"), "Discrete input vector of u") for r in rows]
    entries += [(f"K_f[{r + 1},{c + 1}]", _quotient(units[r], "rad"), "Estimator gain") for r in rows for c in (0, 1)]
    entries += [(f"S_inv[{rc}]", "1/rad2", "Inverse covariance of the innovation") for rc in ("1,1", "1,2", "2,2")]
    return [FmuVariable(name, "parameter", unit, 0.0, text) for name, unit, text in entries]


class KalmanEstimator(SampledSlave):
    """Sampled-data stationary Kalman filter of the drivetrain's state and load torque."""

    title = "Sampled-data Kalman filter of the drivetrain's state and of its load torque"
    sample_time_reference = SAMPLE_TIME
    table: ClassVar[tuple[FmuVariable, ...]] = (
        *MEASURED,
        *(
            FmuVariable(
                name, "output", unit, None, f"Estimated {text}", variability="discrete", depends_on=_MEASURED,
                starts_from=(f"{name}_start",),
            )
            for name, unit, text in ESTIMATED
        ),
        *(
            FmuVariable(name, "output", unit, None, text, variability="discrete", depends_on=_MEASURED)
            for name, unit, text in (
                ("innovation_m", "rad", "Motor angle measured minus predicted"),
                ("innovation_l", "rad", "Load angle measured minus predicted"),
                ("innovation_squared", "1", "Normalised innovation squared"),
            )
        ),
        FmuVariable("sample_time", "parameter", "s", 1e-3, "Sample time", 1e-9, 1e6),
        *(
            FmuVariable(f"{name}_start", "parameter", unit, 0.0, f"Initially estimated {text}")
            for name, unit, text in ESTIMATED
        ),
        *_matrices(),
    )  # fmt: skip
    terminals: ClassVar[Terminals] = ENCODERS

    _A: Matrix6
    _B: Vector6
    _K: Gain
    _weight: Weight
    _estimate: Vector6
    _predicted: Vector6

    def take_parameters(self) -> None:
        """Collect the model and the gain."""
        values = self.real
        n = FIRST_A
        self._A = (
            self._six(n), self._six(n + 6), self._six(n + 12), self._six(n + 18), self._six(n + 24), self._six(n + 30),
        )  # fmt: skip
        self._B = self._six(FIRST_B)
        k = self._six(FIRST_K)
        m = self._six(FIRST_K + 6)
        self._K = ((k[0], k[1]), (k[2], k[3]), (k[4], k[5]), (m[0], m[1]), (m[2], m[3]), (m[4], m[5]))
        self._weight = (values[FIRST_S], values[FIRST_S + 1], values[FIRST_S + 2])

    def _six(self, first: int) -> Vector6:
        """Return six values in a row."""
        real = self.real
        return (real[first], real[first + 1], real[first + 2], real[first + 3], real[first + 4], real[first + 5])

    def begin(self) -> None:
        """Report the initial estimate; the first measurement counts at the end of the first sample period."""
        start = self._six(FIRST_START)
        self._predicted = start
        self._report(start, 0.0, 0.0, 0.0)

    def predict(self) -> None:
        """Predict with the torque request that was held over the sample period."""
        self._predicted = kalman.predict(self._estimate, self.real[U], self._A, self._B)

    def correct(self) -> None:
        """Correct the prediction with the measurement."""
        real = self.real
        estimate, innovation_m, innovation_l, squared = kalman.correct(
            self._predicted, real[THETA_M], real[THETA_L], self._K, self._weight
        )
        self._report(estimate, innovation_m, innovation_l, squared)

    def _report(self, estimate: Vector6, innovation_m: float, innovation_l: float, squared: float) -> None:
        real = self.real
        self._estimate = estimate
        real[3], real[4], real[5], real[6], real[7], real[8] = estimate  # from FIRST_ESTIMATE on
        real[INNOVATION_M] = innovation_m
        real[INNOVATION_L] = innovation_l
        real[INNOVATION_SQUARED] = squared
