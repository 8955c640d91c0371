"""The paired experiment: one reference, one controller and one estimator for a loop with and a loop without a gap.

Why the default looks as it does. The motor's lag of 1 s makes torque slow, so that a stiff load loop limit-cycles
inside the gap and the metric S stops being monotone in alpha. The default therefore asks for one smooth move there
and back within 2 s (a raised cosine, which crosses the gap at the start and at the reversal), and weighs the motor's
speed most: the motor is led smoothly through the gap, and S grows nearly in proportion to alpha from 0.002 to
0.1 rad at torque requests below 300 N.m. ``docs/experiment.md`` shows the search behind these numbers.

The plant is homogeneous: with reference, torque limit and gap multiplied by one factor, every signal is. The
thesis's sizes (1.2 to 4.8 rad) are the default experiment times 48.
"""

import hashlib
from dataclasses import asdict, dataclass, field, replace

import msgspec
import numpy as np

from orchestrator.errors import ScenarioError
from orchestrator.plants.design import (
    DrivetrainValues,
    KalmanFilter,
    Regulator,
    design_estimator,
    design_regulator,
    five_state_model,
    six_state_model,
)
from orchestrator.shared.arrays import Array
from pyfmu_sources.laws.backlash_models import MODELS

THESIS_SCALE = 48.0
BACKLASH_MODELS = tuple(model.name for model in MODELS if model.gap)


@dataclass(frozen=True)
class Experiment:
    """Everything that both loops share, in SI units.

    Attributes:
        name: what reports call it.
        amplitude: height of the raised-cosine reference [rad] at the load.
        frequency: of the reference [Hz].
        duration: of a run [s].
        sample_time: of controller, estimator and communication [s].
        torque_limit: of the request [N.m].
        state_weights: LQR weights of ``REGULATOR_STATES``.
        torque_weight: LQR weight of the request.
        process_noise: intensities that the estimator assumes, by ``ESTIMATOR_STATES``.
        assumed_encoder_noise: standard deviation [rad] that the estimator assumes.
        encoder_noise: standard deviation [rad] of the noise on the machine's encoders; the twin has none.
        backlash_model: of the loop with a gap.
        smallest: smallest half-gap claimed [rad].
        largest: largest half-gap claimed [rad].
        values: parameters of the drivetrain, in SI units.
    """

    name: str = "default"
    amplitude: float = 1.75
    frequency: float = 0.5
    duration: float = 2.0
    sample_time: float = 1e-3
    torque_limit: float = 300.0
    state_weights: tuple[float, ...] = (10.0, 50.0, 1.0, 1.0, 0.01)
    torque_weight: float = 2e-3
    process_noise: tuple[float, ...] = (0.0, 0.0, 0.0, 1e-2, 10.0, 400.0)
    assumed_encoder_noise: float = 1e-4
    encoder_noise: float = 0.0
    backlash_model: str = "dead_zone"
    smallest: float = 0.002
    largest: float = 0.1
    values: DrivetrainValues = field(default_factory=DrivetrainValues)

    @property
    def steps(self) -> int:
        """Number of communication steps."""
        return round(self.duration / self.sample_time)

    @property
    def times(self) -> Array:
        """Communication points [s], shape (steps + 1,)."""
        return np.arange(self.steps + 1, dtype=np.float64) * self.sample_time

    def reference(self) -> tuple[Array, Array]:
        """Return the wanted load angle [rad] and speed [rad/s] at the communication points.

        Returns:
            Angle and speed, each (steps + 1,).
        """
        phase = 2.0 * np.pi * self.frequency * self.times
        angle = 0.5 * self.amplitude * (1.0 - np.cos(phase))
        return angle, self.amplitude * np.pi * self.frequency * np.sin(phase)

    def regulator(self) -> Regulator:
        """Return the state feedback of both loops.

        Returns:
            State feedback gains and the gain of the reference, discrete at the control step.
        """
        weights = np.diag(self.state_weights)
        return design_regulator(five_state_model(self.values), weights, self.torque_weight, self.sample_time)

    def estimator(self) -> KalmanFilter:
        """Return the Kalman filter of both loops; it assumes no backlash and is never told of any.

        Returns:
            Gain and model of the steady-state Kalman filter.
        """
        variance = self.assumed_encoder_noise**2
        return design_estimator(
            six_state_model(self.values), np.array(self.process_noise), np.full(2, variance), self.sample_time
        )

    def encoder_errors(self, seed: int) -> tuple[Array, Array]:
        """Return the errors [rad] of motor and load encoder at the communication points, for one ``seed``.

        Args:
            seed: from which the noise of both encoders is drawn.

        Returns:
            Two arrays (steps + 1,).
        """
        shape = self.steps + 1
        if self.encoder_noise == 0.0:
            return np.zeros(shape), np.zeros(shape)
        draws = np.random.default_rng(seed).normal(0.0, self.encoder_noise, (2, shape))
        return draws[0], draws[1]

    def digest(self) -> str:
        """Return a hash of all values, by which calibrations are stored.

        Returns:
            16 hexadecimal digits.
        """
        return hashlib.sha256(msgspec.json.encode(asdict(self))).hexdigest()[:16]


def thesis_experiment() -> Experiment:
    """Return the default experiment scaled to the sizes of the thesis's Table 4.1."""
    default = Experiment()
    return replace(
        default,
        name="thesis",
        amplitude=default.amplitude * THESIS_SCALE,
        torque_limit=default.torque_limit * THESIS_SCALE,
        smallest=1.0,
        largest=5.0,
    )


EXPERIMENTS = {"default": Experiment, "thesis": thesis_experiment}


def choose_experiment(experiment: str | Experiment, backlash_model: str | None = None) -> Experiment:
    """Return the experiment that is meant, with another model of the gap where one is named."""
    if isinstance(experiment, str):
        if experiment not in EXPERIMENTS:
            known = ", ".join(EXPERIMENTS)
            raise ScenarioError(f"`experiment` must be one of {known}, but is {experiment!r}", "experiment")
        experiment = EXPERIMENTS[experiment]()
    if backlash_model is None:
        return experiment
    if backlash_model not in BACKLASH_MODELS:
        known = ", ".join(BACKLASH_MODELS)
        raise ScenarioError(f"`backlash_model` must be one of {known}, but is {backlash_model!r}", "backlash_model")
    return replace(experiment, backlash_model=backlash_model)
