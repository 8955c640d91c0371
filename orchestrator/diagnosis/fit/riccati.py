"""The Riccati recursion of a linear plant: gains that start large and settle."""

import numpy as np
from numpy.typing import NDArray

from orchestrator.shared.numba_cache import kept

Array = NDArray[np.float64]

STEADY = 1e-12  # relative change of gains from sample to sample at which they stay as they are


@kept(nogil=True)
def riccati(A: Array, C: Array, Q: Array, R: Array, P: Array, gains: Array, roots: Array) -> None:
    """Fill the filter gains (n, states, channels) and inverse Cholesky factors of the innovations' covariance.

    Args:
        A: (states, states) transition over a sample.
        C: (channels, states) what is measured.
        Q: (states, states) covariance of what drives the states in a sample.
        R: (channels, channels) covariance of the measurement noise.
        P: (states, states) covariance of the initial state.
        gains: (n, states, channels), filled.
        roots: (n, channels, channels), filled.
    """
    for t in range(gains.shape[0]):
        S = C @ P @ C.T + R
        roots[t] = np.linalg.inv(np.linalg.cholesky(S))
        gain = P @ C.T @ np.linalg.inv(S)
        gains[t] = gain
        if t > 0 and np.all(np.abs(gain - gains[t - 1]) <= STEADY * np.abs(gain)):
            gains[t:] = gain
            roots[t:] = roots[t]
            return
        P = P - gain @ C @ P
        P = A @ P @ A.T + Q
        P = 0.5 * (P + P.T)
