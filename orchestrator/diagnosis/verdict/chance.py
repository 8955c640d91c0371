"""What torque noise does to free runs: how much worse than another model a true one may predict by chance.

Over seconds a free run drifts under torques that are in no request, and a small effect that is really there may then
predict worse than no effect at all. There are too few such runs in a record to tell from their scatter. The torque that
the final model lacks is estimated (the filter's smoothed disturbance), drawn anew (turned round in time, its sign
changed, begun elsewhere: the spectrum stays), and sent through the exact plant. Its values are drawn within their
covariance: those of a true model are known to their standard errors only, and over seconds errors add up.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.proof.free_run import FreeRun, start_answers
from orchestrator.diagnosis.proof.horizons import Runs, sure_of_one
from orchestrator.diagnosis.proof.simulation import simulate
from orchestrator.diagnosis.verdict.where import missing_torque
from orchestrator.shared.cores import spread
from orchestrator.shared.inference.colour import WHITE

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TorqueNoise:
    """The torque noise of a model.

    Attributes:
        likelihood: of the record.
        model: the fit that is taken for true.
        torque: (n,) torque noise at the motor [N.m], mean zero.
        before: parameters of the model that it is compared with.
    """

    likelihood: RecordLikelihood
    model: Fit
    torque: Array
    before: Array

    @np.errstate(over="ignore", invalid="ignore")  # a draw of an unstable model is infinitely far off
    def __call__(self, mine: Runs, theirs: Runs) -> Array:
        """Return the largest increase (channels,) of the mean squared error of free runs that chance explains.

        Args:
            mine: free runs of the model.
            theirs: of the other model, over the same samples.
        """
        settings = self.likelihood.settings.proof.horizons
        pairs = [(own, other, part) for (own, part), (other, _) in zip(mine, theirs, strict=True)]
        bases = [
            (self._basis(self.model.p, own, part), self._basis(self.before, other, part)) for own, other, part in pairs
        ]

        def changed(draw: int) -> Array:
            total = np.zeros(self.likelihood.signals.channels)
            for (own, other, part), (basis, basis_of_other) in zip(pairs, bases, strict=True):
                drift = self.drift(own.start, own.outputs, part, draw)
                left = self._left(basis, drift)
                left_of_other = self._left(basis_of_other, drift + own.outputs - other.outputs)
                total += (np.mean(left**2, axis=0) - np.mean(left_of_other**2, axis=0)) / len(pairs)
            return total

        changes = np.array(spread(changed, range(settings.draws)))
        return np.asarray(np.mean(changes, axis=0) + sure_of_one(settings) * np.std(changes, axis=0))

    def _basis(self, p: Array, run: FreeRun, part: slice) -> Array:
        """Return an orthonormal basis (n * channels, places) of what a run's initial state can add to it."""
        likelihood = self.likelihood
        settings = likelihood.settings.proof.free_run
        answers = start_answers(likelihood.plant, p, run, likelihood.signals, part, settings)
        basis, _ = np.linalg.qr(answers / self._scale(len(run.outputs))[:, None])
        return basis if np.all(np.isfinite(basis)) else np.zeros_like(basis)

    def drift(self, start: Array, outputs: Array, part: slice, draw: int) -> Array:
        """Return (n, channels): what one draw of the torque noise, and of the model's values, adds to a free run.

        Args:
            start: (8,) initial state of the run.
            outputs: (n, channels) of the run.
            part: the samples that it covers.
            draw: number of the draw.

        Returns:
            What is added, in the units of the outputs.
        """
        plant, signals, p = self.likelihood.plant, self.likelihood.signals, self._values(draw)
        begin, end, _ = part.indices(signals.size)
        limit = plant.index(plant.drive.limit)
        u = np.clip(signals.u, -p[limit], p[limit])
        p[limit] = plant.table[limit].default  # the noise acts behind the limit
        u[begin:end] += self._requested(self._drawn(part, draw))
        run = simulate(plant, p, start, replace(signals, u=u), part)[:, : signals.channels]
        return np.nan_to_num(run - outputs)

    def _drawn(self, part: slice, draw: int) -> Array:
        """Return one draw (n,) of the torque noise over a part: runs that overlap see the same."""
        rng = np.random.default_rng(draw)
        turned = np.roll(self.torque, rng.integers(self.torque.size))[:: rng.choice((-1, 1))]
        return np.asarray(rng.choice((-1.0, 1.0)) * turned[np.arange(part.start, part.stop) % turned.size])

    def _values(self, draw: int) -> Array:
        """Return one draw (parameters,) of the model's values, within their covariance and bounds."""
        p, covariance = self.model.p.copy(), self.model.covariance
        if not np.all(np.isfinite(covariance)):
            return p
        variances, axes = np.linalg.eigh(covariance)
        normal = np.random.default_rng([draw, 1]).standard_normal(len(variances))
        for entry, change in zip(self.model.free, axes @ (np.sqrt(np.maximum(variances, 0.0)) * normal), strict=True):
            p[entry.place] = min(max(p[entry.place] + change, entry.minimum), entry.maximum)
        return p

    def _requested(self, torque: Array) -> Array:
        """Return the request (n,) that becomes ``torque`` behind the lag of the drive."""
        plant, h = self.likelihood.plant, self.likelihood.signals.h
        lag = plant.value(self.model.p, plant.drive.lag)
        pole = np.exp(-h / lag) if lag > 0.0 else 0.0
        return np.asarray((np.append(torque[1:], torque[-1]) - pole * torque) / (1.0 - pole))

    def _scale(self, size: int) -> Array:
        return np.asarray(np.tile(self.likelihood.signals.noise, size))

    def _left(self, basis: Array, errors: Array) -> Array:
        """Return what is left (n, channels) of ``errors`` once the initial state lies closest."""
        scaled = errors.ravel() / self._scale(len(errors))
        return np.asarray(((scaled - basis @ (basis.T @ scaled)) * self._scale(len(errors))).reshape(errors.shape))


def torque_noise(likelihood: RecordLikelihood, model: Fit, part: slice, before: Array) -> TorqueNoise:
    """Return the torque noise that a model leaves on a part of a record.

    Args:
        likelihood: of the record.
        model: the model that is taken for true.
        part: the samples that it was fitted to.
        before: parameters of the model that it is compared with.

    Returns:
        The noise.
    """
    fits = []
    for level in likelihood.settings.levels:
        z = likelihood.whitened(model.p, level)
        fits.append(
            replace(model, q=level, z=z, colour=WHITE, fitted=likelihood.log_likelihood(z, level, part, None, model.p))
        )
    missing = missing_torque(likelihood, max(fits, key=lambda fit: fit.fitted))
    settled, ratio = likelihood.settings.likelihood.settled, likelihood.plant.ratio(model.p)
    torque = sum(
        values / (1.0 if site == "torque of the motor" else ratio)
        for site, values in missing.torque.items()
        if "shaft" not in site
    )
    inside = np.asarray(torque)[max(part.start - settled, 0) : part.stop - settled]
    return TorqueNoise(likelihood, model, np.asarray(inside - np.mean(inside)), before)
