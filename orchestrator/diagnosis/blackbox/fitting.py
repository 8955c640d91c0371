"""Fits: Gauss-Newton on whitened residuals of free runs, with priors, the level of port noise chosen as it goes."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.likelihood import BoxFit, BoxLikelihood
from orchestrator.diagnosis.blackbox.model import BoxModel
from orchestrator.diagnosis.blackbox.parts import Rows

Array = NDArray[np.float64]


class Fitter(BoxLikelihood):
    """Fits models of one problem to one part of its record."""

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

    def combed(self, fit: BoxFit, at: int = -1, rows: Rows | None = None) -> BoxFit:
        """Return a fit one of whose values has been looked for by runs, where no derivative leads to it.

        What comes in steps (a quantum) is right or wrong sample by sample: its likelihood is a comb with a long tooth.

        Args:
            fit: of a model with such a value, nearly right.
            at: its place among all values.
            rows: what is fitted (default: the fitted part), as it was in ``fit``.

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
                J = np.delete(fit.J[: self.parts.seen], at, axis=2)
                place, k = self._longest([y for _, y in teeth], J, self.parts.fitted if rows is None else rows)
                again = self.fit(teeth[place][0], k, rows=rows, y=teeth[place][1], held=2)
                fit = again if again is not None and again.total > fit.total else fit
            width *= own.finer
        return fit

    def _longest(self, runs: Sequence[Array], J: Array, rows: Rows) -> tuple[int, int]:
        """Return the free run that is likeliest once all other values follow, and the level at which it is."""
        found = []
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
        own, share, rows = self.settings.fit, self.ladder.share(fit.level), self.parts.fitted
        again: BoxFit | None = fit
        reached, waited = self._likeliest(fit.y, rows), 0
        for k in range(len(self.ladder.shares) - 1, -1, -1):
            if again is None or waited == own.patience or not self._next(k, share):
                continue
            share = self.ladder.share(k)
            again = self.fit(again.model, k, again.J, y=again.y, held=own.annealed, iterations=own.annealed)
            now = -np.inf if again is None else self._likeliest(again.y, rows)
            reached, waited = max(now, reached), 0 if now > reached else waited + 1
        return None if again is None else self.fit(again.model, again.level, again.J, y=again.y)

    def _next(self, k: int, share: float) -> bool:
        return k < self.ladder.size and self.ladder.share(k) <= share / self.settings.fit.quieter

    def _likeliest(self, y: Array, rows: Rows) -> float:
        """Return the log-likelihood of a free run at the level at which it is likeliest."""
        k = self.best_level(y, rows)
        return self.likelihood(self.whitened(y, k), k, rows)

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
        J = J * _smooth(model)
        step = self.step(model, y, J, k, rows, damping)
        if not np.all(np.isfinite(step)):
            return None
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


def _smooth(model: BoxModel) -> Array:
    """Return 1 for values that a derivative leads to, and 0 for those that act in steps: combs lead to them."""
    return np.concatenate(
        [
            np.ones(len(model.p)),
            *(np.full(len(v), float(e.kind.finer is None)) for e, v in zip(model.effects, model.values, strict=True)),
        ]
    )


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
