"""What signals do over a window: values and derivatives at its begin, middle and end, and polynomials between."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from orchestrator.shared.arrays import Array


@dataclass
class Track:
    """Signals over a window of two cells of equal length.

    A signal with derivatives is a cubic in each cell (Hermite), any other one parabola over both.
    """

    start: float  # of the window [s]
    end: float  # of the window [s]
    values: Array  # at begin, middle and end, shape (3, signals)
    rates: Array  # derivatives there [1/s], shape (3, signals)
    rated: NDArray[np.bool_]  # which signals have derivatives, shape (signals,)
    # of both cells, by powers of the passed share of the cell, shape (2, 4, signals)
    coefficients: Array = field(init=False)

    def __post_init__(self) -> None:
        self.coefficients = cell_coefficients(self.values, self.rates, self.rated, 0.5 * (self.end - self.start))

    def _shares(self, times: Array) -> tuple[NDArray[np.int64], Array]:
        cell = 0.5 * (self.end - self.start)
        passed = (times - self.start) / cell
        number = (passed >= 1.0).astype(np.int64)
        return number, passed - number

    def at(self, times: Array) -> Array:
        """Return the signals at ``times`` [s], shape (n, signals); the polynomials go on beyond the window."""
        number, share = self._shares(times)
        powers = np.vander(share, 4, increasing=True)
        found: Array = np.einsum("np,nps->ns", powers, self.coefficients[number])
        return found

    def rates_at(self, times: Array) -> Array:
        """Return the derivatives [1/s] at ``times`` [s], shape (n, signals)."""
        number, share = self._shares(times)
        powers = np.vander(share, 3, increasing=True) * np.array([1.0, 2.0, 3.0])
        found: Array = np.einsum("np,nps->ns", powers, self.coefficients[number][:, 1:])
        return found / (0.5 * (self.end - self.start))


def cell_coefficients(values: Array, rates: Array, rated: NDArray[np.bool_], cell: float) -> Array:
    """Return the polynomials of both cells of a window, each ``cell`` [s] long; all shapes as in ``Track``."""
    found = np.zeros((2, 4, values.shape[1]))
    slope = 0.5 * (values[2] - values[0])
    bend = 0.5 * (values[0] - 2.0 * values[1] + values[2])
    for k in range(2):
        y, y_end, r, r_end = values[k], values[k + 1], cell * rates[k], cell * rates[k + 1]
        found[k, 0] = y
        found[k, 1] = np.where(rated, r, slope + (2.0 * k - 2.0) * bend)
        found[k, 2] = np.where(rated, 3.0 * (y_end - y) - 2.0 * r - r_end, bend)
        found[k, 3] = np.where(rated, 2.0 * (y - y_end) + r + r_end, 0.0)
    return found


def follow_cubics(cubics: Sequence[Sequence[float]], begin: float, length: float) -> Callable[[float], list[float]]:
    """Return the function of time [s] that gives cubics, by their coefficients, of the passed share of a length [s]."""

    def signals(time: float) -> list[float]:
        s = (time - begin) / length
        return [a + s * (b + s * (c + s * d)) for a, b, c, d in cubics]

    return signals


class JoinedTracks:
    """Signals over neighbouring windows; those without derivatives are one polynomial through all nodes."""

    def __init__(self, tracks: tuple[Track, ...]) -> None:
        self._tracks, self._rated = tracks, tracks[0].rated
        nodes = [track.start + 0.5 * (track.end - track.start) * np.arange(3.0) for track in tracks]
        self._nodes = np.concatenate([nodes[0], *(found[1:] for found in nodes[1:])])
        self._values = np.concatenate([tracks[0].values, *(track.values[1:] for track in tracks[1:])])

    def at(self, times: Array) -> Array:
        """Return the signals at ``times`` [s] within the windows, shape (n, signals)."""
        found = np.empty((len(times), self._values.shape[1]))
        for track in self._tracks:
            inside = times >= track.start
            found[inside] = track.at(times[inside])
        scaled = (times - self._nodes[0]) / (self._nodes[-1] - self._nodes[0])
        places = (self._nodes - self._nodes[0]) / (self._nodes[-1] - self._nodes[0])
        weights = np.empty((len(times), len(places)))
        for k, place in enumerate(places):
            others = np.delete(places, k)
            weights[:, k] = np.prod((scaled[:, None] - others) / (place - others), axis=1)
        found[:, ~self._rated] = weights @ self._values[:, ~self._rated]
        return found

    def values_before(self, times: Array) -> Array:
        """Return the values (n, signals) at the last node before each of ``times`` [s], for what jumps at nodes."""
        node = np.searchsorted(self._nodes, times + 1e-9 * (self._nodes[1] - self._nodes[0]), side="right") - 1
        held: Array = self._values[np.maximum(node, 0)]
        return held

    def roughness(self) -> Array:
        """Return the fourth differences of five nodes, zero for fewer."""
        weights = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
        found: Array = np.abs(weights @ self._values) if len(self._nodes) == 5 else np.zeros(self._values.shape[1])
        return found
