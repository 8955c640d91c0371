"""Covariances of sums of serially correlated terms: standard errors that hold whatever the colour of a noise."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST_LAGS = 0.1  # of the samples: beyond, too few products are averaged


def long_run_covariance(terms: Array) -> Array:
    """Return the covariance (k, k) of the sum of ``terms`` (n, k) of mean zero.

    Newey and West's estimate (Econometrica 55(3), 1987), its lags weighted by Bartlett's window, whose width is
    Andrews's for first-order autoregressions (Econometrica 59(3), 1991).

    Args:
        terms: (n, k), in the order of time.

    Returns:
        (k, k), symmetric and positive semidefinite.
    """
    n, width = len(terms), _width(terms)
    total = terms.T @ terms
    for lag in range(1, width + 1):
        product = terms[lag:].T @ terms[:-lag]
        total += (1.0 - lag / (width + 1)) * (product + product.T)
    return np.asarray(total * n / max(n - terms.shape[1], 1))


def mean_of(values: Array) -> tuple[float, float]:
    """Return the mean of values in time and its standard error, neighbours having much in common.

    Args:
        values: (n,).

    Returns:
        Both.
    """
    mean = float(np.mean(values))
    return mean, float(np.sqrt(long_run_covariance((values - mean)[:, None])[0, 0]) / values.size)


def _width(terms: Array) -> int:
    """Return the number of lags that matter, every column in units of its own size."""
    squares = np.maximum(np.sum(terms[:-1] ** 2, axis=0), 1e-300)
    rho = np.clip(np.sum(terms[1:] * terms[:-1], axis=0) / squares, -0.97, 0.97)
    spread = 1.0 - rho**2
    above = np.sum(4.0 * rho**2 * spread**2 / ((1.0 - rho) ** 6 * (1.0 + rho) ** 2))
    below = np.sum(spread**2 / (1.0 - rho) ** 4)
    return int(min(1.1447 * (above / below * len(terms)) ** (1.0 / 3.0), MOST_LAGS * len(terms)))
