"""How whitened innovations answer to a torque, forwards (a basis) and backwards (what a torque would have changed)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood, measurement_matrix
from orchestrator.shared.inference.colour import WHITE, Colour
from orchestrator.shared.numba_cache import kept

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ErrorResponse:
    """How whitened innovations answer to a torque: ``xi+ = F xi + B torque``, ``e = -W xi``, whitened by ``colour``.

    B has one column for each of the plant's sites: a torque on the motor, and behind a shaft one for its twist (the
    stiffness times a twist error) and one for a torque on the load.
    """

    F: Array
    B: Array
    W: Array
    h: float
    colour: Colour = WHITE


def error_response(likelihood: RecordLikelihood, model: Fit) -> ErrorResponse:
    """Return the linear, steady-state response of the innovations, at the fitted model's process noise.

    Args:
        likelihood: of the record.
        model: the fit.

    Returns:
        The matrices, sample time [s] and colour.
    """
    plant, h, p = likelihood.plant, likelihood.signals.h, model.p
    table = likelihood.gains(model.q)
    rows, m = list(plant.states), likelihood.signals.channels
    gain, root = table.gains[likelihood.stop - 1][rows][:, :m], table.roots[likelihood.stop - 1]
    C = measurement_matrix(plant, m)
    identity = np.eye(len(rows))
    B = (identity * h + plant.jacobian(p) * h**2 / 2) @ plant.torque_columns(p)
    return ErrorResponse(plant.transition(p, h) @ (identity - gain @ C), B, root @ C, h, model.colour)


def back_propagated(response: ErrorResponse, raw: Array) -> Array:
    """Return (n, columns of B): what a unit torque at each sample would have changed of half the squared error.

    Args:
        response: of the innovations.
        raw: (n, channels) innovations.

    Returns:
        The changes, per N.m.
    """
    measured = np.flatnonzero(np.any(response.W != 0.0, axis=0))
    e = raw @ response.W[:, measured].T
    e = response.colour.adjoint(response.colour.white(e, slice(0, len(e))))
    return np.asarray(_adjoint(np.ascontiguousarray(e), response.F, response.B, response.W))


@kept(nogil=True)
def _adjoint(e: Array, F: Array, B: Array, W: Array) -> Array:
    n = e.shape[0]
    out = np.zeros((n, B.shape[1]))
    costate = np.zeros(F.shape[0])
    for t in range(n - 1, -1, -1):
        out[t] = B.T @ costate
        costate = F.T @ costate - W.T @ e[t]
    return out


@kept(nogil=True)
def filtered(basis: Array, F: Array, column: Array, W: Array) -> Array:
    """Return (n, channels, k): the whitened innovations that a torque along each basis function would cause.

    Args:
        basis: (n, k) torques [N.m].
        F: (states, states) transition of the error.
        column: (states,) what a unit torque does to the state within a sample.
        W: (channels, states) whitened measurement.

    Returns:
        The innovations.
    """
    n, k = basis.shape
    out = np.zeros((n, W.shape[0], k))
    xi = np.zeros((F.shape[0], k))
    for t in range(n):
        out[t] = -W @ xi
        xi = F @ xi
        for j in range(k):
            for i in range(F.shape[0]):
                xi[i, j] += column[i] * basis[t, j]
    return out
