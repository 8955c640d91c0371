"""What is known of the outputs over a window: their values at equidistant nodes, and the polynomials through them."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from orchestrator.master.pieces import dense_matrix
from orchestrator.shared.arrays import Array


@dataclass
class Waveform:
    """Outputs over a window."""

    start: float  # of the window [s]
    end: float  # of the window [s]
    nodes: Array  # values at equidistant nodes, shape (nodes, slots)
    # of the polynomials in the fraction of the window that has passed, shape of ``nodes``
    coefficients: Array = field(init=False)

    def __post_init__(self) -> None:
        self.coefficients = dense_matrix(len(self.nodes)) @ self.nodes

    def at(self, times: NDArray[np.floating]) -> Array:
        """Return the values of the polynomials at ``times`` (n,) [s], shape (n, slots)."""
        s = (times - self.start) / (self.end - self.start)
        return np.vander(s, len(self.nodes), increasing=True) @ self.coefficients

    def times(self) -> Array:
        """Return the instants of the nodes (nodes,) [s], ends of the window included."""
        return np.linspace(self.start, self.end, len(self.nodes))

    def error_between(self, before: "Waveform", times: NDArray[np.floating]) -> Array:
        """Return an estimate of the polynomials' errors at ``times`` (n,) [s], shape (n, slots).

        It is Newton's term for one more node, the last one but one of ``before``, the window that ended at ``start``.
        """
        nodes = self.times()
        extra = before.times()[-2]
        known = before.nodes[-2] - self.at(np.array([extra]))[0]
        unit = self.end - self.start  # products of lengths in seconds would underflow
        weights = np.prod((times[:, None] - nodes) / unit, axis=1) / np.prod((extra - nodes) / unit)
        return np.outer(weights, known)
