"""The FMU ``BacklashEstimator``: adapter from FMI to :mod:`backlash_estimator`."""

from __future__ import annotations

from typing import ClassVar

from ..adapters.controller_variables import ENCODERS, ESTIMATED, MEASURED
from ..adapters.fmu_variables import FmuVariable, Terminals
from ..adapters.sampled_slave import SampledSlave
from ..controllers.state_prediction import MOST_LATE, Sent, n_under_way, oldest_share
from . import backlash_estimator as source
from .backlash_estimator import Filters, Model, SettingValues

U, THETA_M, THETA_L, ALPHA_HAT, ALPHA_DEVIATION, CONTACT_HAT, FIRST_ESTIMATE = range(7)
FIRST_MODEL = FIRST_ESTIMATE + 6
FIRST_SETTING = FIRST_MODEL + 8
SAMPLE_TIME = FIRST_SETTING + 9
OFFSET_HAT, ALPHA_START, ALPHA_SPREAD, DELAY = range(SAMPLE_TIME + 1, SAMPLE_TIME + 5)

_MEASURED = ("theta_m", "theta_l")
_STATES = (*ESTIMATED[:4], ESTIMATED[5], ESTIMATED[4])
_MODEL = (
    ("J_m", "kg.m2", 0.4, "Motor inertia"),
    ("J_l", "kg.m2", 5.6, "Load inertia"),
    ("k", "N.m/rad", 3300.0, "Shaft stiffness, load side"),
    ("c", "N.m.s/rad", 1.0, "Shaft damping, load side"),
    ("b_m", "N.m.s/rad", 0.1, "Viscous friction of the motor"),
    ("b_l", "N.m.s/rad", 1.0, "Viscous friction of the load"),
    ("i", "1", 3.984, "Gear ratio: motor angle over load angle"),
    ("tau", "s", 1.0, "Time constant of the motor's torque"),
)
_DEFAULT = source.NoiseSettings()
_SETTINGS = (
    ("noise_m", "rad", "Standard deviation of the measured motor angle, rounding included", 1e-9),
    ("noise_l", "rad", "Standard deviation of the measured load angle; 1e6: no load encoder", 1e-9),
    ("torque_noise_m", "N.m", "Standard deviation over one second of white torque at the motor", 0.0),
    ("torque_noise_l", "N.m", "Standard deviation over one second of white torque at the load", 0.0),
    ("load_walk", "N.m", "Standard deviation of the load torque's change in one second", 0.0),
    ("alpha_walk", "rad", "Standard deviation of the half-gap's change in one second (wear)", 0.0),
    ("stiffness_spread", "1", "Relative standard deviation of the stiffness", 0.0),
    ("offset_spread", "rad", "Standard deviation of the twist in mid-gap", 0.0),
    ("lag_spread", "1", "Relative standard deviation of the torque's time constant", 0.0),
)
_BEGINNING = (*_MEASURED, *(row[0] for row in (*_MODEL, *_SETTINGS)), "alpha_start", "alpha_spread")
_ZERO_ALLOWED = ("c", "b_m", "b_l")


class BacklashEstimator(SampledSlave):
    """Sampled-data estimator of the half-gap, with its uncertainty, in a running loop."""

    title = "Online estimator of the half-gap, its standard deviation, the flank and the state"
    sample_time_reference = SAMPLE_TIME
    table: ClassVar[tuple[FmuVariable, ...]] = (
        *MEASURED,
        *(
            FmuVariable(
                name, "output", unit, None, text, variability="discrete", depends_on=_MEASURED, starts_from=_BEGINNING
            )
            for name, unit, text in (
                ("alpha_hat", "rad", "Estimated half-gap"),
                ("alpha_deviation", "rad", "Standard deviation of the estimated half-gap"),
                ("contact_hat", "1", "Estimated flank: -1, 0 or 1"),
                *((name, unit, f"Estimated {text}") for name, unit, text in _STATES),
            )
        ),
        *(
            FmuVariable(name, "parameter", unit, start, text, 0.0 if name in _ZERO_ALLOWED else 1e-9, 1e12)
            for name, unit, start, text in _MODEL
        ),
        *(
            FmuVariable(name, "parameter", unit, getattr(_DEFAULT, name), text, least, 1e6)
            for name, unit, text, least in _SETTINGS
        ),
        FmuVariable("sample_time", "parameter", "s", 1e-3, "Sample time", 1e-9, 1.0),
        # Behind the others, whose value references stay.
        FmuVariable(
            "offset_hat", "output", "rad", None, "Estimated twist in mid-gap", variability="discrete",
            depends_on=_MEASURED,
        ),
        FmuVariable("alpha_start", "parameter", "rad", 0.0, "Half-gap to start from; 0: not known", 0.0, 1e6),
        FmuVariable("alpha_spread", "parameter", "1", 0.2, "Relative standard deviation of alpha_start", 1e-3, 10.0),
        FmuVariable(
            "delay", "parameter", "1", 0.0, "Samples from a request until it acts in the measured motion", 0.0,
            MOST_LATE,
        ),
    )  # fmt: skip
    terminals: ClassVar[Terminals] = ENCODERS

    _model: Model
    _settings: SettingValues
    _filters: Filters
    _predicted: Filters
    _sent: Sent

    def take_parameters(self) -> None:
        """Collect model and settings."""
        real = self.real
        n = FIRST_MODEL
        self._model = (
            real[n], real[n + 1], real[n + 2], real[n + 3], real[n + 4], real[n + 5], real[n + 6], real[n + 7],
        )  # fmt: skip
        n = FIRST_SETTING
        self._settings = (
            real[n], real[n + 1], real[n + 2], real[n + 3], real[n + 4], real[n + 5], real[n + 6], real[n + 7],
            real[n + 8],
        )  # fmt: skip

    def begin(self) -> None:
        """Start all filters at the first measurement; before, the same was requested."""
        self._sent = []
        for _ in range(n_under_way(self.real[DELAY])):
            self._sent.append(self.real[U])
        self._predicted = [[0.0] * source.SIZE for _ in range(source.FILTERS)]
        real = self.real
        source.begin(
            self._predicted, real[ALPHA_START], real[ALPHA_SPREAD], real[THETA_M], real[THETA_L], self._settings
        )  # fmt: skip
        self._filters = [list(f) for f in self._predicted]
        self._report()

    def predict(self) -> None:
        """Predict with the torque requests that acted over the sample period."""
        real = self.real
        self._predicted = [list(f) for f in self._filters]
        self._sent.append(real[U])
        share = oldest_share(real[DELAY]) if len(self._sent) > 1 else 1.0
        source.advance(self._predicted, self._model, self._settings, self._sent[0], share * real[SAMPLE_TIME])
        if share < 1.0:
            rest = (1.0 - share) * real[SAMPLE_TIME]
            source.advance(self._predicted, self._model, self._settings, self._sent[1], rest)
        del self._sent[:1]

    def correct(self) -> None:
        """Correct the prediction with the measurement."""
        self._filters = [list(f) for f in self._predicted]
        source.measure(self._filters, self._settings, self.real[THETA_M], self.real[THETA_L])
        self._report()

    def _report(self) -> None:
        real = self.real
        alpha, deviation, best = source.combine(self._filters, source.FILTERS)
        state = self._filters[best]
        real[ALPHA_HAT] = alpha
        real[ALPHA_DEVIATION] = deviation
        real[CONTACT_HAT] = float(source.contact(state, self._model[6]))
        for n in range(6):
            real[FIRST_ESTIMATE + n] = state[n]
        real[OFFSET_HAT] = state[8]
