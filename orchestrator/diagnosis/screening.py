"""Starting values: how much each effect, alone and linearised, would explain of what a model leaves.

The response to an effect is taken by difference at the fitted model, what the free linear parameters could explain
as well is projected out (their Jacobian is known from the fit), and the rest is regressed on what is left.
"""

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from orchestrator.diagnosis.bank import Effect, Scene
from orchestrator.diagnosis.fitting import Fit, Parts, jacobian
from orchestrator.diagnosis.likelihood import Likelihood, Signals
from orchestrator.diagnosis.plants import Plant

Array = NDArray[np.float64]

PERIODIC = {"torque_ripple": False, "gear_eccentricity": True}  # name -> acts on the shaft
PEAKS = 5
HIGHEST = 60.0  # cycles per revolution that are looked for
HIGHEST_PER_TRAVEL = 300.0  # or cycles over the whole travel, where that is more
TRUST = 0.6  # regression is followed only so far: the response is linear near zero only


@dataclass(frozen=True)
class Guess:
    """Starting values of one effect and the gain in log-likelihood that the linearised model promises."""

    values: dict[str, float]
    gain: float


class Screen:
    """Screens effects against one fitted model."""

    def __init__(self, likelihood: Likelihood, plant: Plant, model: Fit, parts: Parts) -> None:
        """Take the Jacobian of the model's free parameters once."""
        self._likelihood, self._plant, self._model, self._part = likelihood, plant, model, parts.fitted
        e = model.z[parts.fitted]
        self._root = np.linalg.inv(np.linalg.cholesky(e.T @ e / len(e)))
        J = jacobian(likelihood, model.p, model.q, model.free, model.z, parts.fitted)
        columns = (self._root @ J).reshape(J.shape[0] * J.shape[1], len(model.free))
        prior = np.diag([f.scale / f.prior[1] if f.prior else 0.0 for f in model.free])
        self._basis, _ = np.linalg.qr(np.vstack([columns, prior]))
        self._basis = self._basis[: columns.shape[0]]
        self._residual = self._clean(self._white(model.z))

    @np.errstate(over="ignore", invalid="ignore")  # a start may be unstable; it promises nothing then
    def guesses(self, effect: Effect, scene: Scene) -> tuple[Guess, ...]:
        """Return the most promising starting values of an effect, best first; none when nothing promises a gain."""
        starts = effect.starts(scene)
        best: dict[float, Guess] = {}  # by the first parameter: neighbouring starts would end in the same fit
        for combination in itertools.product(*starts.values()):
            values = dict(zip(starts, combination, strict=True))
            found = self._amplitudes(effect, values, scene) if effect.amplitudes else self._as_is(effect, values)
            first = combination[0] if combination else 0.0
            if found is None or not np.isfinite(found.gain):
                continue
            if first not in best or found.gain > best[first].gain:
                best[first] = found
        return tuple(sorted(best.values(), key=lambda guess: guess.gain, reverse=True)[: effect.tries])

    def _as_is(self, effect: Effect, values: dict[str, float]) -> Guess | None:
        response = self._run(effect, values)
        if not np.all(np.isfinite(response)):
            return None
        left = self._clean(self._white(response))
        gain = 0.5 * float(self._residual @ self._residual - left @ left)
        return Guess(values, gain)

    def _amplitudes(self, effect: Effect, values: dict[str, float], scene: Scene) -> Guess | None:
        unit = effect.unit_of_size(scene)
        zero = self._white(self._model.z)
        trials = self._trials(effect, values, unit)
        columns = np.column_stack([self._clean(self._white(self._run(effect, t)) - zero) for t in trials])
        if not np.all(np.isfinite(columns)):
            return None
        size, *_ = np.linalg.lstsq(columns, -self._residual, rcond=None)
        if effect.phase:
            amplitude = unit * float(np.hypot(*size))
            found = {effect.amplitudes[0]: amplitude, effect.phase: float(np.arctan2(size[1], size[0]))}
        else:
            minimum = self._plant.entry(effect.places(self._plant)[effect.size]).minimum
            size = np.maximum(size, 0.0) if minimum >= 0.0 else size
            found = {name: unit * float(s) for name, s in zip(effect.amplitudes, size, strict=True)}
        left = self._residual + columns @ size
        gain = 0.5 * float(self._residual @ self._residual - left @ left)
        if not np.any(size):
            return None
        return Guess(values | found, gain)

    def _trials(self, effect: Effect, values: dict[str, float], unit: float) -> list[dict[str, float]]:
        if effect.phase:
            first = effect.amplitudes[0]
            return [values | {first: unit, effect.phase: 0.0}, values | {first: unit, effect.phase: 0.5 * np.pi}]
        zeros = dict.fromkeys(effect.amplitudes, 0.0)
        return [values | zeros | {name: unit} for name in effect.amplitudes]

    def _run(self, effect: Effect, values: dict[str, float]) -> Array:
        p = effect.put(self._plant, self._model.p, values, [free.place for free in self._model.free])
        return self._likelihood.whitened(p, self._model.q)

    def _white(self, z: Array) -> Array:
        return np.asarray((z[self._part] @ self._root.T).ravel())

    def _clean(self, vector: Array) -> Array:
        return np.asarray(vector - self._basis @ (self._basis.T @ vector))


def scene_of(likelihood: Likelihood, plant: Plant, model: Fit) -> Scene:
    """Return the sizes of the record's signals under a fitted model."""
    signals = likelihood.signals
    _, states = likelihood.innovations(model.p, model.q)
    x = states[20:]
    turns = float(np.ptp(x[:, 0])) / (2.0 * np.pi)
    speed_m = float(np.sqrt(np.mean(x[:, 1] ** 2)))
    if "k" not in plant.names:
        inertia = float(model.p[plant.index("J")])
        return Scene(signals.h, signals.torque, signals.u, speed_m, speed_m, 1.0, inertia, 1.0, 1.0, turns)
    ratio = float(model.p[plant.index("i")])
    twist = float(np.quantile(np.abs(x[:, 0] / ratio - x[:, 2]), 0.995))
    speed_l = float(np.sqrt(np.mean(x[:, 3] ** 2)))
    inertia, stiffness = float(likelihood.nominal[plant.index("J_l")]), float(likelihood.nominal[plant.index("k")])
    return Scene(signals.h, signals.torque, signals.u, speed_m, speed_l, twist, inertia, stiffness, ratio, turns)


def with_cycles(scene: Scene, likelihood: Likelihood, plant: Plant, model: Fit, parts: Parts) -> Scene:
    """Return the scene with the peaks of the frequency scan of each periodic effect."""
    raw, states = likelihood.innovations(model.p, model.q)
    part = parts.fitted
    theta, omega = states[part, 0], states[part, 1]
    turns = float(np.ptp(theta)) / (2.0 * np.pi)
    if turns < 1e-6:
        return scene
    response = error_response(likelihood, plant, model)
    effort = back_propagated(response, raw[part, : likelihood.signals.channels])
    cycles = cycle_grid(turns, likelihood.signals.h, scene.speed_m)
    found = {}
    for name, shaft in PERIODIC.items():
        column = 1 if shaft else 0
        if column >= effort.shape[1]:
            continue
        power = _scan(np.ascontiguousarray(effort[:, column]), theta, omega, cycles, *_gain_table(response, column))
        found[name] = tuple(float(c) for c in _peaks(cycles, power))
    return replace(scene, cycles=found)


def cycle_grid(turns: float, h: float, speed: float) -> Array:
    """Return the cycles per revolution to look at, for a travel in revolutions, a sample time [s] and an rms speed."""
    # Lines closer than the reciprocal of the travel cannot be told apart: three points per such width.
    spacing = 1.0 / (3.0 * turns)
    highest = min(max(HIGHEST, HIGHEST_PER_TRAVEL / turns), 2.4 * np.pi / h / max(speed, 1e-9))
    cycles = np.arange(min(0.7 / turns, 0.5 * highest), highest, spacing)
    return np.asarray(cycles[:: max(1, cycles.size // 3000)])


@dataclass(frozen=True)
class ErrorResponse:
    """How whitened innovations answer to a torque: ``xi+ = F xi + B torque``, ``e = -W xi``.

    B has one column for a torque on the motor, one for a twist of the shaft (k times a twist error) and one for a
    torque on the load; a single axis has the first alone.
    """

    F: Array
    B: Array
    W: Array
    h: float


def error_response(likelihood: Likelihood, plant: Plant, model: Fit) -> ErrorResponse:
    """Return the linear, steady-state response of the innovations, at the fitted model's process noise."""
    h, p = likelihood.signals.h, model.p
    table = likelihood.gains(model.q)
    rows = list(plant.states)
    at = {place: row for row, place in enumerate(plant.states)}
    m = likelihood.signals.channels
    gain, root = table.gains[likelihood.stop - 1][rows][:, :m], table.roots[likelihood.stop - 1]
    C = np.zeros((m, len(rows)))
    for channel in range(m):
        C[channel, at[plant.measured[channel]]] = 1.0
    A = plant.transition(p, h)
    columns = np.zeros((len(rows), 3 if "k" in plant.names else 1))
    columns[at[1], 0] = 1.0 / p[plant.index(plant.pushed[0][1])]
    if "k" in plant.names:
        k, ratio = p[plant.index("k")], p[plant.index("i")]
        columns[at[1], 1] = -k / ratio / p[plant.index("J_m")]
        columns[at[3], 1] = k / p[plant.index("J_l")]
        columns[at[3], 2] = 1.0 / p[plant.index("J_l")]
    jac = plant.jacobian(p)
    B = (np.eye(len(rows)) * h + jac * h**2 / 2) @ columns
    e = model.z
    white = np.linalg.inv(np.linalg.cholesky(e.T @ e / len(e)))
    return ErrorResponse(A @ (np.eye(len(rows)) - gain @ C), B, white @ root @ C, h)


def back_propagated(response: ErrorResponse, raw: Array) -> Array:
    """Return (n, columns of B): what a unit torque at each sample would have changed of half the squared error."""
    measured = np.flatnonzero(np.any(response.W != 0.0, axis=0))
    e = raw @ response.W[:, measured].T
    return np.asarray(_adjoint(np.ascontiguousarray(e), response.F, response.B, response.W))


@njit(cache=True)
def _adjoint(e: Array, F: Array, B: Array, W: Array) -> Array:
    n = e.shape[0]
    out = np.zeros((n, B.shape[1]))
    costate = np.zeros(F.shape[0])
    for t in range(n - 1, -1, -1):
        out[t] = B.T @ costate
        costate = F.T @ costate - W.T @ e[t]
    return out


def _gain_table(response: ErrorResponse, column: int) -> tuple[Array, float]:
    """Return |response|^2 on a grid of frequencies [rad/s] and the grid's spacing."""
    top = np.pi / response.h
    grid = np.linspace(0.0, top, 400)
    identity = np.eye(response.F.shape[0])
    gains = []
    for w in grid:
        line = np.linalg.solve(np.exp(1j * w * response.h) * identity - response.F, response.B[:, column])
        gains.append(float(np.sum(np.abs(response.W @ line) ** 2)))
    return np.array(gains), float(grid[1])


@njit(cache=True, parallel=False)
def _scan(effort: Array, theta: Array, omega: Array, cycles: Array, gains: Array, spacing: float) -> Array:
    """Return the gain in log-likelihood of a line at each number of cycles per revolution."""
    power = np.empty(cycles.size)
    last = gains.size - 1
    for n in prange(cycles.size):
        a, b, norm = 0.0, 0.0, 0.0
        for t in range(effort.size):
            angle = cycles[n] * theta[t]
            a += effort[t] * np.sin(angle)
            b += effort[t] * np.cos(angle)
            at = int(abs(cycles[n] * omega[t]) / spacing)
            norm += gains[at] if at <= last else 0.0
        power[n] = (a * a + b * b) / norm if norm > 0.0 else 0.0
    return power


def _peaks(cycles: Array, power: Array) -> Array:
    """Return the places of the highest separate peaks."""
    order = np.argsort(power)[::-1]
    chosen: list[int] = []
    for at in order:
        if all(abs(int(at) - other) > 3 for other in chosen):
            chosen.append(int(at))
        if len(chosen) == PEAKS:
            break
    return cycles[chosen]


def line_spectrum(
    likelihood: Likelihood, plant: Plant, model: Fit, parts: Parts, cycles: Array, column: int = 0
) -> Array:
    """Return the promised gain in log-likelihood of a line at each of ``cycles`` (for the report's evidence)."""
    raw, states = likelihood.innovations(model.p, model.q)
    part = parts.fitted
    response = error_response(likelihood, plant, model)
    effort = back_propagated(response, raw[part, : likelihood.signals.channels])
    return np.asarray(
        _scan(
            np.ascontiguousarray(effort[:, column]),
            states[part, 0],
            states[part, 1],
            cycles,
            *_gain_table(response, column),
        )
    )


__all__ = ["ErrorResponse", "Guess", "Screen", "Signals", "error_response", "line_spectrum", "scene_of", "with_cycles"]
