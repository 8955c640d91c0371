"""The joint likelihood of gap, plant parameters, initial state and noise, and its maximisation.

The unknowns are one vector: the uncertain linear parameters (in prior standard deviations from nominal), alpha, the
initial state, and the logarithms of the noise levels. Scores and the Fisher information come from finite differences
of the innovations; steps are Fisher scoring with Levenberg's damping. See ``docs/estimation.md``.
"""

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.estimation.innovations import Array, Innovations, NoiseLevels, affine_model, innovations
from orchestrator.model_file import Model
from orchestrator.record import Record, quantisation_step
from pyfmu_sources.drivetrain_parameters import NAMES, P_ALPHA

STATE_NAMES = ("theta_m_start", "omega_m_start", "theta_l_start", "omega_l_start", "T_m_start")
OFFSET = "effects.sensor_offset.load.offset"
IMPULSE = "contact_impulse"
IMPULSE_DEPTH = 2e-3  # rad, within which a contact's damping sets in; prior standard deviation
OFFSET_SPREAD = 0.1  # prior standard deviation [rad] of the angle between the encoders' zeros and mid-gap
NOISE_SPREAD = 2.0  # prior standard deviation of a log noise level: a factor of seven
JUMP = 100.0
START_DAMPING = 1e-6
DIFFERENCE = 0.01  # step of a difference quotient, in standard deviations
# White torque noise [N.m.s^0.5]. With one encoder a deterministic model can shadow any record, and one whose contact
# law is not the machine's is too sure of itself; a least noise of motor and load keeps both honest.
LEAST_TORQUE_NOISE, LARGEST_TORQUE_NOISE = 1e-9, 30.0
LEAST_WHERE_INEXACT = (1e-4, 1e-3)
LARGEST_LOG_NOISE = 20.0  # beyond the bounds of any unknown, where a difference quotient may look


@dataclass(frozen=True)
class Unknown:
    """One unknown: its name, prior mean and standard deviation, and the scale in which steps are taken."""

    name: str
    mean: float
    deviation: float
    scale: float
    lower: float = -math.inf
    upper: float = math.inf


@dataclass(frozen=True)
class Problem:
    """A record and what is unknown about it.

    Attributes:
        record: the record.
        base: parameter tuple of the model.
        unknowns: every unknown, in the order of the vector; free or not is decided per fit.
        outputs: (n, 1 or 2) measured angles [rad].
        noise: nominal noise levels, for those that are not among the unknowns.
    """

    record: Record
    base: tuple[float, ...]
    unknowns: tuple[Unknown, ...]
    outputs: Array
    noise: NoiseLevels

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of the unknowns, in order."""
        return tuple(unknown.name for unknown in self.unknowns)

    @property
    def start(self) -> Array:
        """Return the prior means."""
        return np.array([unknown.mean for unknown in self.unknowns])

    def index(self, name: str) -> int:
        """Return the place of an unknown in the vector."""
        return self.names.index(name)


def make_problem(record: Record, model: Model) -> Problem:
    """Return the estimation problem of a record under a model.

    With the motor encoder alone only alpha times the gear ratio can be seen, so the ratio then counts as exact.
    """
    both = record.theta_l is not None
    outputs = record.theta_m[:, None] if record.theta_l is None else np.column_stack([record.theta_m, record.theta_l])
    unknowns = []
    for parameter in model.uncertain:
        if parameter.name == "alpha" or (parameter.name == "i" and not both):
            continue
        sd = parameter.standard_deviation
        lower = max(parameter.minimum, parameter.value - 4.0 * sd) if parameter.value > 0 else parameter.minimum
        unknowns.append(Unknown(parameter.name, parameter.value, sd, sd, lower, parameter.maximum))
    ratio = model.parameters["i"].value
    unknowns.append(Unknown("alpha", 0.0, math.inf, 1e-3, 0.0, 3.0))
    if both:
        unknowns.append(Unknown(OFFSET, 0.0, OFFSET_SPREAD, 1e-3))
    damping = model.parameters["c"].value
    unknowns.append(Unknown(IMPULSE, 0.0, 0.5 * IMPULSE_DEPTH * damping, 0.5 * IMPULSE_DEPTH * damping))
    unknowns += _initial_state(record, ratio)
    levels, noises = [], []
    for column in ("theta_m", "theta_l")[: outputs.shape[1]]:
        level = measurement_noise(record, model, column)
        levels.append(level)
        known = model.encoder(column).noise is not None and model.encoder(column).resolution is not None
        spread = 0.02 if known else NOISE_SPREAD
        noises.append(
            Unknown(f"log_noise_{column}", math.log(level), spread, 0.1, math.log(level) - 6.0, math.log(level) + 6.0)
        )
    least = (LEAST_TORQUE_NOISE, LEAST_TORQUE_NOISE) if both else LEAST_WHERE_INEXACT
    for side, low in zip(("motor", "load"), least, strict=True):
        noises.append(Unknown(f"log_torque_{side}", -7.0, math.inf, 0.5, math.log(low), math.log(LARGEST_TORQUE_NOISE)))
    if not both:
        levels.append(levels[0])
    return Problem(
        record, model.values, tuple(unknowns + noises), outputs, NoiseLevels((levels[0], levels[1]), (1.0, 1.0))
    )


def _initial_state(record: Record, ratio: float) -> list[Unknown]:
    """Return unknowns for the initial state, centred on a straight line through the first rows."""
    rows = min(8, record.size)
    t = record.time[:rows] - record.time[0]
    speed_m, angle_m = np.polyfit(t, record.theta_m[:rows], 1)
    if record.theta_l is not None:
        speed_l, angle_l = np.polyfit(t, record.theta_l[:rows], 1)
        spread_l = 0.02
    else:
        speed_l, angle_l, spread_l = speed_m / ratio, angle_m / ratio, 0.1
    means = (float(angle_m), float(speed_m), float(angle_l), float(speed_l), 0.0)
    spreads = (0.02, 3.0, spread_l, 1.0, 30.0)
    scales = (1e-4, 1e-2, 1e-4, 1e-2, 1e-1)
    return [Unknown(*entry) for entry in zip(STATE_NAMES, means, spreads, scales, strict=True)]


def measurement_noise(record: Record, model: Model, column: str) -> float:
    """Return the standard deviation of an encoder [rad]: stated noise and rounding, else estimated from the record.

    The estimate takes the third difference of the column, in which motion hardly shows (its gain on white noise
    is sqrt(20)); rounding adds a twelfth of the squared count.
    """
    values = record.theta_m if column == "theta_m" else record.theta_l
    assert values is not None
    encoder = model.encoder(column)
    count = quantisation_step(values) if encoder.resolution is None else encoder.resolution
    if encoder.noise is not None:
        level = math.sqrt(encoder.noise**2 + count**2 / 12.0)
    else:
        third = np.diff(values, 3)
        level = 1.4826 * float(np.median(np.abs(third))) / math.sqrt(20.0)
        level = max(level, count / math.sqrt(12.0))
    return max(level, 1e-9)


@dataclass(frozen=True)
class Point:
    """The likelihood at one vector of unknowns.

    ``objective`` is twice the negative log posterior without constants (deviance plus prior).
    """

    theta: Array
    objective: float
    deviance: float
    result: Innovations = field(repr=False)


@dataclass(frozen=True)
class Fit:
    """A maximum of the likelihood.

    Attributes:
        point: where it is.
        free: (k,) indices of the unknowns that were fitted.
        information: (k, k) Fisher information of the free unknowns, prior included.
        covariance: (k, k) its inverse.
        iterations: scoring steps taken.
        converged: whether the last step changed the objective by less than the tolerance.
    """

    point: Point
    free: NDArray[np.int64]
    information: Array
    covariance: Array
    iterations: int
    converged: bool


class Likelihood:
    """Evaluates a problem at vectors of unknowns; two threads share the runs of one derivative.

    ``soft`` blurs the flanks by the uncertainty of the twist, which smooths the likelihood for the start of a fit.
    ``information`` is the last Fisher information of each unknown; the difference quotients are scaled by it.
    """

    def __init__(self, problem: Problem, threads: int = 1) -> None:
        self.problem = problem
        self.soft = False
        names = problem.names
        self._offset = names.index(OFFSET) if OFFSET in names else None
        self._alpha = names.index("alpha")
        self._impulse = names.index(IMPULSE)
        self.information = np.diag([(10.0 / u.scale) ** 2 for u in problem.unknowns])  # the last one known
        self._floor = np.array([(0.1 / u.scale) ** 2 for u in problem.unknowns])
        self._places = [(n, NAMES.index(name)) for n, name in enumerate(names) if name in NAMES and name != OFFSET]
        self._state = [problem.index(name) for name in STATE_NAMES]
        self._noise = [n for n, u in enumerate(problem.unknowns) if u.name.startswith("log_noise_")]
        self._torque = [n for n, u in enumerate(problem.unknowns) if u.name.startswith("log_torque_")]
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None
        self._mean = problem.start
        self._weight = np.array([u.deviation**-2 if math.isfinite(u.deviation) else 0.0 for u in problem.unknowns])

    @property
    def difference(self) -> float:
        """Return the step of a difference quotient in standard deviations: long while the flanks are blurred."""
        return 1.0 if self.soft else DIFFERENCE

    @property
    def damping(self) -> float:
        """Return the damping with which a fit starts."""
        return 1e-3 if self.soft else START_DAMPING

    def parameters(self, theta: Array) -> tuple[float, ...]:
        """Return the parameter tuple ``p`` of a vector."""
        p = list(self.problem.base)
        for place, name in self._places:
            p[name] = float(theta[place])
        return tuple(p)

    def noise(self, theta: Array) -> NoiseLevels:
        """Return the noise levels of a vector."""
        measured = [math.exp(min(theta[n], LARGEST_LOG_NOISE)) for n in self._noise]
        motor, load = (math.exp(min(theta[n], LARGEST_LOG_NOISE)) for n in self._torque)
        return NoiseLevels((measured[0], measured[-1]), (motor, load))

    def run(self, theta: Array, keep: bool = False) -> Innovations:
        """Return the innovations at ``theta``."""
        record = self.problem.record
        model = affine_model(self.parameters(theta), float(theta[self._impulse]))
        outputs, x0 = self.problem.outputs, theta[self._state]
        if self._offset is not None:
            shift = theta[self._offset]
            outputs = outputs - np.array([0.0, shift])
            x0 = x0 - np.array([0.0, 0.0, shift, 0.0, 0.0])
        return innovations(model, record.u, outputs, record.step, x0, self.noise(theta), keep, self.soft)

    def at(self, theta: Array) -> Point:
        """Return the likelihood at ``theta``; infinite where the filter diverges."""
        result = self.run(theta)
        deviance = result.deviance
        if not math.isfinite(deviance):
            deviance = math.inf
        prior = float(np.sum(self._weight * (theta - self._mean) ** 2))
        return Point(theta, deviance + prior, deviance, result)

    def derivatives(self, point: Point, free: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return the gradient (k,) of half the objective and the Fisher information (k, k) of the free unknowns.

        Differences are taken along the columns of a factor of the covariance that the last information implies, a
        hundredth of a standard deviation far: the unknowns themselves may be correlated to one part in 1e9.
        """
        base = point.result
        basis = self._basis(free)

        def look(n: int, step: float) -> tuple[Array, Array]:
            moved = point.theta.copy()
            moved[free] += step * basis[:, n]
            result = self.run(moved)
            error = (result.errors - base.errors) / (step * np.sqrt(base.variances))
            spread = (result.variances - base.variances) / (step * base.variances)
            return error.ravel(), spread.ravel()

        def run(n: int) -> tuple[Array, Array]:
            error, spread = look(n, self.difference)
            # A direction is scaled to an information of one. Much more is a contact that comes or goes within the step.
            if float(error @ error) > JUMP:
                other = look(n, -self.difference)
                if float(other[0] @ other[0]) < float(error @ error):
                    return other
            return error, spread

        columns = list(self._pool.map(run, range(free.size)) if self._pool else map(run, range(free.size)))
        error = np.array([column[0] for column in columns])
        spread = np.array([column[1] for column in columns])
        white = (base.errors / np.sqrt(base.variances)).ravel()
        back = np.linalg.inv(basis)
        gradient = back.T @ (error @ white + 0.5 * spread @ (1.0 - white**2))
        information = back.T @ (error @ error.T + 0.5 * spread @ spread.T) @ back
        weight = self._weight[free]
        gradient += weight * (point.theta - self._mean)[free]
        information = 0.5 * (information + information.T) + np.diag(weight)
        self.information[np.ix_(free, free)] = information
        return gradient, information

    def _basis(self, free: NDArray[np.int64]) -> Array:
        """Return a factor (k, k) of the covariance of the free unknowns; alpha never moves down along a column."""
        # What is hardly known must not be moved far: a tenth of its scale bounds the step.
        information = self.information[np.ix_(free, free)] + np.diag(self._floor[free])
        diagonal = np.sqrt(np.diag(information))
        values, vectors = np.linalg.eigh(information / np.outer(diagonal, diagonal))
        values = np.maximum(values, 1e-13 * values[-1])
        basis = vectors / np.sqrt(values) / diagonal[:, None]
        alpha = np.flatnonzero(free == self._alpha)
        if alpha.size:
            basis = basis * np.where(basis[alpha[0]] < 0.0, -1.0, 1.0)
        return np.asarray(basis)


def maximise(
    likelihood: Likelihood,
    start: Array,
    free: Sequence[int],
    iterations: int = 30,
    tolerance: float = 1e-2,
) -> Fit:
    """Return the maximum of the likelihood reached from ``start`` over the ``free`` unknowns.

    Steps are damped until the objective falls; an unknown at its bound stays there while the score points outward.
    """
    unknowns = likelihood.problem.unknowns
    places = np.array(list(free), dtype=np.int64)
    lower = np.array([unknowns[n].lower for n in places])
    upper = np.array([unknowns[n].upper for n in places])
    point = likelihood.at(start)
    damping, converged, done = likelihood.damping, False, 0
    information = np.eye(places.size)
    for _ in range(iterations):
        done += 1
        value = point.theta[places]
        gradient, information = likelihood.derivatives(point, places)
        held = ((value <= lower) & (gradient > 0.0)) | ((value >= upper) & (gradient < 0.0))
        before = point.objective
        point, damping = _step(likelihood, point, places, gradient, information, held, (lower, upper), damping)
        if before - point.objective < tolerance:
            # The first differences may have been taken too coarsely: look again with better ones.
            if before == point.objective and done == 1:
                damping = likelihood.damping
                continue
            converged = True
            break
    return Fit(point, places, information, inverse(information), done, converged)


def _step(
    likelihood: Likelihood,
    point: Point,
    places: NDArray[np.int64],
    gradient: Array,
    information: Array,
    held: NDArray[np.bool_],
    bounds: tuple[Array, Array],
    damping: float,
) -> tuple[Point, float]:
    """Return the next point and damping; the same point when no step lowers the objective."""
    open_ = np.flatnonzero(~held)
    diagonal = np.sqrt(np.maximum(np.diag(information)[open_], 1e-300))
    scaled = information[np.ix_(open_, open_)] / np.outer(diagonal, diagonal)
    for _ in range(16):
        move = np.linalg.solve(scaled + damping * np.eye(open_.size), -gradient[open_] / diagonal) / diagonal
        theta = point.theta.copy()
        theta[places[open_]] += move
        theta[places] = np.clip(theta[places], *bounds)
        new = likelihood.at(theta)
        if new.objective < point.objective:
            return new, max(damping * 0.1, 1e-12)
        damping *= 10.0
        if damping > 1e6:
            break
    return point, damping


def inverse(information: Array) -> Array:
    """Return the inverse of an information matrix, scaled first because units differ by many powers of ten."""
    diagonal = np.sqrt(np.maximum(np.diag(information), 1e-300))
    scaled = information / np.outer(diagonal, diagonal)
    return np.linalg.pinv(scaled, hermitian=True) / np.outer(diagonal, diagonal)


def with_least_torque_noise(problem: Problem, least: tuple[float, float]) -> Problem:
    """Return the problem with at least this much torque noise [N.m.s^0.5] at motor and load."""
    low = {f"log_torque_{side}": math.log(value) for side, value in zip(("motor", "load"), least, strict=True)}
    return replace(problem, unknowns=tuple(replace(u, lower=low.get(u.name, u.lower)) for u in problem.unknowns))


ALPHA = NAMES[P_ALPHA]
