"""Interpolation that keeps what grows growing: piecewise cubics (Fritsch and Butland, SIAM J. Sci. Comput. 5(2), 1984).

As ``scipy.interpolate.PchipInterpolator``, to the bit, without the half second that its import takes in every process.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from orchestrator.shared.arrays import Array


@dataclass(frozen=True, slots=True)
class MonotoneCubic:
    """Cubics between nodes, continued beyond the outer ones."""

    nodes: Array  # shape (n,), increasing
    coefficients: Array  # shape (4, n - 1), of the cubic right of each node, highest power first

    def __call__(self, at: ArrayLike) -> Array:
        """Return the values at ``at``, of the same shape."""
        piece, s = self._place(at)
        c3, c2, c1, c0 = self.coefficients[:, piece]
        square = s * s
        return np.asarray(c0 + c1 * s + c2 * square + c3 * (square * s))

    def slope(self, at: ArrayLike) -> Array:
        """Return the derivatives at ``at``, of the same shape."""
        piece, s = self._place(at)
        c3, c2, c1, _ = self.coefficients[:, piece]
        return np.asarray(c1 + (2.0 * c2) * s + (3.0 * c3) * (s * s))

    def _place(self, at: ArrayLike) -> tuple[NDArray[np.intp], Array]:
        """Return the piece that each place is in, and how far it is from the piece's left end."""
        places = np.asarray(at, dtype=np.float64)
        piece = np.clip(np.searchsorted(self.nodes, places, side="right") - 1, 0, len(self.nodes) - 2)
        return piece, places - self.nodes[piece]


def monotone_cubic(x: ArrayLike, y: ArrayLike) -> MonotoneCubic:
    """Return the cubics through all points that overshoot nowhere.

    ``x``: shape (n,), increasing, at least three; ``y``: shape (n,).
    """
    nodes, values = np.array(x, dtype=np.float64), np.array(y, dtype=np.float64)
    width = np.diff(nodes)
    rise = np.diff(values) / width
    slope = _slopes(width, rise)
    bend = (slope[:-1] + slope[1:] - 2.0 * rise) / width
    return MonotoneCubic(nodes, np.stack([bend / width, (rise - slope[:-1]) / width - bend, slope[:-1], values[:-1]]))


def _slopes(width: Array, rise: Array) -> Array:
    """Return the slope at each node: the weighted harmonic mean of its neighbours', zero where these disagree."""
    right, left = 2.0 * width[1:] + width[:-1], width[1:] + 2.0 * width[:-1]
    agree = (np.sign(rise[1:]) == np.sign(rise[:-1])) & (rise[1:] != 0.0) & (rise[:-1] != 0.0)
    safe = np.where(agree, rise[:-1], 1.0), np.where(agree, rise[1:], 1.0)
    mean = (right / safe[0] + left / safe[1]) / (right + left)
    inner = np.where(agree, 1.0 / np.where(agree, mean, 1.0), 0.0)
    first, last = _end_slope(width[0], width[1], rise[0], rise[1]), _end_slope(width[-1], width[-2], rise[-1], rise[-2])
    return np.concatenate([[first], inner, [last]])


def _end_slope(near: float, next_width: float, rise: float, next_rise: float) -> float:
    """Return the slope at an outer node from the parabola through three, limited so that nothing overshoots."""
    slope = ((2.0 * near + next_width) * rise - near * next_rise) / (near + next_width)
    if np.sign(slope) != np.sign(rise):
        return 0.0
    if np.sign(rise) != np.sign(next_rise) and abs(slope) > 3.0 * abs(rise):
        return 3.0 * rise
    return slope
