"""The screening: what every start of every effect promises, by linearisation, before any is fitted."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.bank import INPUT, BoxEffect
from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.model import BoxModel
from orchestrator.diagnosis.blackbox.passed import at_input
from orchestrator.diagnosis.blackbox.problem import series_of

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
    _known: "Known"
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
            amplitudes = effect.amplitudes
            trials.append((effect, values, amplitudes))
            for a in range(max(amplitudes, 1)):
                one = values.copy()
                if amplitudes > 1:
                    one[[b for b in range(amplitudes) if b != a]] = 0.0
                models.append(before.model.extended(effect, one))
    rows = len(before.y)
    runs = fitter.problem.simulate(models, rows)
    columns: list[Array | None] = [None if run is None else (run - before.y) / fitter.problem.noise for run in runs]
    known = Known(fitter, before, rows)
    promises = _promises(known, trials, columns)
    near = max(fitter.horizon(before.y), rows // 16)
    if near < fitter.settings.screen.straight * rows:  # beyond it nothing is linear any more
        close = _promises(Known(fitter, before, near), trials, [None if c is None else c[:near] for c in columns])
        promises = [p for pair in itertools.zip_longest(close, promises) for p in pair if p is not None]
    return Screened(promises, known, trials, columns, frozenset(n for n, t in enumerate(trials) if t[0] in found))


def scanned(fitter: Fitter, effects: Sequence[BoxEffect], before: BoxFit) -> dict[BoxEffect, list[tuple[float, ...]]]:
    """Return, of each effect that asks for a scan, the starts that promise most on the surrogate of the FMU.

    Args:
        fitter: gives the filters and the surrogate.
        effects: that are looked through.
        before: fit of the model before.

    Returns:
        Starts by effect; none where no surrogate could be found.
    """
    own, run = fitter.settings.screen, _Sight(fitter, before)
    chosen: dict[BoxEffect, list[tuple[float, ...]]] = {}
    for effect in effects:
        values = (*run.sifted(effect), *effect.kind.scan(effect.scene))
        gains = run.gains(effect, values) if values else {}
        kept: list[int] = []
        for k in sorted(gains, key=lambda k: -gains[k].gain):
            if len(kept) < own.scanned and all(abs(k - other) >= own.apart for other in kept):
                kept.append(k)
        for k in kept:
            edges = values[max(k - 1, 0)], values[min(k + 1, len(values) - 1)]
            finer = tuple(float(v) for v in np.linspace(*edges, 2 * own.parts + 1))
            close = run.gains(effect, finer, (gains[k].level,))
            best = finer[max(close, key=lambda n: close[n].gain)] if close else values[k]
            chosen.setdefault(effect, []).append(_with(effect, best))
    return chosen


def _with(effect: BoxEffect, value: float) -> tuple[float, ...]:
    """Return a start of an effect with another last value."""
    return (*effect.kind.starts(effect.scene)[0][:-1], value)


class _Sight:
    """What effects promise on top of one fit, seen through the surrogate of the FMU."""

    def __init__(self, fitter: Fitter, before: BoxFit) -> None:
        self._fitter = fitter
        problem, self._rows = fitter.problem, len(before.y)
        self._table = problem.table(before.model, series_of(problem, self._rows))
        self._read = problem.read_finely(before.model, self._rows)
        self._known = Known(fitter, before, self._rows)

    def gains(self, effect: BoxEffect, values: Sequence[float], levels: Sequence[int] = ()) -> dict[int, Promise]:
        """Return what each of ``values`` promises, by its place; ``levels`` of port noise: default all."""
        fitter, problem = self._fitter, self._fitter.problem
        at_input = effect.kind.where == INPUT
        surrogate = problem.input_surrogate() if at_input else fitter.ladder.surrogate
        if surrogate.order == 0 or self._read is None:
            return {}
        efforts = [e for v in values for e in (self._arriving if at_input else self._felt)(effect, v)]
        pushes = np.stack([e.reshape(self._rows - 1, problem.m).mean(axis=1) for e in efforts], axis=1)
        name = effect.place if at_input else problem.map.ports[effect.place].input
        at = problem.runner.inputs.index(name)
        place = problem.inputs.index(name) if at_input else problem.noise_places.index(at)
        answers = surrogate.response(pushes / problem.drive([at])[0], place)
        amplitudes = effect.amplitudes
        trials = [(effect, np.array(_with(effect, v)), amplitudes) for v in values]
        columns = [answers[:, :, k] for k in range(answers.shape[2])]
        found = _promises(self._known, trials, columns, exact=True, levels=levels)
        places = {v: k for k, v in enumerate(values)}
        return {places[float(p.values[-1])]: p for p in found}

    def sifted(self, effect: BoxEffect) -> tuple[float, ...]:
        """Return the small values of an effect in series whose response goes best with what is left, each with its kin.

        They are quanta, found where noise is left at the ports. Their errors are about white: the response to each has
        the power of the error itself, times the same factor.
        """
        fitter, problem, own = self._fitter, self._fitter.problem, self._fitter.settings.screen
        values, surrogate = effect.kind.small(effect.scene), problem.input_surrogate()
        if not len(values) or surrogate.order == 0 or fitter.ladder.share(self._known.start) == 0.0:
            return ()
        place, felt = problem.inputs.index(effect.place), []
        for level in self._known.levels:
            e = self._known.at(level)[1][: self._rows * len(problem.outputs)].reshape(self._rows, -1)
            felt.append(surrogate.felt(fitter.ladder[level].transposed(e), place))
        u = self._table[:: problem.m, problem.runner.inputs.index(effect.place)]
        parts = np.array_split(values, 1 + len(values) * len(u) // own.at_once)
        along = np.concatenate([_along(part, u, np.stack(felt, axis=1)) for part in parts])
        best = np.max(along / np.maximum(np.mean(along, axis=0), 1e-300), axis=1)
        found: list[int] = []
        for k in np.argsort(-best):
            if len(found) == own.sifted or best[k] < own.stands_out * 2.0 * np.log(len(values)):
                break
            if 0 < k < len(values) - 1 and all(abs(k - other) >= own.apart for other in found):
                found.append(int(k))
        return tuple(float(v) for k in sorted(found) for v in values[k - 1 : k + 2])

    def _arriving(self, effect: BoxEffect, value: float) -> list[Array]:
        """Return what an effect in series changes of its input."""
        fine = self._table[:, self._fitter.problem.runner.inputs.index(effect.place)]
        return [at_input(effect, fine, self._fitter.problem.h / self._fitter.problem.m, value) - fine]

    def _felt(self, effect: BoxEffect, value: float) -> list[Array]:
        """Return the efforts, sine and cosine, of a ripple of this wavenumber over the motion."""
        problem = self._fitter.problem
        assert self._read is not None
        x = self._read[:-1, problem.runner.reads.index(problem.map.ports[effect.place].position)]
        size = -problem.sign.get(effect.place, 1.0) * effect.kind.starts(effect.scene)[0][0]
        return [size * np.sin(value * x), size * np.cos(value * x)]


def _along(quanta: Array, u: Array, felt: Array) -> Array:
    """Return the squared products (quanta, columns) of unit errors of quantisation with the columns of ``felt``."""
    errors = quanta[:, None] * np.rint(u / quanta[:, None]) - u
    return np.asarray((errors @ felt) ** 2 / np.maximum(np.sum(errors * errors, axis=1), 1e-300)[:, None])


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


def _promises(
    known: Known, trials: Sequence[Trial], columns: Sequence[Array | None], exact: bool = False,
    levels: Sequence[int] = (),
) -> list[Promise]:  # fmt: skip
    """Return what each trial promises, best first; ``exact``: its values are not scaled; ``levels``: default all."""
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
    found = g if len(g) == 1 else np.linalg.pinv(N / scale / scale[:, None], rcond=1e-8) @ g
    return float(found @ g), found / scale
