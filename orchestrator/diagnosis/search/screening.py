"""Starting values: how much each effect, alone and linearised, would explain of what a model leaves.

The response to an effect is taken by difference at the fitted model, what the free linear parameters could explain
as well is projected out (their Jacobian is known from the fit), and the rest is regressed on what is left.
"""

import itertools
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts, reaching_back
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.slope import taken
from orchestrator.plants.effects import Effect, Scene
from orchestrator.shared.inference.colour import ORDERS, Colour

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Guess:
    """Starting values of one effect and the gain in log-likelihood that the linearised model promises."""

    values: dict[str, float]
    gain: float


class Screen:
    """Screens effects against one fitted model."""

    def __init__(self, likelihood: RecordLikelihood, model: Fit, parts: Parts) -> None:
        """Take the Jacobian of the model's free parameters once; the model's colour whitens innovations."""
        self._plant, self._model, self._part = likelihood.plant, model, parts.fitted
        self._likelihood = likelihood.over(min(likelihood.stop, parts.fitted.stop))  # nothing else is looked at
        self._wide, self._inner = reaching_back(parts.fitted, ORDERS[-1])
        self._columns = taken(likelihood, model.p, model.q, model.free, model.z, self._wide).columns
        self._ran: dict[tuple[str, tuple[float, ...]], Array] = {}  # responses, for screens in other colours
        self._take(model.colour)

    def coloured(self, colour: Colour) -> "Screen":
        """Return the same screen for innovations of another colour.

        Args:
            colour: autoregression of the innovations.

        Returns:
            The screen; responses that either has run serve both.
        """
        other = copy(self)
        other._take(colour)
        return other

    def _take(self, colour: Colour) -> None:
        """Take what is regressed on, whitened by ``colour``."""
        model, self._colour = self._model, colour
        J = colour.white(self._columns, self._inner)
        columns = J.reshape(J.shape[0] * J.shape[1], len(model.free))
        self._pull = np.array([(model.p[f.place] - f.prior[0]) / f.prior[1] if f.prior else 0.0 for f in model.free])
        prior = np.diag([f.scale / f.prior[1] if f.prior else 0.0 for f in model.free])
        self._basis, _ = np.linalg.qr(np.vstack([columns, prior]))
        self._residual = self._clean(self._white(model.z))

    @np.errstate(over="ignore", invalid="ignore")  # a start may be unstable; it promises nothing then
    def guesses(self, effect: Effect, scene: Scene) -> tuple[Guess, ...]:
        """Return the most promising starting values of an effect, best first; none when nothing promises a gain.

        Args:
            effect: of the bank.
            scene: sizes of the record's signals.

        Returns:
            The guesses.
        """
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
            entry = self._plant.entry(effect.places(self._plant)[effect.size])
            low, high = effect.bounds(scene).get(effect.size, (entry.minimum, entry.maximum))
            size = np.clip(size, 0.0 if low >= 0.0 else -np.inf, 0.0 if high <= 0.0 else np.inf)
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
        key = effect.label, tuple(values.values())
        if key not in self._ran:
            p = effect.put(self._plant, self._model.p, values, [free.place for free in self._model.free])
            self._ran[key] = self._likelihood.whitened(p, self._model.q)
        return self._ran[key]

    def _white(self, z: Array) -> Array:
        return np.concatenate([self._colour.white(z, self._part).ravel(), self._pull])

    def _clean(self, vector: Array) -> Array:
        return np.asarray(vector - self._basis @ (self._basis.T @ vector))
