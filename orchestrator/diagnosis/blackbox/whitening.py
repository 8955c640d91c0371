"""Whitening of residuals: a small linear surrogate of the FMU, measured at its ports, as a Kalman filter.

The surrogate whitens and does nothing else: the fit runs the FMU. Impulse responses from the ports to the outputs are
realised to a low order (eigensystem realisation, Juang and Pappa 1985). Noise at the ports then gives a filter that is
applied to the residual of a free run and to every column of its Jacobian. For a linear FMU that equals the innovations
of the optimal predictor.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.settings import DEFAULT, PortNoiseSettings
from orchestrator.shared.numba_cache import kept

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Surrogate:
    """``x+ = A x + B w``, ``y = C x``, outputs in units of their noise; ``order`` 0: none could be found.

    Attributes:
        A, B, C: the system, with the efforts that lead it along a record where there are any.
        near: (ports, outputs) of these, for being off; None: there are none.
        faster: (ports, outputs) for a change of that from the sample before.
    """

    A: Array
    B: Array
    C: Array
    near: Array | None = None
    faster: Array | None = None

    @property
    def order(self) -> int:
        """Return the number of states."""
        return len(self.A)

    def noisy(self) -> tuple[Array, Array, Array, Array]:
        """Return the system from efforts at its ports and measurement noise to the residual, which has the latter too.

        Noise leads a guided run astray: it acts on the FMU as any other difference to the record does. Its sample
        before is a state.

        Returns:
            A, B, C, and the column of each output's noise.
        """
        if self.near is None or self.faster is None:
            return self.A, self.B, self.C, np.zeros((self.order, len(self.C)))
        outputs = len(self.C)
        none = np.zeros((outputs, outputs))
        A = np.block([[self.A, self.B @ self.faster], [np.zeros((outputs, self.order)), none]])
        B = np.vstack([self.B, np.zeros((outputs, self.B.shape[1]))])
        E = np.vstack([-self.B @ (self.near + self.faster), np.eye(outputs)])
        return A, B, np.hstack([self.C, none]), E

    def response(self, pushes: Array, place: int) -> Array:
        """Return the outputs under efforts at one of its inputs, from rest.

        Args:
            pushes: (n - 1, columns) efforts, each held over a sample.
            place: of the input.

        Returns:
            Shape (n, outputs, columns).
        """
        B = np.ascontiguousarray(self.B[:, place])
        return np.asarray(_responded(self.A, B, self.C, np.ascontiguousarray(pushes, dtype=np.float64)))

    def felt(self, gradient: Array, place: int) -> Array:
        """Return the product of each effort's response with ``gradient``: the transpose of :meth:`response`.

        Args:
            gradient: (n, outputs).
            place: of the input.

        Returns:
            Shape (n - 1,).
        """
        back, found = np.zeros(self.order), np.zeros(len(gradient) - 1)
        for k in range(len(gradient) - 1, 0, -1):
            back = self.C.T @ gradient[k] + self.A.T @ back
            found[k - 1] = self.B[:, place] @ back
        return found


def realised(impulses: Array, settings: PortNoiseSettings = DEFAULT.noise) -> Surrogate:
    """Return a surrogate of impulse responses.

    Args:
        impulses: (length, outputs, ports) response to a pulse one sample long, from the sample after it begins.
        settings: its order, and how it is found.

    Returns:
        The surrogate.
    """
    length, outputs, ports = impulses.shape
    peak = float(np.max(np.abs(impulses), initial=0.0))
    if length < 8 or not np.isfinite(peak) or peak == 0.0:
        return Surrogate(np.zeros((0, 0)), np.zeros((0, ports)), np.zeros((outputs, 0)))
    # Dense where fast modes live, then wider and wider: slow ones hardly change from sample to sample.
    half = (length - 2) // 2
    spaced = np.geomspace(1.0, half, settings.blocks).astype(int)
    places = np.unique(np.concatenate([np.arange(min(settings.blocks // 2, half)), spaced]))
    hankel = np.block([[impulses[i + j] for j in places] for i in places])
    shifted = np.block([[impulses[i + j + 1] for j in places] for i in places])
    U, s, Vt = np.linalg.svd(hankel, full_matrices=False)
    order = int(np.sum(s[: settings.most_order] > settings.least_singular * s[0]))
    root = np.sqrt(s[:order])
    A = (U[:, :order] / root).T @ shifted @ (Vt[:order].T / root)
    B = (root[:, None] * Vt[:order])[:, :ports]
    C = (U[:, :order] * root)[:outputs]
    values, vectors = np.linalg.eig(A)
    size = np.abs(values)
    # Of two integrators in a row the values differ by rounding alone, and that difference couples them.
    grows = size > 1.0 + settings.grows / length
    values = np.where(grows, values / np.maximum(size, 1e-300), values)
    A = np.real(vectors @ np.diag(values) @ np.linalg.inv(vectors)) if np.any(grows) else A
    return Surrogate(A, B, C)


@dataclass(frozen=True)
class NoiseLevel:
    """One level of noise at the ports, ready to whiten: gains and inverse roots of every sample.

    Attributes:
        q: standard deviation of the noise, as a share of the drive; 0.0: measurement noise alone.
        colour: correlation from sample to sample.
        K: (n, states, outputs) gains of the predictor form.
        R: (n, outputs, outputs) inverse Cholesky roots of the innovations' covariance.
        half_log: (n,) half of the logarithm of its determinant.
    """

    q: float
    colour: float
    A: Array
    C: Array
    K: Array
    R: Array
    half_log: Array

    def whiten(self, columns: Array) -> Array:
        """Return columns (n, outputs, c), in units of the noise, whitened.

        Args:
            columns: residual and columns of its Jacobian.

        Returns:
            Shape (n, outputs, c).
        """
        return np.asarray(_filtered(self.A, self.C, self.K, self.R, np.ascontiguousarray(columns)))

    def coloured(self, e: Array) -> Array:
        """Return columns whose whitened ones are ``e`` (n, outputs, c): the inverse of :meth:`whiten`.

        Args:
            e: innovations.

        Returns:
            Shape (n, outputs, c), in units of the noise.
        """
        x, found = np.zeros((len(self.A), e.shape[2])), np.empty_like(e)
        for k in range(len(e)):
            new = np.linalg.solve(self.R[k], e[k])
            found[k] = new + self.C @ x
            x = self.A @ x + self.K[k] @ new
        return found

    def transposed(self, e: Array) -> Array:
        """Return the product of each sample's whitened response with ``e``: the transpose of :meth:`whiten`.

        Args:
            e: (rows, outputs), no more rows than there are gains.

        Returns:
            Shape (rows, outputs).
        """
        back, found = np.zeros(len(self.A)), np.empty_like(e)
        for k in range(len(e) - 1, -1, -1):
            found[k] = self.R[k].T @ e[k] + self.K[k].T @ back
            back = self.A.T @ back - self.C.T @ found[k]
        return found


def level(
    surrogate: Surrogate, q: float, colour: float, drive: Array, n: int, spread: float = 0.0,
    reach: int = DEFAULT.noise.reach,
) -> NoiseLevel:  # fmt: skip
    """Return the filter for port noise over ``n`` samples.

    Args:
        surrogate: of the FMU.
        q, drive: the noise is ``q`` times ``drive`` (ports,).
        colour: its correlation from sample to sample.
        n: samples.
        spread: how far the state that the FMU starts from may be off, as seen at the outputs, in units of their noise.
        reach: samples over which efforts may have led to that state.

    Returns:
        The filter.
    """
    outputs = surrogate.C.shape[0]
    if (q == 0.0 and spread == 0.0 and surrogate.near is None) or surrogate.order == 0:
        R = np.repeat(np.eye(outputs)[None], n, axis=0)
        return NoiseLevel(0.0, 0.0, np.zeros((0, 0)), np.zeros((outputs, 0)), np.zeros((n, 0, outputs)), R, np.zeros(n))
    A, B, C, E = surrogate.noisy()
    order, ports = B.shape
    sd = q * drive
    begun = np.zeros((order, order))
    begun[: surrogate.order, : surrogate.order] = _start(surrogate, spread, reach)
    if colour == 0.0:
        Q, start = (B * sd**2) @ B.T, begun
    else:
        A = np.block([[A, B], [np.zeros((ports, order)), colour * np.eye(ports)]])
        C = np.hstack([C, np.zeros((outputs, ports))])
        E = np.vstack([E, np.zeros((ports, outputs))])
        Q = np.zeros_like(A)
        Q[order:, order:] = np.diag((1.0 - colour**2) * sd**2)
        start = np.zeros_like(A)
        start[:order, :order] = begun
        start[order:, order:] = np.diag(sd**2)
    A, C, Q, E, start = (np.ascontiguousarray(a) for a in (A, C, Q + E @ E.T, E, start))
    K, R, half_log = _gains(A, C, Q, E, start, n)
    return NoiseLevel(q, colour, A, C, K, R, half_log)


def _start(surrogate: Surrogate, spread: float, reach: int) -> Array:
    """Return the covariance of the initial state: what port noise before the record would have led to."""
    total = np.zeros_like(surrogate.A)
    if spread == 0.0:
        return total
    step = surrogate.B.copy()
    for _ in range(reach):
        total += step @ step.T
        step = surrogate.A @ step
    seen = float(np.max(np.diag(surrogate.C @ total @ surrogate.C.T), initial=0.0))
    return np.asarray(total * (spread**2 / seen)) if seen > 0.0 else total


@dataclass
class Ladder:
    """Filters for every level of port noise, made when first needed."""

    surrogate: Surrogate
    drive: Array
    n: int
    spread: float = 0.0
    settings: PortNoiseSettings = DEFAULT.noise
    made: dict[int, NoiseLevel] = field(default_factory=dict)

    @property
    def shares(self) -> tuple[float, ...]:
        """Return the levels of port noise, none first, without regard to their correlation."""
        return self.settings.shares

    @property
    def size(self) -> int:
        """Return the number of levels."""
        return 1 if self.surrogate.order == 0 else 1 + (len(self.shares) - 1) * len(self.settings.colours)

    def share(self, k: int) -> float:
        """Return the port noise of level ``k`` as a share of the drive.

        Args:
            k: level of port noise, from 0.

        Returns:
            The share.
        """
        return self.shares[0 if k == 0 else 1 + (k - 1) % (len(self.shares) - 1)]

    def colour(self, k: int) -> float:
        """Return the correlation from sample to sample at level ``k``.

        Args:
            k: level of port noise, from 0.

        Returns:
            The correlation.
        """
        return self.settings.colours[0 if k == 0 else (k - 1) // (len(self.shares) - 1)]

    def near(self, k: int) -> list[int]:
        """Return the levels around ``k``, of both colours, and that of no noise.

        Args:
            k: level of port noise, from 0.

        Returns:
            The levels.
        """
        if self.size == 1:
            return [0]
        count = len(self.shares) - 1
        place = 0 if k == 0 else (k - 1) % count
        around = [j for j in range(place - 3, place + 4) if 0 <= j < count]
        return [0, *(1 + j + c * count for c in range(len(self.settings.colours)) for j in around)]

    def __getitem__(self, k: int) -> NoiseLevel:
        if k not in self.made:
            self.made[k] = level(
                self.surrogate, self.share(k), self.colour(k), self.drive, self.n, self.spread, self.settings.reach
            )
        return self.made[k]


@kept()
def _gains(A, C, Q, E, P, n):  # type: ignore[no-untyped-def]
    """Return predictor gains, inverse roots, half log determinants of every sample; each output's noise is 1.

    ``E``: what that noise does to the states.
    """
    states, outputs = A.shape[0], C.shape[0]
    K = np.zeros((n, states, outputs))
    R = np.zeros((n, outputs, outputs))
    half_log = np.zeros(n)
    eye = np.eye(outputs)
    AT, CT = np.ascontiguousarray(A.T), np.ascontiguousarray(C.T)
    still = 0
    for k in range(n):
        if still > 3:  # the recursion has settled
            K[k], R[k], half_log[k] = K[k - 1], R[k - 1], half_log[k - 1]
            continue
        S = C @ P @ CT + eye
        L = np.linalg.cholesky(S)
        inverse = np.linalg.inv(L)
        IT = np.ascontiguousarray(inverse.T)
        gain = (A @ (P @ CT) + E) @ (IT @ inverse)
        K[k], R[k] = gain, inverse
        half_log[k] = np.sum(np.log(np.diag(L)))
        after = A @ P @ AT - gain @ S @ np.ascontiguousarray(gain.T) + Q
        P = 0.5 * (after + after.T)
        if k > 0 and abs(half_log[k] - half_log[k - 1]) < 1e-12 * (1.0 + abs(half_log[k])):
            still += 1
        else:
            still = 0
    return K, R, half_log


@kept()
def _responded(A, B, C, pushes):  # type: ignore[no-untyped-def]
    n, count = pushes.shape
    states, outputs = A.shape[0], C.shape[0]
    out = np.zeros((n + 1, outputs, count))
    x = np.zeros((states, count))
    fresh = np.zeros((states, count))
    for k in range(n):
        for s in range(states):
            for c in range(count):
                value = B[s] * pushes[k, c]
                for i in range(states):
                    value += A[s, i] * x[i, c]
                fresh[s, c] = value
        x, fresh = fresh, x
        for j in range(outputs):
            for c in range(count):
                value = 0.0
                for s in range(states):
                    value += C[j, s] * x[s, c]
                out[k + 1, j, c] = value
    return out


@kept()
def _filtered(A, C, K, R, columns):  # type: ignore[no-untyped-def]
    n, outputs, count = columns.shape
    states = A.shape[0]
    out = np.empty_like(columns)
    x = np.zeros((states, count))
    fresh = np.zeros((states, count))
    e = np.zeros((outputs, count))
    for k in range(n):
        for j in range(outputs):
            for c in range(count):
                value = columns[k, j, c]
                for s in range(states):
                    value -= C[j, s] * x[s, c]
                e[j, c] = value
        for j in range(outputs):
            for c in range(count):
                value = 0.0
                for i in range(j + 1):
                    value += R[k, j, i] * e[i, c]
                out[k, j, c] = value
        for s in range(states):
            for c in range(count):
                value = 0.0
                for i in range(states):
                    value += A[s, i] * x[i, c]
                for j in range(outputs):
                    value += K[k, s, j] * e[j, c]
                fresh[s, c] = value
        x, fresh = fresh, x
    return out
