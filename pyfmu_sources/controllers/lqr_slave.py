"""The FMU ``LqrController``: adapter from FMI to :mod:`lqr`."""

from __future__ import annotations

from typing import ClassVar

from ..adapters.controller_variables import GAINS, INPUTS
from ..adapters.fmu_variables import FmuVariable
from ..adapters.sampled_slave import SampledSlave
from .lqr import Gains, control

REFERENCE, REFERENCE_SPEED, FIRST_ESTIMATE = range(3)
U = FIRST_ESTIMATE + 6
FIRST_GAIN = U + 1
I, COMPLIANCE, U_MAX, SAMPLE_TIME = range(FIRST_GAIN + 5, FIRST_GAIN + 9)

_INPUT_NAMES = tuple(name for name, _, _ in INPUTS)
_PARAMETER_NAMES = (*(name for name, _, _ in GAINS), "i", "compliance", "u_max")


class LqrController(SampledSlave):
    """Sampled-data state feedback with the load torque fed forward and the torque limited."""

    title = "Sampled-data linear-quadratic regulator of the drivetrain, load torque fed forward"
    sample_time_reference = SAMPLE_TIME
    table: ClassVar[tuple[FmuVariable, ...]] = (
        *(FmuVariable(name, "input", unit, 0.0, text) for name, unit, text in INPUTS),
        FmuVariable(
            "u", "output", "N.m", None, "Requested motor torque", nominal=100.0, variability="discrete",
            depends_on=_INPUT_NAMES, starts_from=(*_INPUT_NAMES, *_PARAMETER_NAMES),
        ),
        *(FmuVariable(name, "parameter", unit, 0.0, text) for name, unit, text in GAINS),
        FmuVariable("i", "parameter", "1", 3.984, "Gear ratio: motor angle over load angle", 1e-9, 1e12),
        FmuVariable("compliance", "parameter", "rad/(N.m)", 1.0 / 3300.0, "Compliance of the shaft", 0.0, 1e12),
        FmuVariable("u_max", "parameter", "N.m", 1e4, "Torque limit", 0.0, 1e12),
        FmuVariable("sample_time", "parameter", "s", 1e-3, "Sample time", 1e-9, 1e6),
    )  # fmt: skip

    _gains: Gains

    def take_parameters(self) -> None:
        """Collect the gains."""
        real = self.real
        n = FIRST_GAIN
        self._gains = (real[n], real[n + 1], real[n + 2], real[n + 3], real[n + 4])

    def begin(self) -> None:
        """Compute the first torque request."""
        self.correct()

    def correct(self) -> None:
        """Compute the torque request of this sample."""
        real = self.real
        # One index each: this runs at every sample.
        estimate = (real[2], real[3], real[4], real[5], real[6], real[7])
        real[U] = control(
            real[REFERENCE], real[REFERENCE_SPEED], estimate, self._gains, real[I], real[COMPLIANCE], real[U_MAX]
        )
