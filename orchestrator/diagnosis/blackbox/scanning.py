"""The scan: what many values of an effect promise on the surrogate of the FMU, before the FMU itself is run."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.bank import INPUT, BoxEffect
from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.followed import measured_motions
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.passed import at_input
from orchestrator.diagnosis.blackbox.problem import series_of
from orchestrator.diagnosis.blackbox.promises import Known, Promise, promised

Array = NDArray[np.float64]


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
        scan = effect.kind.scan(effect.scene)
        values = (*run.sifted(effect), *scan)
        gains = run.gains(effect, values) if values else {}
        kept: list[int] = []
        for k in sorted(gains, key=lambda k: -gains[k].gain):
            if len(kept) < own.scanned and all(abs(k - other) >= own.apart for other in kept):
                kept.append(k)
        grid = np.sort(np.concatenate([effect.kind.small(effect.scene), scan]))
        for k in kept:
            finer = tuple(float(v) for v in np.linspace(*_around(grid, values[k]), 2 * own.parts + 1))
            close = run.gains(effect, finer, (gains[k].level,))
            best = finer[max(close, key=lambda n: close[n].gain)] if close else values[k]
            chosen.setdefault(effect, []).append(_with(effect, best))
    return chosen


def _around(grid: Array, value: float) -> tuple[float, float]:
    """Return the neighbours of a value in a grid that holds it, the value itself where there is none."""
    k = int(np.argmin(np.abs(grid - value)))
    return float(grid[max(k - 1, 0)]), float(grid[min(k + 1, len(grid) - 1)])


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
        self._motions = measured_motions(problem)
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
        found = promised(self._known, trials, columns, exact=True, levels=levels)
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
        return [at_input(effect, fine, self._fitter.problem.step, value) - fine]

    def _felt(self, effect: BoxEffect, value: float) -> list[Array]:
        """Return the efforts, sine and cosine, of a ripple of this wavenumber over the motion."""
        problem = self._fitter.problem
        assert self._read is not None
        x = self._read[:-1, problem.runner.reads.index(problem.map.ports[effect.place].position)]
        if effect.place in self._motions:
            measured = self._motions[effect.place].x[: self._rows]
            x = np.interp(np.arange(len(x)) / problem.m, np.arange(self._rows), measured)
        size = -problem.sign.get(effect.place, 1.0) * effect.kind.starts(effect.scene)[0][0]
        return [size * np.sin(value * x), size * np.cos(value * x)]


def _along(quanta: Array, u: Array, felt: Array) -> Array:
    """Return the squared products (quanta, columns) of unit errors of quantisation with the columns of ``felt``."""
    errors = quanta[:, None] * np.rint(u / quanta[:, None]) - u
    return np.asarray((errors @ felt) ** 2 / np.maximum(np.sum(errors * errors, axis=1), 1e-300)[:, None])
