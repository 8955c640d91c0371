"""Which torque record would show the gap best, within limits of torque and speed.

Each excitation is scaled until torque or motor speed meets its limit on the nominal plant; the one with the least
Cramer-Rao bound on alpha wins. The bound allows for some torque noise, since a bound for a perfect model would reward
excitations that only a perfect model can use. Square pulses and multisines of several paces come first; then the
spectrum of a multisine and how hard its peaks are clipped are searched for, by an evolution strategy of one parent and
one child whose step follows its success (Rechenberg 1973): the bound jumps wherever a contact comes or goes, so that
its slope is of no use.

In all functions: ``duration``: of the record [s]; ``rate``: sampling rate [Hz].
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from orchestrator.errors import DesignError
from orchestrator.estimation import cramer_rao
from orchestrator.estimation.filter.innovations import simulate
from orchestrator.estimation.filter.model import AffineModel, affine_model
from orchestrator.estimation.problem import ALPHA, make_problem
from orchestrator.records.model_file import Model
from orchestrator.records.record import MINIMUM_ROWS, Record
from orchestrator.shared.arrays import Array

TORQUE_NOISE = 1e-2  # N.m.s^0.5
DEFAULT_NOISE = (3.5e-4, 1.75e-4)  # rad
PULSE_PERIODS = (0.3, 0.5, 0.8, 1.2, 2.0, 3.0)  # s
BANDS = (1.0, 2.0, 4.0, 8.0)  # Hz
EDGES = np.geomspace(0.2, 16.0, 8)  # Hz
SEARCHED = "clipped multisine, searched"
SEARCH = 60  # evaluations
FIRST_STEP, STEP_UP, STEP_DOWN = 0.5, 1.3, 0.93
SEED = 20
SHORTEST = 1.0  # s
LONGEST = 200_000  # samples


@dataclass(frozen=True)
class MachineLimits:
    """What the machine may be asked for: requested torque [N.m] and motor speed [rad/s]."""

    torque: float = 250.0
    speed: float = 50.0


@dataclass(frozen=True)
class Excitation:
    """One excitation: its name, torque request (n,) [N.m], bound on alpha [rad], peak torque and motor speed.

    The bound is infinite where no scale keeps the limits.
    """

    name: str
    u: Array
    bound: float
    torque: float
    speed: float


def design(
    model: Model,
    alpha: float,
    limits: MachineLimits,
    duration: float = 10.0,
    rate: float = 200.0,
    motor_only: bool = False,
    tell: Callable[[int, int], None] | None = None,
) -> tuple[Array, list[Excitation]]:
    """Return the time grid (n,) [s] and all candidates for a half-gap ``alpha`` [rad], the best first."""
    for name, value in (("torque", limits.torque), ("speed", limits.speed), ("alpha", alpha), ("rate", rate)):
        if not (math.isfinite(value) and value > 0.0):
            raise DesignError(f"`{name}` must be a positive finite number, but is {value:g}")
    n = round(duration * rate)
    if not MINIMUM_ROWS <= n <= LONGEST:
        must = f"{MINIMUM_ROWS} to {LONGEST} samples"
        raise DesignError(f"`duration` times `rate` must be {must}, but is {duration * rate:g}")
    if duration < SHORTEST:
        raise DesignError(f"`duration` must be at least {SHORTEST:g} s, but is {duration:g}")
    time = np.arange(n) / rate
    task = _Task(time, model, alpha, limits, motor_only)
    shapes, say = _simple_shapes(time), tell or (lambda done, of: None)
    candidates = []
    for name, shape in shapes:
        candidates.append(_judge(name, shape, task))
        say(len(candidates), len(shapes) + SEARCH)
    candidates.append(_search(task, lambda done: say(len(shapes) + done, len(shapes) + SEARCH)))
    return time, sorted(candidates, key=lambda candidate: candidate.bound)


def simple_candidates(
    model: Model, alpha: float, limits: MachineLimits, duration: float, rate: float, motor_only: bool = False
) -> list[Excitation]:
    """Return square pulses and multisines alone, without a search; the best first. See ``design``."""
    time = np.arange(round(duration * rate)) / rate
    found = [_judge(*entry, _Task(time, model, alpha, limits, motor_only)) for entry in _simple_shapes(time)[::2]]
    return sorted(found, key=lambda candidate: candidate.bound)


def _simple_shapes(time: Array) -> list[tuple[str, Array]]:
    shapes = [(f"square pulses, period {period:g} s", _pulses(time, period)) for period in PULSE_PERIODS]
    return shapes + [(f"multisine to {top:g} Hz", _multisine(time, top)) for top in BANDS]


@dataclass(frozen=True)
class _Task:
    """What is to be designed: see ``design``."""

    time: Array
    model: Model
    alpha: float
    limits: MachineLimits
    motor_only: bool


@dataclass(frozen=True)
class _Spectrum:
    """A clipped multisine: log amplitudes at ``EDGES``, log of the clipping gain, phases of all lines [rad]."""

    levels: Array
    phases: Array

    def shape(self, time: Array) -> Array:
        """Return the wave (n,) within (-1, 1)."""
        frequency = np.fft.rfftfreq(time.size, float(time[1] - time[0]))
        inside = (frequency >= EDGES[0]) & (frequency <= EDGES[-1])
        level = np.interp(np.log(np.where(inside, frequency, 1.0)), np.log(EDGES), self.levels[:-1])
        lines = np.where(inside, np.exp(level), 0.0) * np.exp(1j * self.phases)
        wave = np.fft.irfft(lines, time.size)
        return np.asarray(np.tanh(np.exp(self.levels[-1]) * wave / np.sqrt(np.mean(wave**2))))

    def child(self, rng: np.random.Generator, step: float) -> "_Spectrum":
        """Return a spectrum nearby; ``step`` is a standard deviation."""
        return _Spectrum(self.levels + step * rng.standard_normal(self.levels.size), self.phases)


def _search(task: _Task, tell: Callable[[int], None]) -> Excitation:
    """Return the best clipped multisine that ``SEARCH`` evaluations find."""
    rng = np.random.default_rng(SEED)
    lines = task.time.size // 2 + 1
    starts = [
        _Spectrum(np.append(np.where(top > EDGES, 0.5 * np.log(1.0 + EDGES**2), -3.0), gain), 2.0 * np.pi * phases)
        for top in (3.0, 6.0, 10.0)
        for gain, phases in ((-0.5, rng.random(lines)), (0.5, rng.random(lines)))
    ]
    judged = [_judge(SEARCHED, start.shape(task.time), task) for start in starts]
    first = min(range(len(starts)), key=lambda n: judged[n].bound)
    best, parent, step = judged[first], starts[first], FIRST_STEP
    for n in range(len(starts), SEARCH):
        child = parent.child(rng, step)
        candidate = _judge(SEARCHED, child.shape(task.time), task)
        if candidate.bound < best.bound:
            best, parent, step = candidate, child, step * STEP_UP
        else:
            step *= STEP_DOWN
        tell(n + 1)
    return best


def _pulses(time: Array, period: float) -> Array:
    """Return square pulses of alternating sign; the first half pulse keeps the mean speed at zero."""
    return np.where(np.floor(2.0 * (time + 0.25 * period) / period) % 2 == 0, 1.0, -1.0)


def _multisine(time: Array, top: float) -> Array:
    """Return a random-phase multisine from 0.2 Hz to ``top`` [Hz] with amplitudes that make up for the motor's lag."""
    rng = np.random.default_rng(SEED)
    step = time[1] - time[0]
    frequency = np.fft.rfftfreq(time.size, step)
    amplitude = np.where((frequency >= 0.2) & (frequency <= top), np.sqrt(1.0 + frequency**2), 0.0)
    wave = np.fft.irfft(amplitude * np.exp(2j * np.pi * rng.random(frequency.size)), time.size)
    return np.asarray(wave / np.max(np.abs(wave)))


def _judge(name: str, shape: Array, task: _Task) -> Excitation:
    plant = plant_of(task.model, task.alpha)
    step = float(task.time[1] - task.time[0])
    scale = task.limits.torque / float(np.max(np.abs(shape)))
    states = simulate(plant, scale * shape, step, np.zeros(5))
    for _ in range(6):
        fastest = float(np.max(np.abs(states[:, 1])))
        if fastest <= task.limits.speed:
            break
        scale *= 0.98 * task.limits.speed / fastest
        states = simulate(plant, scale * shape, step, np.zeros(5))
    u, fastest = scale * shape, float(np.max(np.abs(states[:, 1])))
    if fastest > task.limits.speed:
        return Excitation(name, u, math.inf, float(np.max(np.abs(u))), fastest)
    noise = (_noise(task.model, "theta_m", 0), _noise(task.model, "theta_l", 1))
    bound = error_bound_of_excitation(task.model, task.time, u, task.alpha, noise, task.motor_only)
    return Excitation(name, u, bound, float(np.max(np.abs(u))), fastest)


def plant_of(model: Model, alpha: float) -> AffineModel:
    """Return the model's plant with a half-gap ``alpha`` [rad]."""
    return affine_model({**{name: one.value for name, one in model.parameters.items()}, ALPHA: alpha})


def error_bound_of_excitation(
    model: Model, time: Array, u: Array, alpha: float, noise: tuple[float, float], motor_only: bool
) -> float:
    """Return the bound [rad] on a half-gap [rad] that a torque (n,) [N.m] would give on the model's plant, from rest.

    ``time``: (n,) [s], uniform; ``noise``: standard deviation of each encoder [rad].
    """
    plant = plant_of(model, alpha)
    states = simulate(plant, u, float(time[1] - time[0]), np.zeros(5))
    if not np.all(np.isfinite(states)):
        return math.inf
    record = Record(time, u, states[:, 0].copy(), None if motor_only else states[:, 2].copy(), "simulated")
    truth = cramer_rao.truth_values({}, alpha, np.zeros(5))
    return cramer_rao.error_bound(make_problem(record, model), truth, noise, TORQUE_NOISE)


def _noise(model: Model, column: str, place: int) -> float:
    encoder = model.encoder(column)
    if encoder.noise is None and encoder.resolution is None:
        return DEFAULT_NOISE[place]
    return max(math.hypot(encoder.noise or 0.0, (encoder.resolution or 0.0) / math.sqrt(12.0)), 1e-9)
