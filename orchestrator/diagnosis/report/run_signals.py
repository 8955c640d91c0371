"""The signals of a record as free runs take them: requests as they acted, angles as they were."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.data.signals import first_derivative, smooth
from orchestrator.diagnosis.model.drive import lagged, shifted
from orchestrator.plants.description import Plant
from orchestrator.plants.measurement import LEAD, SHIFT
from orchestrator.records.record import Record, quantisation_step
from orchestrator.shared.inference.noise import residual_noise

Array = NDArray[np.float64]
NOISE_WINDOW = 9  # samples of the sliding cubic whose residual is the encoder's noise


@dataclass(frozen=True, eq=False)
class RunSignals:
    """Signals of one record.

    Attributes:
        step: sample time [s].
        requests: (n,) requested torque [N.m], held from sample to sample.
        angles: (n, channels) as the log has them [rad].
        noise: (channels,) standard deviation of each encoder's noise, rounding included [rad].
        torque: rms of the requests [N.m].
        cutoff: frequency up to which the machine moves [Hz], for first guesses of speeds.
    """

    step: float
    requests: Array
    angles: Array
    noise: Array
    torque: float
    cutoff: float

    @property
    def size(self) -> int:
        """Return the number of samples."""
        return int(self.requests.size)

    @property
    def channels(self) -> int:
        """Return the number of encoders."""
        return int(self.angles.shape[1])

    @cached_property
    def turn(self) -> float:
        """Return the farthest that the motor turns within a sample [rad]."""
        ahead = max(1, min(NOISE_WINDOW, self.size - 1))
        return float(np.max(np.abs(self.angles[ahead:, 0] - self.angles[:-ahead, 0]))) / ahead

    def aligned_angles(self, plant: Plant, p: Array) -> Array:
        """Return the angles (n, channels) as they were: what the log has late is put earlier.

        Returns:
            The angles [rad].
        """
        late = plant.value(p, SHIFT.name) if SHIFT.name in plant.names else 0.0
        if late == 0.0 or self.channels == 1:
            return self.angles
        return np.column_stack([self.angles[:, 0], shifted(self.angles[:, 1], -late / self.step)])

    def lateness(self, plant: Plant, p: Array) -> float:
        """Return the time [s] by which requests act after their stamp; negative: before it."""
        lead = plant.value(p, LEAD.name) if LEAD.name in plant.names else 0.0
        return plant.value(p, plant.drive.delay) - lead

    def guess_state(self, plant: Plant, p: Array, row: int) -> Array:
        """Return a first guess (8,) of the state at a row: smoothed angles, their derivatives, the drive's torque.

        The drive is at rest before the record.
        """
        state = np.zeros(8)
        angles = self.aligned_angles(plant, p)
        for channel, body in enumerate(plant.bodies):
            if channel < self.channels:
                angle, speed = self._motion(channel, angles)
                offset = p[plant.index(plant.offsets[channel])] if channel < len(plant.offsets) else 0.0
                state[body.angle], state[body.speed] = angle[row] - offset, speed[row]
            else:
                ratio = plant.ratio(p)
                state[body.angle], state[body.speed] = state[0] / ratio, state[1] / ratio
        lag = plant.value(p, plant.drive.lag)
        limit = plant.value(p, plant.drive.limit)
        torque = np.clip(self.requests[: row + 1], -limit, limit)
        state[plant.drive.torque] = lagged(np.append(0.0, torque), lag, self.step)[-1] if lag > 0.0 else torque[-1]
        for place, followed in plant.followers:
            state[place] = state[followed]
        return state

    def _motion(self, channel: int, angles: Array) -> tuple[Array, Array]:
        key = (channel, float(angles[-1, channel]))
        if key not in self._motions:
            smoothed = smooth(angles[:, channel], self.step, self.cutoff)
            speed = first_derivative(smoothed, self.step)
            speed[:2], speed[-2:] = speed[2], speed[-3]
            self._motions[key] = smoothed, speed
        return self._motions[key]

    @cached_property
    def _motions(self) -> dict[tuple[int, float], tuple[Array, Array]]:
        return {}


def run_signals(record: Record, channels: int, cutoff: float) -> RunSignals:
    """Return the signals of a record.

    Args:
        cutoff: frequency up to which the machine moves [Hz].

    Returns:
        The signals; straight lines stand for missing samples.
    """
    whole = record.filled()
    angles = [whole.theta_m, whole.theta_l][:channels]
    noise = [residual_noise(angle, quantisation_step(angle), NOISE_WINDOW) for angle in angles if angle is not None]
    columns = np.column_stack([angle for angle in angles if angle is not None])
    torque = float(np.sqrt(np.mean(whole.u**2))) + 1e-300
    return RunSignals(
        whole.step, np.ascontiguousarray(whole.u), np.ascontiguousarray(columns), np.array(noise), torque, cutoff
    )
