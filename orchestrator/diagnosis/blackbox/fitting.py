"""Fits: Gauss-Newton on whitened residuals of free runs, with priors, the level of port noise chosen as it goes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.problem import BoxModel, BoxProblem
from orchestrator.diagnosis.blackbox.settings import DEFAULT, BoxSettings
from orchestrator.diagnosis.blackbox.whitening import Ladder

Array = NDArray[np.float64]

Rows = slice | NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class BoxParts:
    """Rows that are fitted, that decide, and that are held out."""

    fitted: Rows
    decides: Rows
    held_out: Rows

    @property
    def looked_at(self) -> NDArray[np.int64]:
        """Return the rows that are fitted or decide, in order."""
        rows = [np.arange(p.start, p.stop) if isinstance(p, slice) else p for p in (self.fitted, self.decides)]
        return np.sort(np.concatenate(rows))

    @property
    def seen(self) -> int:
        """Return the number of rows that the search runs over."""
        return int(self.looked_at[-1]) + 1

    @property
    def reach(self) -> int:
        """Return the row at which the fitted part ends."""
        return int(self.fitted.stop if isinstance(self.fitted, slice) else self.fitted[-1] + 1)


def parts_of(n: int) -> BoxParts:
    """Return half, a quarter and a quarter.

    Args:
        n: samples of the record.

    Returns:
        The fitted, the deciding and the held-out part.
    """
    return BoxParts(slice(0, n // 2), slice(n // 2, 3 * n // 4), slice(3 * n // 4, n))


def interleaved(n: int, pieces: int, whole: bool = False) -> BoxParts:
    """Return parts of the first three quarters that take turns: for what acts in one half only.

    ``whole``: of all of it, every fourth one held out: for what acts in the last quarter only.

    Args:
        n: samples of the record.
        pieces: that it is cut into.

    Returns:
        The parts, the held-out one last.
    """
    if whole:
        turn = np.arange(n) * pieces // n % 4
        return BoxParts(np.flatnonzero(turn % 2 == 0), np.flatnonzero(turn == 1), np.flatnonzero(turn == 3))
    seen = 3 * n // 4
    piece = np.arange(seen) * pieces // seen
    return BoxParts(np.flatnonzero(piece % 3 != 1), np.flatnonzero(piece % 3 == 1), slice(seen, n))


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


class Fitter:
    """Fits models of one problem to one part of its record.

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
        """Return the step of each value for differences.

        Args:
            model: parameters, effects and their values.

        Returns:
            Shape (values,).
        """
        return np.concatenate(
            [
                self.sd * self.settings.fit.difference,
                *(np.array(e.scales(v)) for e, v in zip(model.effects, model.values, strict=True)),
            ]
        )

    def jacobian(self, model: BoxModel, y: Array, only: slice | None = None) -> Array | None:
        """Return differences (rows, outputs, values) of the free run, in units of the noise; None where a run fails.

        Args:
            model: parameters, effects and their values.
            y: (rows, outputs) free run of the model.
            only: which of the values (default: all).

        Returns:
            The differences.
        """
        z, steps = model.vector, self.scales(model)
        places = list(range(len(z)))[only or slice(None)]
        models = []
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

    def fit(
        self,
        model: BoxModel,
        k: int,
        J: Array | None = None,
        rows: Rows | None = None,
        iterations: int | None = None,
        until: int | None = None,
        y: Array | None = None,
        held: int = 0,
    ) -> BoxFit | None:
        """Return the fit from a start; None where the FMU fails.

        Args:
            model: where it starts.
            k: level of port noise that it starts at.
            J: Jacobian of the leading values, if known already.
            rows: what is fitted (default: the fitted part).
            iterations: at most (default: of the settings).
            until: rows that are simulated (default: what the search may see).
            y: its free run, if known already.
            held: iterations for which the level stays what it is.

        Returns:
            The fit.
        """
        rows = self.parts.fitted if rows is None else rows
        until = self.parts.seen if until is None else until
        if y is None:
            y = self.problem.simulate([model], until)[0]
        if y is None:
            return None
        J = self._completed(model, y, J)
        if J is None:
            return None
        value = self.likelihood(self.whitened(y, k), k, rows) + self.prior(model)
        own = self.settings.fit
        damping, fresh = 1e-6, False
        for turn in range(own.iterations if iterations is None else iterations):
            moved = self._moved(model, y, J, k, rows, damping, value, until)
            if moved is None:
                if fresh and damping > 1.0:
                    break
                damping = max(30 * damping, 1e-3)
            else:
                gained = moved[2] - value
                expected = self._expected
                J = _updated(J, model.vector, moved[0].vector, y, moved[1], self.problem.noise)
                model, y, value = moved
                damping = max(damping / 10, 1e-6)
                better = k if turn < held else self.best_level(y, rows, self.ladder.near(k))
                if better != k:
                    k = better
                    value = self.likelihood(self.whitened(y, k), k, rows) + self.prior(model)
                elif gained < own.enough and fresh:
                    break
                fresh = False
                if gained > own.as_expected * expected > self.settings.search.penalty:
                    continue
            if not fresh:
                again = self.jacobian(model, y)
                if again is None:
                    break
                J, fresh = again, True
        return self._result(model, k, y, J, rows)

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

    def grown(self, model: BoxModel, k: int, J: Array | None = None, held: int = 0) -> BoxFit | None:
        """Return the fit from a start, over a growing part of the record while the free run goes astray.

        A free run that has left the record says nothing about how to come back: the part over which it keeps close is
        fitted first, and reaches further afterwards.

        Args:
            model: parameters, effects and their values.
            k: level of port noise, from 0.
            J: Jacobian of the leading values, if known already.
            held: iterations for which the level stays what it is.

        Returns:
            The fit; None where the FMU fails.
        """
        rows, reach = self.parts.fitted, self.parts.reach
        y = self.problem.simulate([model], self.parts.seen)[0]
        if y is None:
            return None
        stop = self.horizon(y)
        for _ in range(self.settings.fit.stages):
            if stop >= reach:
                break
            longer = self._longer(model, y, stop)
            if longer is None:
                break
            model, y, J = *longer, None
            stop = self.horizon(y)
        if J is None:
            k = self.best_level(y, rows)
        # What cannot be led to the end is left where it keeps close the longest: others start from there.
        lost = stop < self.settings.fit.lost * reach and self.ladder.share(k) >= self.ladder.shares[-2]
        return self.fit(model, k, J, held=held, y=y, iterations=0 if lost else None)

    def _longer(self, model: BoxModel, y: Array, stop: int) -> tuple[BoxModel, Array] | None:
        """Return a model, and its run, that keeps close to the record for longer; None where none is found.

        What lies within its reach is fitted first: rows that have gone astray ask for noise, and blur the rest.
        """
        reach = self.parts.reach
        for factor in (1.0, self.settings.fit.further):
            part = slice(0, min(max(int(factor * stop), reach // 16), reach))
            k = self.best_level(y[: part.stop], part)
            short = self.fit(model, k, None, part, until=part.stop, y=y[: part.stop])
            run = None if short is None else self.problem.simulate([short.model], self.parts.seen)[0]
            if short is not None and run is not None and self.horizon(run) > stop:
                return short.model, run
        return None

    def settled(self, fit: BoxFit, rows: Rows | None = None, until: int | None = None) -> BoxFit:
        """Return a fit, or one from there without port noise, whichever is likelier.

        Where much noise is allowed it explains what the parameters should, and the way down is flat.

        Args:
            fit: to start from.
            rows: what is fitted (default: the fitted part).
            until: rows that are simulated (default: what the search may see).

        Returns:
            The fit.
        """
        for k in (0, self._quietest):
            if self.ladder.share(fit.level) > self.ladder.share(k):
                again = self.fit(fit.model, k, fit.J, rows, y=fit.y, held=3, until=until)
                if again is not None and again.total > fit.total:
                    fit = again
        if self.ladder.share(fit.level) > self.settings.fit.annealed_from and rows is None:
            again = self.annealed(fit)
            fit = again if again is not None and again.total > fit.total else fit
        return fit

    def combed(self, fit: BoxFit, at: int = -1) -> BoxFit:
        """Return a fit one of whose values has been looked for by runs, where no derivative leads to it.

        What comes in steps (a quantum) is right or wrong sample by sample: its likelihood is a comb with a long tooth.

        Args:
            fit: of a model with such a value, nearly right.
            at: its place among all values.

        Returns:
            The fit, with the parameters fitted again.
        """
        own = self.settings.fit
        width = own.comb * float(self.scales(fit.model)[at])
        for _ in range(own.combs):
            vectors = np.repeat(fit.model.vector[None], own.teeth, axis=0)
            vectors[:, at] += np.linspace(-width, width, own.teeth)
            models = [fit.model.moved(vector) for vector in vectors]
            runs = self.problem.simulate(models, self.parts.seen)
            teeth = [(model, y) for model, y in zip(models, runs, strict=True) if y is not None]
            if teeth:
                place, k = self._longest([y for _, y in teeth], np.delete(fit.J[: self.parts.seen], at, axis=2))
                again = self.fit(teeth[place][0], k, y=teeth[place][1], held=2)
                fit = again if again is not None and again.total > fit.total else fit
            width *= own.finer
        return fit

    def _longest(self, runs: Sequence[Array], J: Array) -> tuple[int, int]:
        """Return the free run that is likeliest once all other values follow, and the level at which it is."""
        rows, found = self.parts.fitted, []
        block = np.concatenate([J, *(self.problem.residual(y)[:, :, None] for y in runs)], axis=2)
        for k in range(min(len(self.ladder.shares), self.ladder.size)):
            white = self.ladder[k].whiten(block)[rows].reshape(-1, block.shape[2])
            columns, e = white[:, : J.shape[2]], white[:, J.shape[2] :]
            Q, _ = np.linalg.qr(columns / np.maximum(np.sqrt(np.sum(columns * columns, axis=0)), 1e-300))
            left = np.sum(e * e, axis=0) - np.sum((Q.T @ e) ** 2, axis=0)
            values = -0.5 * left - np.sum(self.ladder[k].half_log[rows])
            found.append((float(np.max(values)), int(np.argmax(values)), k))
        _, place, k = max(found)
        return place, k

    def annealed(self, fit: BoxFit) -> BoxFit | None:
        """Return the fit at ever less port noise, each from the one before.

        With much of it the start is found, and little of the values; without it a run far off says nothing.

        Args:
            fit: to start from.

        Returns:
            The fit; None where the FMU fails.
        """
        again: BoxFit | None = fit
        often, share = self.settings.fit.annealed, self.ladder.share(fit.level)
        for k in range(len(self.ladder.shares) - 1, -1, -1):
            if k < self.ladder.size and self.ladder.share(k) <= share / self.settings.fit.quieter and again is not None:
                share = self.ladder.share(k)
                again = self.fit(again.model, k, y=again.y, held=often, iterations=often)
        return None if again is None else self.fit(again.model, again.level, again.J, y=again.y)

    @property
    def _quietest(self) -> int:
        """Return a level of little noise."""
        return min(3, self.ladder.size - 1)

    def _completed(self, model: BoxModel, y: Array, J: Array | None) -> Array | None:
        known = 0 if J is None else J.shape[2]
        if J is not None and known == len(model.vector):
            return J
        rest = self.jacobian(model, y, slice(known, None))
        if rest is None:
            return None
        return rest if J is None else np.concatenate([J[: len(y)], rest], axis=2)

    def _moved(
        self, model: BoxModel, y: Array, J: Array, k: int, rows: Rows, damping: float, value: float, until: int
    ) -> tuple[BoxModel, Array, float] | None:
        """Return the best of a whole step and parts of it that gains, with its run and likelihood."""
        step = self.step(model, y, J, k, rows, damping)
        e0 = self.whitened(y, k)
        change = self.ladder[k].whiten((J @ step)[:, :, None])[:, :, 0]
        self._expected = self.likelihood(e0 - change, k, rows) - self.likelihood(e0, k, rows)
        best: tuple[BoxModel, Array, float] | None = None
        for share in (1.0, self.settings.fit.shorter):
            trial = model.moved(self.bounded(model.vector + share * step))
            run = self.problem.simulate([trial], until)[0]
            if run is None:
                continue
            reached = self.likelihood(self.whitened(run, k), k, rows) + self.prior(trial)
            if reached > (value if best is None else best[2]) + 1e-9:
                best = (trial, run, reached)
            if reached - value > self.settings.fit.half_way * self._expected:
                break
        return best

    def _result(self, model: BoxModel, k: int, y: Array, J: Array, rows: Rows) -> BoxFit:
        e = self.whitened(y, k)
        decided = 0.0
        if rows is self.parts.fitted:
            # The level that suits both parts: a free run may go astray where it is not fitted (stick and slip).
            best = max(self.ladder.near(k), key=lambda j: self._both(y, j))
            if best != k:
                e, k = self.whitened(y, best), best
            decided = self.likelihood(e, k, self.parts.decides)
        return BoxFit(model, k, y, self.likelihood(e, k, rows), decided, self.prior(model), J)

    def _both(self, y: Array, k: int) -> float:
        e = self.whitened(y, k)
        return self.likelihood(e, k, self.parts.fitted) + self.likelihood(e, k, self.parts.decides)

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
        return np.asarray(np.linalg.pinv(N / scale / scale[:, None], rcond=1e-13) / scale / scale[:, None])


def _updated(J: Array, before: Array, after: Array, y: Array, run: Array, noise: Array) -> Array:
    """Return a Jacobian that explains the last step too (Broyden)."""
    step = after - before
    size = float(step @ step)
    if size == 0.0:
        return J
    scaled = np.abs(after) + np.abs(before)
    scaled = np.where(scaled > 1e-150, scaled, 1.0)
    direction = step / scaled**2
    missing = (run - y) / noise - J @ step
    return np.asarray(J + missing[:, :, None] * (direction / (direction @ step)))
