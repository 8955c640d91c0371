"""How an input that varies is handed to a slave that holds its inputs: constant pieces with the right moments.

A slave holds its inputs over a ``do_step``. Over a cell of time in which an input is the polynomial ``u(s)``, ``s``
in [0, 1], it is stepped twice, with the constants ``c1`` on [0, 1/2] and ``c2`` on [1/2, 1] whose mean and first moment
are those of ``u``. The error of the slave's state after the cell is then of order five in the cell's length when the
input enters its equations linearly (commutator-free exponential integrators of order four: Blanes and Moan, Appl.
Numer. Math. 56, 2006), and of order three otherwise. One constant per cell would leave an error of order two or three.

An output that depends on an input at the same instant needs the input's value at the end of the cell. FMI forbids to
set an input and read an output without a step in between, so the cell of such a slave ends with a very short third
piece that holds ``u(1)``; the other two make up for its moments.
"""

from functools import cache

import numpy as np
from numpy.polynomial import Polynomial

from orchestrator.shared.arrays import Array

CELLS = 2
NODES = CELLS + 1
CLOSING = 1e-5
"""Length of the closing piece as a fraction of the cell: short beside the cell, long beside the rounding of time."""


def _breakpoints(closing: bool) -> tuple[float, ...]:
    """Return where the pieces of a cell begin and end, as fractions of the cell."""
    last = 1.0 - CLOSING
    return (0.0, 0.5 * last, last, 1.0) if closing else (0.0, 0.5, 1.0)


def _node_basis(nodes: int) -> list[Polynomial]:
    """Return, for each of equidistant nodes, the polynomial in ``s`` in [0, 1] that its value is multiplied with."""
    places = np.linspace(0.0, 1.0, nodes)
    basis = []
    for k in range(nodes):
        polynomial = Polynomial.fromroots(np.delete(places, k))
        basis.append(polynomial / polynomial(places[k]))
    return basis


@cache
def piece_weights(closing: bool) -> Array:
    """Return the matrix (pieces, nodes) from an input's values at nodes to its constants on all pieces of a window."""
    columns = []
    for polynomial in _node_basis(NODES):
        constants: list[float] = []
        for cell in range(CELLS):
            local = polynomial(Polynomial([cell / CELLS, 1.0 / CELLS]))
            constants += _constants(local, closing)
        columns.append(constants)
    return np.array(columns).T.copy()


def _constants(u: Polynomial, closing: bool) -> list[float]:
    edges = _breakpoints(closing)
    mean = _integral(u)
    first = _integral(u * Polynomial([0.0, 1.0]))
    if closing:
        mean -= (1.0 - edges[2]) * u(1.0)
        first -= 0.5 * (1.0 - edges[2] ** 2) * u(1.0)
    middle, end = edges[1], edges[2]
    matrix = [[middle, end - middle], [0.5 * middle**2, 0.5 * (end**2 - middle**2)]]
    constants = [float(c) for c in np.linalg.solve(matrix, [mean, first])]
    return [*constants, float(u(1.0))] if closing else constants


def _integral(u: Polynomial) -> float:
    primitive = u.integ()
    return float(primitive(1.0) - primitive(0.0))


@cache
def dense_matrix(nodes: int) -> Array:
    """Return the matrix from values at equidistant nodes to the coefficients of the polynomial in ``s``, square.

    Row ``k`` holds the coefficients of ``s**k``, ``s`` being the fraction of the window.
    """
    return np.array([p.coef for p in _node_basis(nodes)]).T.copy()


def piece_times(start: float, end: float, closing: bool) -> tuple[list[float], list[bool]]:
    """Return the instants between which a slave is stepped from ``start`` to ``end`` [s], and which are nodes."""
    edges = _breakpoints(closing)
    length = (end - start) / CELLS
    times, at_node = [start], []
    for cell in range(CELLS):
        for k, edge in enumerate(edges[1:], start=1):
            last = k == len(edges) - 1
            times.append(start + (cell + edge) * length)
            at_node.append(last)
    times[-1] = end
    return times, at_node
