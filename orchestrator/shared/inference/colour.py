"""The colour of what a model leaves: innovations are whitened by an autoregression before they are judged.

Torques of real machines are noisy, filtered and late, and no law is exact, so what a right model leaves is not white.
Judged as if it were, gains come out too large, and standard errors too small, by the ratio of its spectrum to a white
one. A vector autoregression is estimated from the innovations (Yule and Walker's equations; its order by Schwarz's
criterion; Luetkepohl, New Introduction to Multiple Time Series Analysis, 2005, ch. 3 and 4); likelihoods, Jacobians
and responses are those of its residuals.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.shared.numba_cache import kept

Array = NDArray[np.float64]

ORDERS = (0, 1, 2, 3, 4, 6, 8, 12)  # that are compared
STRETCH = 512  # samples that are whitened at a time
SAMPLES_PER_LAG = 20  # at least, and per channel, so that the autoregression does not learn the record by heart


@dataclass(frozen=True)
class Colour:
    """An autoregression of innovations.

    Attributes:
        lags: (order, channels, channels) coefficients.
        root: (channels, channels) inverse Cholesky factor of the covariance of its residuals; NaN: none was found.
    """

    lags: Array
    root: Array

    @property
    def order(self) -> int:
        """Return the number of samples that it looks back."""
        return int(self.lags.shape[0])

    @property
    def cost(self) -> float:
        """Return the log-likelihood that its coefficients gain by chance where they are estimated."""
        return 0.5 * float(self.lags.size)

    @property
    def usable(self) -> bool:
        """Tell whether the innovations were finite and not degenerate."""
        return bool(np.all(np.isfinite(self.root)))

    def white(self, z: Array, part: slice) -> Array:
        """Return the scaled residuals of a part of (n, channels) or (n, channels, k) innovations.

        Args:
            z: (n, channels) or (n, channels, k).
            part: the samples wanted.

        Returns:
            The residuals of that part, in the shape of ``z``.
        """
        begin = max(part.start - self.order, 0)
        given = z[begin : part.stop]
        series = np.ascontiguousarray(given.transpose(2, 0, 1) if z.ndim == 3 else given[None])
        out = _whitened(series, self.lags, self.root, part.start - begin)
        return out.transpose(1, 2, 0) if z.ndim == 3 else out[0]

    def adjoint(self, e: Array) -> Array:
        """Return the transpose of :meth:`white` applied to a whole series (n, channels).

        Args:
            e: (n, channels).

        Returns:
            (n, channels).
        """
        scaled = e @ self.root
        out = scaled.copy()
        for n, lag in enumerate(self.lags, start=1):
            out[:-n] -= scaled[n:] @ lag
        return out

    def response(self, phase: complex) -> NDArray[np.complex128]:
        """Return the matrix that whitens a signal whose phase advances by ``phase`` a sample.

        Args:
            phase: complex factor from sample to sample, of modulus 1.

        Returns:
            The matrix (channels, channels).
        """
        total = np.eye(self.root.shape[0], dtype=complex)
        for n, lag in enumerate(self.lags, start=1):
            total -= lag * phase**-n
        return np.asarray(self.root @ total)


WHITE = Colour(np.zeros((0, 1, 1)), np.eye(1))  # of one channel


@np.errstate(over="ignore", invalid="ignore")  # of a model that runs away: no colour is found
def colour_of(z: Array, part: slice, most: int = ORDERS[-1]) -> Colour:
    """Return the autoregression of a part of the innovations (n, channels).

    Args:
        z: innovations.
        part: the samples that it is estimated from.
        most: largest order; 0: innovations count as independent from sample to sample.

    Returns:
        The autoregression of the order that explains the part best.
    """
    e = z[part]
    n, m = e.shape
    if not np.all(np.isfinite(e)):
        return _nothing(m)
    orders = [p for p in ORDERS if p <= most and p * m * SAMPLES_PER_LAG <= n]
    moments = np.array([e[k:].T @ e[: n - k] / n for k in range(orders[-1] + 1)])  # E e_t e_(t-k)'
    matrix, found, cost = _block_toeplitz(moments), None, np.inf
    for p in orders:
        try:
            lags, covariance = _yule_walker(moments, matrix, p)
            sign, logdet = np.linalg.slogdet(covariance)
        except np.linalg.LinAlgError:
            continue
        own = n * logdet + lags.size * np.log(n)
        if sign > 0 and own < cost:
            found, cost = lags, own
    if found is None:
        return _nothing(m)
    residual = Colour(found, np.eye(m)).white(z, part)
    try:
        return Colour(found, np.asarray(np.linalg.inv(np.linalg.cholesky(residual.T @ residual / n))))
    except np.linalg.LinAlgError:  # a model that lets the innovations of one channel vanish, or follow the other's
        return _nothing(m)


@kept(nogil=True)
def _whitened(given: Array, lags: Array, root: Array, first: int) -> Array:
    """Return the scaled residuals of k series of (n, channels) innovations from sample ``first`` on.

    Innermost loops go along time, over stretches that stay in the processor's cache.
    """
    k, n, m = given.shape
    out = np.empty((k, n - first, m))
    turned, rows = np.empty((m, n)), np.empty((m, STRETCH))
    for j in range(k):
        for i in range(m):
            turned[i] = given[j, :, i]
        for begin in range(first, n, STRETCH):
            size = min(STRETCH, n - begin)
            for c in range(m):
                row = rows[c, :size]
                row[:] = turned[c, begin : begin + size]
                for lag in range(lags.shape[0]):
                    known = max(begin, lag + 1)  # before it there is nothing to look back at
                    late = row[known - begin :]
                    for i in range(m):
                        weight, before = lags[lag, c, i], turned[i, known - lag - 1 : begin + size - lag - 1]
                        for t in range(late.size):
                            late[t] -= weight * before[t]
            for c in range(m):
                for t in range(size):
                    total = 0.0
                    for i in range(m):
                        total += root[c, i] * rows[i, t]
                    out[j, begin - first + t, c] = total
    return out


def _nothing(channels: int) -> Colour:
    return Colour(np.zeros((0, channels, channels)), np.full((channels, channels), np.nan))


def _block_toeplitz(moments: Array) -> Array:
    """Return Yule and Walker's matrix (order m, order m) of the largest order; those of smaller ones are its corners.

    Args:
        moments: (order + 1, m, m) autocovariances.
    """
    order, m = len(moments) - 1, moments.shape[1]
    if order == 0:
        return np.zeros((0, 0))
    signed = np.concatenate([moments[order - 1 : 0 : -1].transpose(0, 2, 1), moments[:order]])  # of lags -order + 1 on
    rows = np.arange(order)
    blocks = signed[rows[None, :] - rows[:, None] + order - 1]
    return blocks.transpose(0, 2, 1, 3).reshape(order * m, order * m)


def _yule_walker(moments: Array, matrix: Array, p: int) -> tuple[Array, Array]:
    """Return lags (p, m, m) and the covariance of the residuals for autocovariances ``moments`` (lags, m, m).

    ``matrix`` is :func:`_block_toeplitz` of them.
    """
    m = moments.shape[1]
    if p == 0:
        return np.zeros((0, m, m)), moments[0]
    right = np.concatenate(list(moments[1 : p + 1]), axis=1)
    solution = np.linalg.solve(matrix[: p * m, : p * m].T, right.T).T
    lags = np.array([solution[:, i * m : (i + 1) * m] for i in range(p)])
    covariance = moments[0] - sum(lags[k] @ moments[k + 1].T for k in range(p))
    return lags, 0.5 * (covariance + covariance.T)
