"""A model that is run over parts of a record from given states, by the cheapest of three ways that are exact enough.

Without effects the plant is linear, and each sample's motion is a matrix. Two bodies that rub vibrate against stiction
at every oscillation of their shaft: to locate each of these events, and to follow other nonlinear effects to twelve
digits, costs up to a hundred times what steps without events do, which run in the exact plant's place there. Where
teeth meet, and whatever else there is, the exact, event-located plant itself runs.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from orchestrator.diagnosis.data.signals import first_derivative, smooth
from orchestrator.diagnosis.model.drive import apply_lag, logged_torque, shift_signal
from orchestrator.diagnosis.model.encoders import centre_angles
from orchestrator.effects.of_logs import LEAD, SHIFT
from orchestrator.plants.coarse_run import FINER, coarse_steps, runs_coarsely
from orchestrator.plants.description import Plant
from orchestrator.plants.linear_run import is_linear, linear_run_of
from orchestrator.records.record import Record, quantisation_step
from orchestrator.shared.arrays import Array
from orchestrator.shared.inference.noise import residual_noise
from pyfmu_sources.laws.drive import UNASKED

Kernel = Callable[[Array, Array, Array, Array], None]
"""``kernel(start, early, late, out)``: requests in both pieces of each sample; fills the angles (n, 2)."""
NOISE_WINDOW = 9  # samples of the sliding cubic whose residual is the encoder's noise


@dataclass(frozen=True, eq=False)
class RunSignals:
    """Signals of one record."""

    step: float  # sample time [s]
    requests: Array  # (n,) requested torque [N.m], held from sample to sample
    angles: Array  # (n, channels) as the log has them [rad]
    noise: Array  # (channels,) standard deviation of each encoder's noise, rounding included [rad]
    torque: float  # rms of the requests [N.m]
    cutoff: float  # frequency up to which the machine moves [Hz], for first guesses of speeds
    # (n,) what the requests change by when the torque's own rows are samples of a smooth signal [N.m]; or empty
    smoothing: Array = field(default_factory=lambda: np.empty(0))

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

    def angles_in_time(self, plant: Plant, p: Array) -> Array:
        """Return the angles (n, channels) [rad] as they were: what the log has late is put earlier, and centred."""
        angles = list(self.angles.T)
        if self.channels > 1 and SHIFT.name in plant.names:
            angles[1] = shift_signal(angles[1], -plant.value(p, SHIFT.name) / self.step)
        return np.column_stack(centre_angles(plant, p, angles))

    def requests_of(self, plant: Plant, p: Array) -> Array:
        """Return the requests (n,) [N.m] as the log has them, held or sampled."""
        return logged_torque(plant, p, self.requests, self.smoothing)

    def lateness(self, plant: Plant, p: Array) -> float:
        """Return the time [s] by which requests act after their stamp; negative: before it."""
        lead = plant.value(p, LEAD.name) if LEAD.name in plant.names else 0.0
        return plant.value(p, plant.drive.delay) - lead

    def guess_state(self, plant: Plant, p: Array, row: int) -> Array:
        """Return a first guess (8,) of the state at a row: smoothed angles, their derivatives, the drive's torque.

        The drive is at rest before the record.
        """
        state = np.zeros(8)
        angles = self.angles_in_time(plant, p)
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
        torque = np.clip(self.requests_of(plant, p)[: row + 1], -limit, limit)
        state[plant.drive.torque] = apply_lag(np.append(0.0, torque), lag, self.step)[-1] if lag > 0.0 else torque[-1]
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
    """Return the signals of a record up to a ``cutoff`` [Hz]; straight lines stand for missing samples."""
    whole = record.fill_missing()
    angles = [whole.theta_m, whole.theta_l][:channels]
    noise = [residual_noise(angle, quantisation_step(angle), NOISE_WINDOW) for angle in angles if angle is not None]
    columns = np.column_stack([angle for angle in angles if angle is not None])
    torque = float(np.sqrt(np.mean(whole.u**2))) + 1e-300
    smoothing = np.empty(0) if whole.u_sampled is None else np.ascontiguousarray(whole.u_sampled - whole.u)
    return RunSignals(
        whole.step,
        np.ascontiguousarray(whole.u),
        np.ascontiguousarray(columns),
        np.array(noise),
        torque,
        cutoff,
        smoothing,
    )


@dataclass(frozen=True)
class Simulation:
    """A model, ready to be run: what does not depend on where a run starts is done once."""

    plant: Plant
    p: Array
    signals: RunSignals  # of the record; requests before a part matter when there is a dead time
    # requests before a part are still under way in a dead time; False: there were none, as in an FMU that starts with
    # the part
    history: bool = True

    def run(self, start: Array, part: slice) -> Array:
        """Return the simulated encoder angles (n, 2) [rad] of a part that begins in a state (8,)."""
        begin, end, _ = part.indices(self.signals.size)
        acting, followed = self._requests
        whole, _ = self._dead_time
        known = 0 if self.history else begin
        late, early = (_requests(acting, begin - back, end - begin, known) for back in (whole, whole + 1))
        out = np.empty((end - begin, 2))
        if self._kernel is not None:
            self._kernel(start, early, late, out)
        else:
            self._run_exactly(
                start, float(followed[min(max(begin - whole, 0), self.signals.size - 1)]), early, late, out
            )
        for channel, name in enumerate(self.plant.offsets):
            out[:, channel] += self.p[self.plant.index(name)]
        return out

    @cached_property
    def measured(self) -> Array:
        """The angles (n, channels) as they were, from how the log has them."""
        return self.signals.angles_in_time(self.plant, self.p)

    @cached_property
    def _requests(self) -> tuple[Array, Array]:
        """What is requested in each sample (n,), and what is at its beginning (n,)."""
        limit = self.p[self.plant.index(self.plant.drive.limit)]
        u = np.clip(self.signals.requests_of(self.plant, self.p), -limit, limit)
        mean, followed = self.plant.follow_requests(self.p, u, self.signals.step)
        return (u if self._kernel is None else mean), followed

    @cached_property
    def _dead_time(self) -> tuple[int, float]:
        """Whole samples of it, and what is left [s]."""
        delay, h = self.signals.lateness(self.plant, self.p), self.signals.step
        whole = int(np.floor(delay / h + 1e-9))
        return whole, max(delay - whole * h, 0.0)

    @cached_property
    def _kernel(self) -> Kernel | None:
        """What runs in the exact plant's place; None where nothing does."""
        plant, p, h = self.plant, self.p, self.signals.step
        _, first = self._dead_time
        if self.history and is_linear(plant, p):
            return linear_run_of(plant, p, first, h)
        if not (self.history and runs_coarsely(plant, p)):
            return None
        steps = coarse_steps(plant, p, h, self.signals.turn)
        run = plant.motion.run_coarsely
        return lambda start, early, late, out: run(start, p, early, late, first, h, steps, FINER * steps, out)

    def _run_exactly(self, start: Array, asked: float, early: Array, late: Array, out: Array) -> None:
        _, first = self._dead_time
        memory = (float(start[7]), asked) if self.history else (0.0, UNASKED)
        own = self.plant.fmu_values(self.p)
        self.plant.run_exactly(np.append(start[:7], memory), own, early, late, first, self.signals.step, out)


def _requests(u: Array, begin: int, count: int, first: int) -> Array:
    """Return the requests at ``count`` samples from ``begin`` on; there were none before ``first``, the last one
    stays.
    """
    rows = np.arange(begin, begin + count)
    found = u[np.clip(rows, 0, u.size - 1)]
    found[rows < first] = u[0] if first == 0 else 0.0
    return found
