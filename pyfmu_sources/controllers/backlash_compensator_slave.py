"""The FMU ``BacklashCompensator``: adapter from FMI to :mod:`backlash_compensator`."""

from __future__ import annotations

from typing import ClassVar

from ..adapters.controller_variables import GAINS, INPUTS
from ..adapters.fmu_variables import FmuVariable
from ..adapters.sampled_slave import SampledSlave
from .backlash_compensator import CROSS, PLAIN, CrossingState, Gap, Tuning, act, start_state
from .lqr import Estimate, Gains
from .state_prediction import MOST_LATE, Sent, Train, foresee_late, n_under_way

REFERENCE, REFERENCE_SPEED, FIRST_ESTIMATE = range(3)
ALPHA, DEVIATION, OFFSET, U, FLANK, CROSSING, FIRST_GAIN = range(FIRST_ESTIMATE + 6, FIRST_ESTIMATE + 13)
FIRST_TRAIN = FIRST_GAIN + 5
FIRST_TUNING = FIRST_TRAIN + 7
SAMPLE_TIME = FIRST_TUNING + 4
DELAY = SAMPLE_TIME + 1

_INPUTS = (
    *INPUTS,
    ("alpha_hat", "rad", "Estimated half-gap; 0: not known"),
    ("alpha_deviation", "rad", "Standard deviation of the estimated half-gap"),
    ("offset_hat", "rad", "Estimated twist in mid-gap"),
)
_OUTPUTS = (
    ("u", "N.m", "Requested motor torque", 100.0),
    ("flank", "1", "Flank that is held or approached: -1 or 1; 0: half-gap not known, plain LQR", 1.0),
    ("crossing", "1", "1 while the wanted flank is approached, 0 while it is held", 1.0),
)
_TRAIN = (
    ("J_m", "kg.m2", 0.4, "Motor inertia", 1e-9),
    ("J_l", "kg.m2", 5.6, "Load inertia", 1e-9),
    ("b_m", "N.m.s/rad", 0.1, "Viscous friction of the motor", 0.0),
    ("b_l", "N.m.s/rad", 1.0, "Viscous friction of the load", 0.0),
    ("i", "1", 3.984, "Gear ratio: motor angle over load angle", 1e-9),
    ("compliance", "rad/(N.m)", 1.0 / 3300.0, "Compliance of the shaft", 0.0),
    ("tau", "s", 1.0, "Time constant of the motor's torque", 1e-6),
)
_TUNING = (
    ("impact_speed", "rad/s", 0.1, "Speed of the twist at which to land", 1e-6, 1e6),
    ("torque_share", "1", 0.85, "Share of the torque limit that a plan uses; 0: no plans, a shifted LQR", 0.0, 1.0),
    ("u_max", "N.m", 1e4, "Torque limit", 1e-9, 1e12),
    ("margin", "rad", 3e-4, "Way before the flank at which a plan ends: noise of the encoders", 0.0, 1e6),
)
_INPUT_NAMES = tuple(row[0] for row in _INPUTS)
_PARAMETER_NAMES = tuple(row[0] for row in (*GAINS, *_TRAIN, *_TUNING, ("sample_time",), ("delay",)))


class BacklashCompensator(SampledSlave):
    """Sampled-data controller that crosses the gap in little time, lands softly, and holds on one flank."""

    title = "Controller that crosses the gap of a drivetrain quickly and lands softly, around the gains of an LQR"
    sample_time_reference = SAMPLE_TIME
    table: ClassVar[tuple[FmuVariable, ...]] = (
        *(FmuVariable(name, "input", unit, 0.0, text) for name, unit, text in _INPUTS),
        *(
            FmuVariable(
                name, "output", unit, None, text, nominal=nominal, variability="discrete", depends_on=_INPUT_NAMES,
                starts_from=(*_INPUT_NAMES, *_PARAMETER_NAMES),
            )
            for name, unit, text, nominal in _OUTPUTS
        ),
        *(FmuVariable(name, "parameter", unit, 0.0, text) for name, unit, text in GAINS),
        *(FmuVariable(name, "parameter", unit, start, text, least, 1e12) for name, unit, start, text, least in _TRAIN),
        *(FmuVariable(name, "parameter", unit, start, text, least, most)
            for name, unit, start, text, least, most in _TUNING),
        FmuVariable("sample_time", "parameter", "s", 1e-3, "Sample time", 1e-9, 1e6),
        FmuVariable(
            "delay", "parameter", "1", 0.0, "Samples from the instant of the estimate until a request acts", 0.0,
            MOST_LATE,
        ),
    )  # fmt: skip

    _gains: Gains
    _state: CrossingState
    _next: CrossingState
    _sent: Sent

    def take_parameters(self) -> None:
        """Collect the gains."""
        real = self.real
        n = FIRST_GAIN
        self._gains = (real[n], real[n + 1], real[n + 2], real[n + 3], real[n + 4])

    def begin(self) -> None:
        """Hold on the side on which the twist is; the torque that acts is what was requested before."""
        self._sent = []
        for _ in range(n_under_way(self.real[DELAY])):
            self._sent.append(self.real[FIRST_ESTIMATE + 5])
        self._state = start_state(self._estimate(), self.real[REFERENCE_SPEED], self.real[FIRST_TRAIN + 4])
        self.correct()

    def predict(self) -> None:
        """Take over the state of the last sample."""
        self._state = self._next
        self._sent.append(self.real[U])
        del self._sent[:1]

    def correct(self) -> None:
        """Compute the torque request of this sample."""
        real = self.real
        n = FIRST_TRAIN
        train = Train(real[n], real[n + 1], real[n + 2], real[n + 3], real[n + 4], real[n + 5], real[n + 6])
        n = FIRST_TUNING
        h = real[SAMPLE_TIME]
        tuning = Tuning(real[n], real[n + 1], real[n + 2], real[n + 3], h)
        gap = Gap(real[ALPHA], real[DEVIATION])
        speed = real[REFERENCE_SPEED]
        reference = real[REFERENCE] + real[DELAY] * h * speed
        x = foresee_late(self._estimate(), self._sent, real[DELAY], h, max(gap.alpha, 0.0), train)
        state, u = act(self._state, reference, speed, x, gap, self._gains, train, tuning)
        self._next = state
        real[U] = u
        real[FLANK] = 0.0 if state.phase == PLAIN else float(state.flank)
        real[CROSSING] = 1.0 if state.phase == CROSS else 0.0

    def _estimate(self) -> Estimate:
        """Return the estimate with the twist zero in mid-gap."""
        real = self.real
        theta_m = real[2] - real[FIRST_TRAIN + 4] * real[OFFSET]
        return (theta_m, real[3], real[4], real[5], real[6], real[7])
