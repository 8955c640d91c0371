"""Gains of controller and estimator from discrete Riccati equations, and the rank report that comes before them.

Models are those of the thesis with its errata mended: the regulator works on the controllable five-state model, the
estimator on six states with the load torque as an integrated disturbance. All gains are for a sampled system whose
input is held over a sample. scipy, which is imported where it is used, solves the Riccati equations: python-control
would call the same function, and loads matplotlib.

In all functions: ``sample_time`` [s].
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from orchestrator.errors import DesignError
from orchestrator.shared.arrays import Array

REGULATOR_STATES = ("theta_m", "omega_m", "theta_l", "omega_l", "T_m")
GAIN_UNITS = ("N.m/rad", "N.m.s/rad", "N.m/rad", "N.m.s/rad", "1")
ESTIMATOR_STATES = ("theta_m", "omega_m", "theta_l", "omega_l", "T_l", "T_m")
RANK_TOLERANCE = 1e-9


@dataclass(frozen=True)
class DrivetrainValues:
    """The linear drivetrain's values in SI units; defaults are the thesis's."""

    J_m: float = 0.4
    J_l: float = 5.6
    k: float = 3300.0
    c: float = 1.0
    b_m: float = 0.1
    b_l: float = 1.0
    i: float = 3.984
    tau: float = 1.0


class LinearModel(NamedTuple):
    """A linear model ``x' = A x + B u``, ``y = C x``."""

    A: Array
    B: Array
    C: Array


@dataclass(frozen=True)
class RankReport:
    """What controllability and observability say of a model.

    ``uncontrollable`` names the modes (eigenvalues, 1/s) that no input moves, ``stabilisable`` tells whether all
    of them decay by themselves (Popov-Belevitch-Hautus test).
    """

    order: int
    controllable: int
    observable: int
    uncontrollable: tuple[complex, ...]
    stabilisable: bool
    detectable: bool


@dataclass(frozen=True)
class Regulator:
    """State feedback ``u = -K x`` of the sampled five-state model."""

    gains: tuple[float, float, float, float, float]
    sample_time: float
    poles: tuple[complex, ...]


@dataclass(frozen=True)
class KalmanFilter:
    """Stationary Kalman filter of the sampled six-state model: see ``pyfmu_sources.estimators.kalman``.

    ``A`` 6 x 6, ``B`` 6, ``L`` 6 x 2 (filter gain), ``S_inverse`` 2 x 2 (inverse innovation covariance, 1/rad2).
    """

    A: Array
    B: Array
    L: Array
    S_inverse: Array
    sample_time: float


def six_state_model(values: DrivetrainValues) -> LinearModel:
    """Return the model of eq. 3.5 with states ``ESTIMATOR_STATES`` and outputs ``(theta_m, theta_l)``."""
    v = values
    A = np.zeros((6, 6))
    A[0, 1] = A[2, 3] = 1.0
    A[1] = [
        -v.k / (v.J_m * v.i**2),
        -(v.c / v.i**2 + v.b_m) / v.J_m,
        v.k / (v.J_m * v.i),
        v.c / (v.J_m * v.i),
        0.0,
        1.0 / v.J_m,
    ]
    A[3] = [v.k / (v.J_l * v.i), v.c / (v.J_l * v.i), -v.k / v.J_l, -(v.c + v.b_l) / v.J_l, -1.0 / v.J_l, 0.0]
    A[5, 5] = -1.0 / v.tau
    B = np.array([[0.0], [0.0], [0.0], [0.0], [0.0], [1.0 / v.tau]])
    C = np.array([[1.0, 0, 0, 0, 0, 0], [0, 0, 1.0, 0, 0, 0]])
    return LinearModel(A, B, C)


def five_state_model(values: DrivetrainValues) -> LinearModel:
    """Return the model without the load torque, states ``REGULATOR_STATES``: what a regulator can control."""
    six = six_state_model(values)
    keep = [0, 1, 2, 3, 5]
    return LinearModel(six.A[np.ix_(keep, keep)], six.B[keep], six.C[:, keep])


def rank_report(model: LinearModel) -> RankReport:
    """Return ranks, uncontrollable modes, stabilisability and detectability of ``model``.

    Ranks count the modes that pass the test of Popov, Belevitch and Hautus. The rank of python-control's ``ctrb`` is
    fooled by scaling: 3 of 5 for a rotor of 1e-4 kg.m2 that drives 10 kg.m2.
    """
    stuck, hidden = _uncontrollable_modes(model.A, model.B), _uncontrollable_modes(model.A.T, model.C.T)
    return RankReport(
        order=len(model.A),
        controllable=len(model.A) - len(stuck),
        observable=len(model.A) - len(hidden),
        uncontrollable=tuple(stuck),
        stabilisable=all(mode.real < -RANK_TOLERANCE for mode in stuck),
        detectable=all(mode.real < -RANK_TOLERANCE for mode in hidden),
    )


def _uncontrollable_modes(A: Array, B: Array) -> list[complex]:
    missed = []
    for mode in np.linalg.eigvals(A):
        pencil = np.hstack([A - mode * np.eye(A.shape[0]), B])
        pencil = pencil / np.maximum(np.linalg.norm(pencil, axis=1, keepdims=True), 1e-300)
        if np.linalg.svd(pencil, compute_uv=False)[-1] < RANK_TOLERANCE or not np.all(np.any(pencil != 0.0, axis=1)):
            missed.append(complex(mode))
    return missed


def discretise(model: LinearModel, sample_time: float) -> tuple[Array, Array]:
    """Return (A, B) of ``model`` with its input held over a sample."""
    from scipy.linalg import expm

    n, m = model.B.shape
    step = expm(np.block([[model.A, model.B], [np.zeros((m, n + m))]]) * sample_time)
    return step[:n, :n], step[:n, n:]


def solve_riccati(A: Array, B: Array, Q: Array, R: Array) -> tuple[Array, Array]:
    """Return gains (inputs, states) and cost to go (states, states) of the sampled LQR ``u = -K x``."""
    from scipy.linalg import solve_discrete_are

    P = solve_discrete_are(A, B, Q, R)
    gains: Array = np.linalg.solve(B.T @ P @ B + R, B.T @ P @ A)
    return gains, P


def design_regulator(model: LinearModel, Q: Array, R: float, sample_time: float) -> Regulator:
    """Return the sampled LQR of ``model`` for the continuous weights ``Q`` and ``R`` times the sample time.

    ``Q``: (states, states) weights of the states.
    """
    report = rank_report(model)
    if not report.stabilisable:
        modes = ", ".join(f"{mode:.3g}" for mode in report.uncontrollable)
        raise DesignError(
            f"`model` must be stabilisable, but is not: (A, B) has rank {report.controllable} of {report.order} and "
            f"no input moves the mode at {modes} 1/s; leave the uncontrollable states out of the regulator and "
            "feed their estimate forward"
        )
    A, B = discretise(model, sample_time)
    try:
        gains, _ = solve_riccati(A, B, Q * sample_time, np.array([[R * sample_time]]))
    except np.linalg.LinAlgError as error:
        raise DesignError(f"the regulator's Riccati equation has no solution: {error}") from None
    poles = np.linalg.eigvals(A - B @ gains)
    if not np.all(np.abs(poles) < 1.0):
        raise DesignError("the regulator's Riccati equation has no stabilising solution for these weights")
    k = tuple(float(g) for g in np.ravel(gains))
    return Regulator(k, sample_time, tuple(complex(p) for p in poles))  # type: ignore[arg-type]


def design_estimator(model: LinearModel, process: Array, measurement: Array, sample_time: float) -> KalmanFilter:
    """Return the stationary Kalman filter of ``model``.

    ``process``: intensities of the white noise on each state, 6 values, unit^2/s; ``measurement``: variances of both
    encoders [rad2].
    """
    if not rank_report(model).detectable:
        raise DesignError("`model` must be detectable, but a mode that does not decay reaches no output")
    A, B = discretise(model, sample_time)
    Q = _noise_covariance(model.A, np.diag(process), sample_time)
    R = np.diag(measurement)
    try:
        _, P = solve_riccati(A.T, model.C.T, Q, R)
    except np.linalg.LinAlgError as error:
        raise DesignError(f"the estimator's Riccati equation has no solution: {error}") from None
    S_inverse = np.asarray(np.linalg.inv(model.C @ P @ model.C.T + R), dtype=np.float64)
    return KalmanFilter(A, B[:, 0], P @ model.C.T @ S_inverse, S_inverse, sample_time)


def _noise_covariance(A: Array, intensity: Array, h: float) -> Array:
    """Return the covariance that white noise of ``intensity`` gathers in ``h`` (Van Loan, IEEE TAC 23(3), 1978)."""
    from scipy.linalg import expm

    n = A.shape[0]
    block = np.block([[-A, intensity], [np.zeros((n, n)), A.T]])
    step = expm(block * h)
    transposed = step[n:, n:].T
    return np.asarray(transposed @ step[:n, n:])
