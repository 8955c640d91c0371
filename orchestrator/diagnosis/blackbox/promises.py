"""What a start of an effect promises beside a fit, by linearisation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.bank import BoxEffect
from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.shared.inference.inverse import pseudo_inverse

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Promise:
    """A start of an effect, and what linearisation says that it would gain."""

    effect: BoxEffect
    values: Array
    gain: float
    level: int


Trial = tuple[BoxEffect, Array, int]
"""An effect, its values, and how many of the leading ones are amplitudes."""


class Known:
    """What effects are looked for beside: the residual of one fit, and what its own values explain of it."""

    def __init__(self, fitter: Fitter, before: BoxFit, rows: int) -> None:
        self.fitter, self.rows = fitter, rows
        y = before.y[:rows]
        self.start = fitter.best_level(y, slice(0, rows))
        self.now = fitter.likelihood(fitter.whitened(y, self.start), self.start, slice(0, rows)) + before.prior
        self.levels = _levels(fitter, self.start)
        self._block = np.concatenate([fitter.problem.residual(y)[:, :, None], before.J[:rows]], axis=2)
        self._prior = np.zeros((len(fitter.mean), before.J.shape[2]))
        self._prior[:, : len(fitter.mean)] = np.diag(1.0 / fitter.sd)
        self._missing = (fitter.mean - before.model.p) / fitter.sd
        self._made: dict[int, tuple[Array, Array]] = {}

    def at(self, level: int) -> tuple[Array, Array]:
        """Return an orthogonal base of what the values explain, and the residual without it.

        Args:
            level: of port noise.

        Returns:
            Shapes (rows and values, columns) and (rows and values,).
        """
        if level not in self._made:
            white = self.fitter.ladder[level].whiten(self._block).reshape(-1, self._block.shape[2])
            e = np.concatenate([white[:, 0], self._missing])
            J = np.concatenate([white[:, 1:], self._prior])
            Q, R = np.linalg.qr(J / np.maximum(np.sqrt(np.sum(J * J, axis=0)), 1e-300))
            Q = np.ascontiguousarray(Q[:, np.abs(np.diag(R)) > 1e-9])
            self._made[level] = Q, e - Q @ (Q.T @ e)
        return self._made[level]

    def explains(self, level: int) -> float:
        """Return the log-likelihood at a level, the values at their best.

        Args:
            level: of port noise.

        Returns:
            The log-likelihood, without its constant.
        """
        _, e = self.at(level)
        return -0.5 * float(e @ e) - float(np.sum(self.fitter.ladder[level].half_log[: self.rows]))

    def beside(self, level: int, columns: Array) -> Array:
        """Return columns, whitened, without what the values explain of them.

        Args:
            level: of port noise.
            columns: (rows, outputs, c), in units of the noise.

        Returns:
            Shape (rows and values, c).
        """
        Q, _ = self.at(level)
        white = self.fitter.ladder[level].whiten(columns).reshape(-1, columns.shape[2])
        D = np.concatenate([white, np.zeros((len(self._missing), columns.shape[2]))])
        return np.asarray(D - Q @ (Q.T @ D))


def promised(
    known: Known, trials: Sequence[Trial], columns: Sequence[Array | None], exact: bool = False,
    levels: Sequence[int] = (),
) -> list[Promise]:  # fmt: skip
    """Return what each trial promises, best first.

    Args:
        known: what it is looked for beside.
        trials: what is tried.
        columns: what each amplitude of each trial changes, (rows, outputs) in units of the noise; None where unknown.
        exact: values are not scaled.
        levels: of port noise (default: all that are worth a look).

    Returns:
        A promise for each that is known.
    """
    own = known.fitter.settings.screen
    best: dict[int, Promise] = {}
    usable = [k for k, c in enumerate(columns) if c is not None and np.any(c)]
    if not usable:
        return []
    block = np.stack([c for c in (columns[k] for k in usable) if c is not None], axis=2)
    place = {k: n for n, k in enumerate(usable)}
    for level in levels or known.levels:
        _, e = known.at(level)
        D = known.beside(level, block)
        along, sizes = D.T @ e, np.sum(D * D, axis=0)
        base = known.explains(level) - known.now
        at = 0
        for n, (effect, values, amplitudes) in enumerate(trials):
            mine = [place[at + a] for a in range(max(amplitudes, 1)) if at + a in place]
            at += max(amplitudes, 1)
            if len(mine) < max(amplitudes, 1):
                continue
            bounds = (own.smallest if effect.kind.shrinks else own.least, own.most)
            bounds = (1.0 - own.exact, 1.0 + own.exact) if exact else bounds
            if amplitudes == 0:
                explained, c = _scaled(float(along[mine[0]]), float(sizes[mine[0]]), bounds)
            else:
                explained, c = _regressed(along[mine], D[:, mine])
            gain = base + 0.5 * explained
            if n not in best or gain > best[n].gain:
                found = values.copy()
                if amplitudes:
                    found[:amplitudes] = values[:amplitudes] * c
                elif effect.kind.shrinks and c[0] < own.least and not exact:
                    found[0] = values[0] * c[0]
                best[n] = Promise(effect, found, gain, level)
    return sorted(best.values(), key=lambda promise: promise.gain, reverse=True)


def _levels(fitter: Fitter, now: int) -> list[int]:
    ladder = fitter.ladder
    lower = [k for k in range(ladder.size) if ladder.colour(k) == 0.0 and ladder.share(k) < ladder.share(now)]
    return sorted({now, 0, *lower[1::3], *lower[-1:]})


def _scaled(along: float, size: float, bounds: tuple[float, float]) -> tuple[float, Array]:
    """Return what a column of a finite size explains of ``|e|^2``, and its factor, which is close to 1."""
    c = min(max(along / size, bounds[0]), bounds[1]) if size > 0.0 else 1.0
    return 2.0 * c * along - c * c * size, np.array([c])


def _regressed(along: Array, D: Array) -> tuple[float, Array]:
    """Return what columns explain of ``|e|^2``, and their factors; ``along``: of each with the residual."""
    N = D.T @ D
    scale = np.sqrt(np.maximum(np.diag(N), 1e-300))
    g = along / scale
    found = g if len(g) == 1 else pseudo_inverse(N / scale / scale[:, None], rcond=1e-8) @ g
    return float(found @ g), found / scale
