"""How likely a free run is: whitened residuals, priors, differences, and the step that they ask for."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.bank import CUT
from orchestrator.diagnosis.blackbox.model import BoxModel
from orchestrator.diagnosis.blackbox.parts import BoxParts, Rows
from orchestrator.diagnosis.blackbox.problem import BoxProblem
from orchestrator.diagnosis.blackbox.settings import DEFAULT, BoxSettings
from orchestrator.diagnosis.blackbox.whitening import Ladder
from orchestrator.shared.inference.inverse import pseudo_inverse

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BoxFit:
    """A fitted model.

    Attributes:
        model: its structure and values.
        level: port noise that it needs, as its place in the ladder.
        y: (rows, outputs) its free run.
        gains: log-likelihood on the fitted and the deciding part.
        J: (rows, outputs, values) its Jacobian, in units of the noise, as last computed.
    """

    model: BoxModel
    level: int
    y: Array
    fitted: float
    decided: float
    prior: float
    J: Array

    @property
    def total(self) -> float:
        """Return the log-likelihood of both parts, with the prior."""
        return self.fitted + self.decided + self.prior


class BoxLikelihood:
    """Judges models of one problem by one part of its record.

    Args:
        problem: what is fitted.
        ladder: filters.
        parts: of the record.
        settings: thresholds.
    """

    def __init__(self, problem: BoxProblem, ladder: Ladder, parts: BoxParts, settings: BoxSettings = DEFAULT) -> None:
        self.problem, self.ladder, self.parts, self.settings = problem, ladder, parts, settings
        self.sd = np.array([u.standard_deviation for u in problem.map.uncertain])
        self.mean = problem.nominal.p
        self.lower = np.array([u.minimum for u in problem.map.uncertain])
        self.upper = np.array([u.maximum for u in problem.map.uncertain])
        self._steep: dict[str, float] = {}  # what a value changed of the outputs at last, for one of its unit

    def likelihood(self, e: Array, k: int, rows: Rows) -> float:
        """Return the log-likelihood of whitened residuals (n, outputs) over ``rows``, without its constant.

        Args:
            e: whitened residuals.
            k: level of port noise, from 0.
            rows: samples that count.

        Returns:
            The log-likelihood.
        """
        found = e[rows]
        return float(-0.5 * np.sum(found * found) - np.sum(self.ladder[k].half_log[rows]))

    def prior(self, model: BoxModel) -> float:
        """Return the logarithm of the prior.

        Args:
            model: parameters, effects and their values.

        Returns:
            The logarithm, without its constant.
        """
        z = (model.p - self.mean) / self.sd
        return float(-0.5 * z @ z)

    def whitened(self, y: Array, k: int) -> Array:
        """Return the whitened residual (rows, outputs) of a free run.

        Args:
            y: (rows, outputs) free run of the model.
            k: level of port noise, from 0.

        Returns:
            The residual, each sample of unit variance if the model is right.
        """
        return self.ladder[k].whiten(self.problem.residual(y)[:, :, None])[:, :, 0]

    def best_level(self, y: Array, rows: Rows, among: Sequence[int] | None = None) -> int:
        """Return the level at which a free run is likeliest over ``rows``.

        Args:
            y: (rows, outputs) free run of the model.
            rows: samples that count.
            among: levels to choose from (default: all).

        Returns:
            The level.
        """
        among = range(self.ladder.size) if among is None else among
        return max(among, key=lambda k: self.likelihood(self.whitened(y, k), k, rows))

    def bounded(self, vector: Array) -> Array:
        """Return values within the FMU's own bounds.

        Args:
            vector: (values,) parameters first.

        Returns:
            A copy.
        """
        out = vector.copy()
        n = len(self.mean)
        out[:n] = np.clip(out[:n], self.lower, self.upper)
        return out

    def scales(self, model: BoxModel) -> Array:
        """Return the step of each value for differences: as given, or less where that changes the outputs by much.

        A motion that is sensitive (a pendulum that turns over) is linear over small changes alone.

        Args:
            model: parameters, effects and their values.

        Returns:
            Shape (values,).
        """
        given = np.concatenate(
            [
                self.sd * self.settings.fit.difference,
                *(np.array(e.scales(v)) for e, v in zip(model.effects, model.values, strict=True)),
            ]
        )
        if any(e.kind.where == CUT for e in model.effects):
            return given  # contact comes and goes: small changes tell of the nearest one alone
        steep = np.array([self._steep.get(name, 0.0) for name in _names(model)])
        least = self.settings.fit.least_step * given  # rounding rules over shorter ones
        return np.clip(self.settings.fit.wild / np.maximum(steep, 1e-300), least, given)

    def jacobian(self, model: BoxModel, y: Array, only: slice | None = None) -> Array | None:
        """Return differences (rows, outputs, values) of the free run, in units of the noise; None where a run fails.

        Args:
            model: parameters, effects and their values.
            y: (rows, outputs) free run of the model.
            only: which of the values (default: all).

        Returns:
            The differences.
        """
        places, names = list(range(len(model.vector)))[only or slice(None)], _names(model)
        J = self._differences(model, y, places)
        if J is None:
            return None
        steep, steps = np.sqrt(np.mean(J * J, axis=(0, 1))), self.scales(model)[places]
        self._steep |= {names[k]: float(value) for k, value in zip(places, steep, strict=True) if np.isfinite(value)}
        wild = np.flatnonzero(steep * steps > 2.0 * self.settings.fit.wild)
        finer = self._differences(model, y, [places[at] for at in wild]) if wild.size else None
        if finer is not None:
            J[:, :, wild] = finer
            self._steep |= {names[places[at]]: float(np.sqrt(np.mean(J[:, :, at] ** 2))) for at in wild}
        return J

    def _differences(self, model: BoxModel, y: Array, places: Sequence[int]) -> Array | None:
        """Return the differences (rows, outputs, places) by some of the values; None where a run fails."""
        z, steps, models = model.vector, self.scales(model), []
        for k in places:
            trial = z.copy()
            trial[k] += steps[k] if z[k] + steps[k] <= self._high(k) else -steps[k]
            models.append(model.moved(trial))
        found = self.problem.simulate(models, len(y))
        J = np.zeros((*y.shape, len(places)))
        for at, (k, run, trial_model) in enumerate(zip(places, found, models, strict=True)):
            if run is None:
                return None
            J[:, :, at] = (run - y) / self.problem.noise / (trial_model.vector[k] - z[k])
        return J

    def _high(self, k: int) -> float:
        return float(self.upper[k]) if k < len(self.upper) else np.inf

    def step(self, model: BoxModel, y: Array, J: Array, k: int, rows: Rows, damping: float) -> Array:
        """Return the damped Gauss-Newton step of all values.

        Args:
            model: parameters, effects and their values.
            y: (rows, outputs) free run of the model.
            J: (rows, outputs, values) Jacobian of the free run, in units of the noise.
            k: level of port noise, from 0.
            rows: samples that count.
            damping: Levenberg's, without unit.

        Returns:
            Shape (values,).
        """
        whitened = self.ladder[k].whiten(np.concatenate([self.problem.residual(y)[:, :, None], J], axis=2))[rows]
        flat = whitened.reshape(-1, whitened.shape[2])
        e, columns = flat[:, 0], flat[:, 1:]
        N, g = columns.T @ columns, columns.T @ e
        count = len(self.mean)
        N[range(count), range(count)] += 1.0 / self.sd**2
        g[:count] -= (model.p - self.mean) / self.sd**2
        scale = np.sqrt(np.maximum(np.diag(N), 1e-300))
        N = N / scale / scale[:, None]
        N[range(len(N)), range(len(N))] += damping + 1e-12
        return np.asarray(np.linalg.solve(N, g / scale) / scale)

    def horizon(self, y: Array) -> int:
        """Return the row up to which a free run keeps close to the record.

        Args:
            y: (rows, outputs) free run of the model.

        Returns:
            The row; the run's length when it never leaves.
        """
        scale = (
            self.settings.fit.astray * np.std(self.problem.data.outputs[: self.parts.seen], axis=0) / self.problem.noise
        )
        far = np.any(np.abs(self.problem.residual(y)) > np.maximum(scale, self.settings.fit.astray_noise), axis=1)
        return int(np.argmax(far)) if far.any() else len(y)

    def covariance(self, fit: BoxFit, rows: Rows) -> Array:
        """Return the covariance of all values.

        Args:
            fit: whose Jacobian is known over ``rows``.
            rows: samples that count.

        Returns:
            Shape (values, values).
        """
        whitened = self.ladder[fit.level].whiten(fit.J)[rows]
        columns = whitened.reshape(-1, whitened.shape[2])
        N = columns.T @ columns
        count = len(self.mean)
        N[range(count), range(count)] += 1.0 / self.sd**2
        scale = np.sqrt(np.maximum(np.diag(N), 1e-300))
        return np.asarray(pseudo_inverse(N / scale / scale[:, None], rcond=1e-13) / scale / scale[:, None])


def _names(model: BoxModel) -> list[str]:
    """Return a name of each value of a model: parameters by their places, those of effects by their labels."""
    of_effects = [f"{e.label} {n}" for e, v in zip(model.effects, model.values, strict=True) for n in range(len(v))]
    return [*(str(n) for n in range(len(model.p))), *of_effects]
