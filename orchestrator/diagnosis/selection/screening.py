"""Screening: what an effect would gain, by adding its columns to the derivatives of a fitted model."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.inference.fitting import FittedModel
from orchestrator.diagnosis.inference.problem import FitProblem
from orchestrator.diagnosis.model.interface import CandidateEffect, Values
from orchestrator.shared.arrays import Array

MOST_PEAKS = 8  # cycles of a wave that are tried in full
TEETH = 15  # values of a comb
WHOLE = 0.25  # of an effect tried as it is: below this share of it in the fit, its gain counts by that share


@dataclass(frozen=True)
class ScreenedEffect:
    """The best start of an effect, and the squared error that it is expected to take."""

    gain: float
    label: str
    values: Values


class Screening:
    """What a fitted model's own values can explain, taken out of its residuals and of any further column."""

    def __init__(self, problem: FitProblem, fitted: FittedModel) -> None:
        self.problem, self.fitted = problem, fitted
        prior, slopes = problem.prior(fitted.point, fitted.coordinates)
        whole = np.vstack([fitted.jacobian, np.diag(slopes)])
        self.basis, _ = np.linalg.qr(whole / (np.linalg.norm(whole, axis=0) + 1e-300))
        self.padding = np.zeros(len(prior))
        residual = np.concatenate([fitted.residual, prior])
        self.unexplained = residual - self.basis @ (self.basis.T @ residual)

    def screen(self, effects: Sequence[CandidateEffect]) -> list[ScreenedEffect]:
        """Return the best start of each effect, the most promising effect first."""
        trials = [(effect, values) for effect in effects for values in self._starts(effect)]
        changes = self._changes(trials)
        best: dict[str, ScreenedEffect] = {}
        for (effect, values), columns in zip(trials, changes, strict=True):
            found = self._gain(effect, values, columns)
            if found is not None and (effect.label not in best or found.gain > best[effect.label].gain):
                best[effect.label] = found
        combed = [self._search_comb(effect, best[effect.label]) for effect in effects if effect.label in best]
        return sorted(combed, key=lambda effect: -effect.gain)

    def _search_comb(self, effect: CandidateEffect, best: ScreenedEffect) -> ScreenedEffect:
        """Return the best start of an effect between the neighbours of one, where its residuals have many minima."""
        if not effect.comb:
            return best
        place = effect.fitted[0]
        grid = sorted({start[place] for start in effect.starts})
        at = grid.index(best.values[place])
        low, high = grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)]
        for _ in range(effect.comb):
            teeth = np.linspace(low, high, TEETH)
            trials = [(effect, (*best.values[:place], float(n), *best.values[place + 1 :])) for n in teeth]
            pairs = zip(trials, self._changes(trials), strict=True)
            gains = [self._gain(effect, values, columns) for (_, values), columns in pairs]
            best = max([best, *(one for one in gains if one is not None)], key=lambda start: start.gain)
            width = 1.5 * (high - low) / (TEETH - 1)
            low, high = max(best.values[place] - width, low), min(best.values[place] + width, high)
        return best

    def _starts(self, effect: CandidateEffect) -> Sequence[Values]:
        if effect.wave is None:
            return effect.starts
        cycles = self._wave_peaks(effect)
        place = effect.wave.coordinate
        return [(*values[:place], n, *values[place + 1 :]) for values in effect.starts[:1] for n in cycles]

    def _wave_peaks(self, effect: CandidateEffect) -> list[float]:
        """Return cycles at which the residual holds a wave, by its inner products with all of them at once."""
        rows, wave = 0, effect.wave
        assert wave is not None
        total = np.zeros(wave.cycles.size, dtype=complex)
        for model, whitening in zip(self.problem.models, self.problem.whitenings, strict=True):
            own = model.effects[effect.label].wave
            assert own is not None
            left = self.fitted.residual[rows : rows + whitening.size]
            rows += whitening.size
            if own.through is None:
                gradient = whitening.back_filter(left, own.channel)
            else:
                gradient = own.through(np.array([whitening.back_filter(left, n) for n in range(len(model.channels))]))
            total += products_with_waves(gradient, own.phase, wave.cycles)
        power = np.abs(total)
        if power.size == 0:
            return []
        peaks = [n for n in range(power.size) if power[n] == power[max(0, n - 2) : n + 3].max()]
        return [float(wave.cycles[n]) for n in sorted(peaks, key=lambda n: -power[n])[:MOST_PEAKS]]

    def _changes(self, trials: Sequence[tuple[CandidateEffect, Values]]) -> list[Array]:
        """Return the columns (rows, k) of each trial: of each amplitude, or of the effect as it is."""
        single, counts = [], []
        for effect, values in trials:
            moved = [self._with_amplitude(effect, values, place) for place in effect.amplitudes] or [values]
            single += [(effect.label, one) for one in moved]
            counts.append(len(moved))
        found = self.problem.changes(self.fitted.point, self.fitted.residual, single)
        columns, first = [], 0
        for count in counts:
            columns.append(np.column_stack(found[first : first + count]))
            first += count
        return columns

    @staticmethod
    def _with_amplitude(effect: CandidateEffect, values: Values, place: int) -> Values:
        return (*values[:place], effect.scales[place], *values[place + 1 :])

    def _gain(self, effect: CandidateEffect, values: Values, columns: Array) -> ScreenedEffect | None:
        if not np.isfinite(np.linalg.norm(columns)):
            return None  # a start from which the machine runs away
        padded = np.vstack([columns, np.zeros((self.padding.size, columns.shape[1]))])
        padded -= self.basis @ (self.basis.T @ padded)
        share = np.linalg.lstsq(padded, -self.unexplained, rcond=1e-8)[0]
        left = self.unexplained + padded @ share
        gain = float(self.unexplained @ self.unexplained - left @ left)
        if not effect.amplitudes:
            return ScreenedEffect(
                gain * (1.0 if share[0] >= WHOLE else max(float(share[0]), 0.0)), effect.label, values
            )
        start = list(values)
        for place, part in zip(effect.amplitudes, share, strict=True):
            positive = place in effect.positive
            start[place] = effect.clip_value(
                place, (max(float(part), 0.0) if positive else float(part)) * effect.scales[place]
            )
        if effect.positive and all(start[place] <= 0.0 for place in effect.positive):
            return None
        return ScreenedEffect(gain, effect.label, tuple(start))


def products_with_waves(values: Array, phase: Array, cycles: Array) -> NDArray[np.complex128]:
    """Return the inner products (k,) of values with ``exp(i c phase)``, of all cycles c at once.

    Values (n,) are gathered in bins of the phase (n,), a sixty-fourth of the shortest wave wide; a Fourier transform
    does the rest: ``cycles`` (k,) are evenly spaced.
    """
    if cycles.size < 2:
        return np.exp(1j * np.outer(cycles, phase)) @ values
    spacing = float(cycles[1] - cycles[0])
    count = int(np.ceil(64.0 * (cycles[-1] + spacing) / spacing))
    width = 2.0 * np.pi / (spacing * count)
    place = np.floor((phase - phase.min()) / width).astype(int)
    shift = np.exp(1j * cycles[0] * (phase - phase.min()))  # the grid begins at its first cycles, not at none
    bins = np.zeros(count, dtype=complex)
    np.add.at(bins, place % count, values * shift)
    return np.asarray(np.fft.ifft(bins)[: cycles.size] * count)
