"""The screening: what every start of every effect promises, by linearisation, before any is fitted."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.bank import PORT, BoxEffect
from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.followed import answers, measured_motions
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.model import BoxModel
from orchestrator.diagnosis.blackbox.promises import Known, Promise, Trial, promised
from orchestrator.diagnosis.blackbox.scanning import scanned

Array = NDArray[np.float64]


AMPLITUDES = 2
"""Of one effect, in a pair, at most."""


@dataclass(frozen=True)
class Pair:
    """Starts of two effects, and what linearisation says that they would gain together."""

    effects: tuple[BoxEffect, BoxEffect]
    values: tuple[Array, Array]
    gain: float
    level: int


@dataclass(frozen=True, eq=False)
class Screened:
    """What every start of every effect does on top of a fit, and what it promises, best first."""

    promises: list[Promise]
    _known: Known
    _trials: list[Trial]
    _columns: list[Array | None]
    _scanned: frozenset[int]

    def pairs(self, least: float) -> list[Pair]:
        """Return what two effects promise together where less noise is at the ports, best first.

        Args:
            least: gain from which they are told.

        Returns:
            The best pair of starts of each two effects.
        """
        share = self._known.fitter.ladder.share
        now = share(self._known.start)
        best: dict[tuple[str, str], Pair] = {}
        for level in self._known.levels:
            for pair in self._pairs_at(level, least) if share(level) < now else ():
                one, other = (effect.label for effect in pair.effects)
                key = (min(one, other), max(one, other))
                if key not in best or pair.gain > best[key].gain:
                    best[key] = pair
        return sorted(best.values(), key=lambda pair: pair.gain, reverse=True)

    def _pairs_at(self, level: int, least: float) -> list[Pair]:
        """Return the pairs that promise more than ``least`` at a level of port noise, by a regression on each two."""
        known, places = self._known, self._places()
        if len(places) < 2:
            return []
        used = sorted({k for mine in places.values() for k in mine})
        D = known.beside(level, np.stack([np.asarray(self._columns[k]) for k in used], axis=2))
        sizes = np.append(np.sqrt(np.maximum(np.sum(D * D, axis=0), 1e-300)), 1.0)
        D = np.hstack([D, np.zeros((len(D), 1))]) / sizes  # the last column is nothing: for starts that have but one
        padded = [(*map(used.index, mine), *[len(used)] * (AMPLITUDES - len(mine))) for mine in places.values()]
        one, other = np.triu_indices(len(places), 1)
        both = np.array(padded)[np.stack([one, other], axis=1)].reshape(len(one), -1)
        N, g = D.T @ D, D.T @ known.at(level)[1]
        blocks = N[both[:, :, None], both[:, None, :]]
        blocks[:, range(2 * AMPLITUDES), range(2 * AMPLITUDES)] += np.where(both == len(used), 1.0, 1e-9)
        factors = np.linalg.solve(blocks, g[both][:, :, None])[:, :, 0]
        gains = 0.5 * np.sum(factors * g[both], axis=1) + known.explains(level) - known.now
        factors /= sizes[both]
        starts = list(places)
        lowest, highest = np.array([self._bounds(start) for start in starts]).T
        leading = factors[:, [0, AMPLITUDES]]
        mine = np.stack([one, other], axis=1)
        stand = np.all((leading >= lowest[mine]) & (leading <= highest[mine]), axis=1)
        found = []
        for k in np.flatnonzero(stand & (gains > least)):
            pair = starts[one[k]], starts[other[k]]
            first, second = (self._trials[start][0] for start in pair)
            if first.label != second.label:
                values = self._grown(pair[0], factors[k, :AMPLITUDES]), self._grown(pair[1], factors[k, AMPLITUDES:])
                found.append(Pair((first, second), values, float(gains[k]), level))
        return found

    def _places(self) -> dict[int, range]:
        """Return the columns of each start, by its place, that has some and not too many."""
        found, at = {}, 0
        for start, (_, _, amplitudes) in enumerate(self._trials):
            mine = range(at, at + max(amplitudes, 1))
            at = mine.stop
            if len(mine) <= AMPLITUDES and all(c is not None and np.any(c) for c in self._columns[at - len(mine) : at]):
                found[start] = mine
        return found

    def _bounds(self, start: int) -> tuple[float, float]:
        """Return between which factors the response to a start stands for that to others."""
        own = self._known.fitter.settings.screen
        effect, _, amplitudes = self._trials[start]
        if amplitudes:
            return -np.inf, np.inf
        if start in self._scanned:
            return 1.0 - own.exact, 1.0 + own.exact
        return (own.smallest if effect.kind.shrinks else own.least), own.most

    def _grown(self, start: int, factors: Array) -> Array:
        """Return the values of a start, those in which the response is linear times their factors."""
        effect, values, amplitudes = self._trials[start]
        found = values.copy()
        if amplitudes:
            found[:amplitudes] = values[:amplitudes] * factors[:amplitudes]
        elif effect.kind.shrinks and start not in self._scanned:
            found[0] = values[0] * factors[0]
        return found


def screened(fitter: Fitter, effects: Sequence[BoxEffect], before: BoxFit) -> Screened:
    """Return what every start of every effect promises on top of a fit.

    Args:
        fitter: gives the filters and the FMU.
        effects: all that may act.
        before: fit of the model before.

    Returns:
        The promises, and what they rest on.
    """
    present = {effect.label for effect in before.model.effects}
    replaced = {f"{effect.kind.needs}@{effect.place}" for effect in before.model.effects}
    free = [e for e in effects if e.label not in present | replaced and not e.kind.needs]
    trials: list[Trial] = []
    models: list[BoxModel] = []
    found = scanned(fitter, free, before)
    for effect in free:
        for start in found.get(effect) or effect.kind.starts(effect.scene):
            values = np.array(start)
            trials.append((effect, values, effect.amplitudes))
            models += [before.model.extended(effect, one) for one in _one_by_one(values, effect.amplitudes)]
    rows = len(before.y)
    runs = fitter.problem.simulate(models, rows)
    columns: list[Array | None] = [None if run is None else (run - before.y) / fitter.problem.noise for run in runs]
    known = Known(fitter, before, rows)
    surrogate = fitter.ladder.surrogate
    motions = measured_motions(fitter.problem) if surrogate.order else {}
    for effect, values, amplitudes in tuple(trials):
        if effect.kind.where == PORT and effect.place in motions:
            motion = motions[effect.place]
            trials.append((effect, values, amplitudes))
            columns += [answers(fitter.problem, surrogate, motion, effect, one, rows)
                        for one in _one_by_one(values, amplitudes)]  # fmt: skip
    promises = promised(known, trials, columns)
    near = max(fitter.horizon(before.y), rows // 16)
    if near < fitter.settings.screen.straight * rows:  # beyond it nothing is linear any more
        close = promised(Known(fitter, before, near), trials, [None if c is None else c[:near] for c in columns])
        promises = [p for pair in itertools.zip_longest(close, promises) for p in pair if p is not None]
    return Screened(promises, known, trials, columns, frozenset(n for n, t in enumerate(trials) if t[0] in found))


def _one_by_one(values: Array, amplitudes: int) -> list[Array]:
    """Return values with all but one of the leading amplitudes at zero, for each of these."""
    found = []
    for a in range(max(amplitudes, 1)):
        one = values.copy()
        if amplitudes > 1:
            one[[b for b in range(amplitudes) if b != a]] = 0.0
        found.append(one)
    return found
