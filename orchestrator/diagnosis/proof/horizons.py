"""How far ahead a model predicts: errors on data that no fit has seen, at several horizons.

A prediction starts from the predictor's estimate of the state, which has seen earlier samples only, and runs freely
over its horizon with the exact, event-located plant. Over two seconds, and over the whole part, the initial state is
the one that lies closest. All models of a diagnosis are started by the same filter: they differ in physics alone.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.proof.free_run import FreeRun, free_run
from orchestrator.diagnosis.proof.misfit import running
from orchestrator.diagnosis.proof.settings import HorizonSettings
from orchestrator.diagnosis.proof.simulation import Simulation
from orchestrator.shared.cores import spread
from orchestrator.shared.inference.long_run import mean_of
from orchestrator.shared.inference.normal import of_many
from orchestrator.shared.results.diagnose import HorizonFound

Array = NDArray[np.float64]
Runs = Sequence[tuple[FreeRun, slice]]  # with the samples that they cover
Chance = Callable[[Runs, Runs], Array]


@dataclass(frozen=True)
class Horizons:
    """Prediction errors of one model.

    Attributes:
        labels: of the horizons, the whole part last.
        errors: (horizons, channels) rms.
        plain: (horizons, channels) rms of a motion on at the speed that it starts with; NaN for the whole part.
        r_squared: (channels,) coefficient of determination of the run over the whole part.
        noise: (channels,) standard deviation of the measurement noise.
        squares: (starts, channels) squared errors of each horizon of many starts.
        runs: free runs of each longer horizon, and where they go.
        settings: when predictions get worse.
    """

    labels: tuple[str, ...]
    errors: Array
    plain: Array
    r_squared: Array
    noise: Array
    squares: tuple[Array, ...]
    runs: tuple[tuple[tuple[FreeRun, slice], ...], ...]
    settings: HorizonSettings

    def harm_over(self, other: "Horizons", chance: Chance | None = None) -> tuple[str, ...]:
        """Return the horizons at which this model predicts worse than another, beyond what chance does to one of them.

        Args:
            other: of the other model, over the same part.
            chance: (runs of this model, of the other) -> (channels,) largest increase of the mean squared error that
                torque noise explains where this model is true; None: measurement noise is all there is.

        Returns:
            Their labels.
        """
        settings, sure = self.settings, sure_of_one(self.settings)
        most = (
            np.where(np.isnan(other.errors), np.inf, other.errors) * (1.0 + settings.larger)
            + settings.of_noise * self.noise
        )
        worse = np.any(~(self.errors <= most), axis=1)
        for row, (change, scatter) in enumerate(self._changes_over(other)):
            worse[row] &= not change <= sure * scatter
        if chance is not None:
            for row, (mine, theirs) in enumerate(zip(self.runs, other.runs, strict=True), start=len(self.squares)):
                if worse[row]:
                    allowed = other.errors[row] ** 2 + chance(mine, theirs)
                    worse[row] = bool(np.any(~(self.errors[row] ** 2 <= np.maximum(most[row] ** 2, allowed))))
        return tuple(label for label, bad in zip(self.labels, worse, strict=True) if bad)

    def surely_better_than(self, other: "Horizons") -> tuple[str, ...]:
        """Return the horizons of many starts at which this model predicts better than another, beyond chance.

        Args:
            other: of the other model, over the same part.

        Returns:
            Their labels.
        """
        settings = self.settings
        many = len(self.squares)
        less = np.any(~(other.errors[:many] <= self.errors[:many] * (1.0 + settings.larger)), axis=1)
        changes = zip(self.labels, less, self._changes_over(other), strict=False)
        return tuple(label for label, enough, (mean, spread) in changes if enough and mean < -settings.sure * spread)

    def undecided_over(self, other: "Horizons") -> tuple[str, ...]:
        """Return the horizons of a few runs whose change is no larger than its scatter from run to run allows.

        Args:
            other: of the other model, over the same part.

        Returns:
            Their labels; one run has no scatter, and one that has run away decides: their horizons are not among them.
        """
        found = []
        for label, mine, theirs in zip(self.labels[len(self.squares) :], self.runs, other.runs, strict=True):
            pairs = list(zip(mine, theirs, strict=True))
            m = self.noise.size
            change = np.array([np.sum((a.rms[:m] ** 2 - b.rms[:m] ** 2) / self.noise**2) for (a, _), (b, _) in pairs])
            if len(pairs) > 1 and np.all(np.isfinite(change)):
                mean, error = mean_of(change)
                if mean <= self.settings.sure * error:
                    found.append(label)
        return tuple(found)

    def _changes_over(self, other: "Horizons") -> Iterator[tuple[float, float]]:
        """Yield, for each horizon of many starts, the mean change of the squared error and its standard error."""
        for own, before in zip(self.squares, other.squares, strict=True):
            if not np.all(np.isfinite(own)) or not np.all(np.isfinite(before)):  # a prediction has run away
                yield (-np.inf if np.all(np.isfinite(own)) else np.inf), 0.0
                continue
            change = np.sum((own - before) / self.noise**2, axis=1)
            yield mean_of(change)

    @property
    def long(self) -> int:
        """Return the first horizon that noise does not rule."""
        return 1 + sum(span < self.settings.ruled_by_noise for span in self.settings.spans)

    def least_skill_over(self, other: "Horizons") -> float:
        """Return the smallest share of the other model's squared error removed, at half a second and at the whole.

        Args:
            other: prediction errors of another model on the same samples.

        Returns:
            The share; negative where this model is worse.
        """
        own, before = (np.mean((h.errors[self.long :] / self.noise) ** 2, axis=1) for h in (self, other))
        return float(np.min(1.0 - own / before))

    def even_skill_over(self, other: "Horizons") -> float:
        """Return the smallest share removed of the other model's squared error, noise apart, beyond one sample.

        The whole part counts where there is no other long run only: an unstable motion is lost over it.

        Args:
            other: prediction errors of another model on the same samples.

        Returns:
            The share; negative where this model is worse.
        """
        removed = self._removed(other, 1)
        return float(np.min(removed[:-1] if len(self.runs) > 1 else removed))

    def skill_over(self, other: "Horizons", first: int | None = None) -> float:
        """Return the largest share of the other's squared error that this one removes, at horizons beyond noise.

        Args:
            other: prediction errors of another model on the same samples.
            first: horizon from which on they count; None: that which noise does not rule.

        Returns:
            The share; minus infinity where there is no such horizon.
        """
        return float(np.max(self._removed(other, self.long if first is None else first), initial=-np.inf))

    def _removed(self, other: "Horizons", first: int) -> Array:
        """Return, from horizon ``first`` on, the share removed of what the other's squared error has beyond noise."""
        own, before = (np.mean((h.errors[first:] / self.noise) ** 2, axis=1) - 1.0 for h in (self, other))
        return np.asarray(1.0 - np.maximum(own, 0.0) / np.maximum(before, 1e-9))

    def follows(self, share: float) -> bool:
        """Tell whether the model follows the motion: over the whole part, or over half a second and more.

        Args:
            share: of the variance, or of the squared error of a motion at constant speed, that it must explain.

        Returns:
            True when it does, for one signal at least.
        """
        with np.errstate(invalid="ignore", divide="ignore"):
            ahead = 1.0 - (self.errors[self.long :] / self.plain[self.long :]) ** 2
            return bool(np.any(self.r_squared > share) or np.any(ahead > share))

    def is_hopeless(self, share: float) -> bool:
        """Tell whether the model predicts hardly better than a motion at constant speed, and not the whole part.

        Args:
            share: of the plain error, and of the variance, that a model must beat.

        Returns:
            True when it is.
        """
        with np.errstate(invalid="ignore", divide="ignore"):
            better = np.any(self.errors < share * self.plain)
        return not bool(better) and not bool(np.any(self.r_squared > share))


def sure_of_one(settings: HorizonSettings) -> float:
    """Return the standard deviations that count at one horizon where several are asked.

    Args:
        settings: of the horizons.

    Returns:
        One of them exceeds it by chance as rarely as a single one would exceed ``sure``.
    """
    return of_many(settings.sure, len(settings.spans) + 3)  # beside a sample, a few seconds and the whole part


def horizons(likelihood: RecordLikelihood, p: Array, q: float, part: slice, long: bool = True) -> Horizons:
    """Return the prediction errors of a model on a part of a record.

    Args:
        likelihood: of the record.
        p: parameters of the model.
        q: process noise of the filter that estimates the states.
        part: the samples.
        long: False: of many starts alone, without the runs over seconds and the whole part, which cost most.

    Returns:
        The errors.
    """
    plant, signals, proof = likelihood.plant, likelihood.signals, likelihood.settings.proof
    settings, m, h = proof.horizons, signals.channels, signals.h
    _, states = likelihood.over(signals.size).innovations(p, q)
    model, stretches = Simulation(plant, p, signals), signals.stretches(part)
    spans = (0.0, *settings.spans)

    def ahead(span: float) -> tuple[Array, Array]:
        reach = max(1, min(round(span / h), min(rows.stop - rows.start for rows in stretches) // 3))
        return _predicted(model, states, _starts(stretches, reach, settings.starts), reach)

    squares, moved = zip(*spread(ahead, spans[::-1]), strict=True)  # the longest first
    squares, moved = squares[::-1], moved[::-1]
    labels = [f"{1e3 * span:g} ms" if span else "one sample" for span in spans]
    errors, plain = ([np.sqrt(np.mean(one, axis=0)) for one in each] for each in (squares, moved))
    none = np.full(m, np.nan)
    if not long:
        return Horizons(tuple(labels), np.array(errors), np.array(plain), none, signals.noise, squares, (), settings)

    def closest(rows: slice) -> tuple[FreeRun, slice]:
        return free_run(plant, p, states[rows.start], signals, rows, proof.free_run), rows

    pieces = running(part, signals, proof)
    pieces = pieces[:: math.ceil(len(pieces) / settings.most_segments)]
    pieces = pieces if len(pieces) > 1 else []
    ran = spread(closest, [*stretches, *pieces])  # the longest first
    runs = [tuple(some) for some in (ran[len(stretches) :], ran[: len(stretches)]) if some]
    if pieces:
        labels.append(f"{proof.segment:g} s")
        errors.append(np.sqrt(np.mean(np.square([run.rms[:m] for run, _ in runs[0]]), axis=0)))
        plain.append(none)
    rows_of = [rows.stop - rows.start for _, rows in runs[-1]]
    whole = np.sqrt(np.average([run.rms[:m] ** 2 for run, _ in runs[-1]], axis=0, weights=rows_of))
    spreads = [np.var(signals.y[rows, :m], axis=0) for _, rows in runs[-1]]
    r_squared = np.asarray(1.0 - whole**2 / np.maximum(np.average(spreads, axis=0, weights=rows_of), 1e-300))
    return Horizons(
        (*labels, "whole part"), np.array([*errors, whole]), np.array([*plain, none]), r_squared, signals.noise,
        squares, tuple(runs), settings,
    )  # fmt: skip


def is_driven(likelihood: RecordLikelihood, p: Array, found: Horizons, share: float) -> bool:
    """Tell whether the request of the drive is what makes a model follow the motion, over runs of a few seconds.

    Where a motion is unstable (a pendulum upright), a right model is lost over a longer part, and over half a second
    after a filter that knows the speed poorly. Over a few seconds from the closest state it follows, and does not
    without the drive.

    Args:
        likelihood: of the record.
        p: parameters of the model.
        found: its prediction errors.
        share: of the squared error without the drive that it must explain.

    Returns:
        True when it is, for one signal at least; False where the record is shorter than such a run.
    """
    signals, proof = likelihood.signals, likelihood.settings.proof
    if len(found.runs) < 2:
        return False
    coasting = replace(signals, u=np.zeros_like(signals.u))
    left = [
        (run.rms, free_run(likelihood.plant, p, run.start, coasting, piece, proof.free_run).rms)
        for run, piece in found.runs[0]
    ]
    own, without = (np.mean(np.square([pair[k][: signals.channels] for pair in left]), axis=0) for k in (0, 1))
    return bool(np.any(own < (1.0 - share) * without))


def _starts(stretches: Sequence[slice], reach: int, count: int) -> list[int]:
    """Return samples from which a prediction over ``reach`` samples stays in its stretch, spread over all of them."""
    each = max(2, count // len(stretches))
    found = [np.linspace(rows.start, rows.stop - reach - 1, each).astype(int) for rows in stretches]
    return np.unique(np.concatenate(found)).tolist()


def _predicted(model: Simulation, states: Array, starts: Sequence[int], reach: int) -> tuple[Array, Array]:
    """Return squared errors (starts, channels) of runs over ``reach`` samples, and of a motion on at constant speed."""
    signals, y = model.signals, model.measured
    bodies = model.plant.bodies[: signals.channels]
    angles, speeds = [body.angle for body in bodies], [body.speed for body in bodies]
    ran, moved = [], []
    for start in starts:
        truth = y[start + reach, : signals.channels]
        run = model.run(states[start], slice(start, start + reach + 1))
        ran.append(run[-1, : signals.channels] - truth)
        moved.append(states[start][angles] + reach * signals.h * states[start][speeds] - truth)
    return np.square(np.array(ran)), np.square(np.array(moved))


def table(names: Sequence[str], found: Sequence[Horizons]) -> tuple[HorizonFound, ...]:
    """Return one row a horizon for the result: its label and each model's error of each signal.

    Args:
        names: of the models.
        found: errors of each model.

    Returns:
        The rows.
    """
    signals = ("theta_m", "theta_l")
    return tuple(
        HorizonFound(
            label,
            tuple(
                {"model": name, **{s: float(e) for s, e in zip(signals, one.errors[row], strict=False)}}
                for name, one in zip(names, found, strict=True)
            ),
        )
        for row, label in enumerate(found[0].labels)
    )
