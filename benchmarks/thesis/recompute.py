"""Recomputes the thesis's matrices, gains and table on its own terms."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_are
from scipy.optimize import minimize_scalar

from benchmarks.thesis import published
from benchmarks.thesis.tables import Comparison, TableComparison
from orchestrator.plants.design import DrivetrainValues, six_state_model

Array = NDArray[np.float64]
C = np.array([[1.0, 0.0, 1.0, 0.0, 0.0, 0.0]])
C_L = np.array([[0.0, 0.0, 1.0, 0.0, 0.0, 0.0]])


def _compare(
    what: str, where: str, printed: tuple[float, ...], computed: Array, rounding: float, note: str = ""
) -> Comparison:
    """Return the comparison; ``rounding`` is the largest relative deviation that printing explains."""
    difference = float(np.max(np.abs(np.asarray(printed) - computed)) / np.max(np.abs(printed)))
    return Comparison(what, where, printed, tuple(float(v) for v in computed), difference, difference <= rounding, note)


def model_behind_the_gains() -> Array:
    """Return the A (6, 6) with which every printed gain was made: eq. 3.5 with the misprinted A(2,2)."""
    A = six_state_model(DrivetrainValues()).A.copy()
    A[1, 1] = published.A22_BEHIND_THE_GAINS
    return A


def observer_gain(A: Array, output: Array, V_d: float, V_n: float) -> Array:
    """Return ``lqr(A', C', V_d I, V_n)'``, 6 values: the stationary Kalman gain of the continuous model.

    Args:
        A: (6, 6) of the model.
        output: (1, 6) row of the measured angle.
    """
    return (output @ error_covariance(A, output, V_d, V_n)).ravel() / V_n


def error_covariance(A: Array, output: Array, V_d: float, V_n: float) -> Array:
    """Return the (6, 6) stationary covariance of the estimate's error; arguments as for :func:`observer_gain`."""
    return np.asarray(solve_continuous_are(A.T, output.T, V_d * np.eye(6), np.array([[V_n]])))


def gain_comparisons() -> list[Comparison]:
    """Return model rows and gains, printed beside recomputed."""
    A = six_state_model(DrivetrainValues()).A
    used = model_behind_the_gains()
    return [
        _compare(
            "A, row 2", "Fig. A.1", published.A_ROW_2, A[1], 5e-4, "A(2,2) differs: -0.4075 follows from the parameters"
        ),
        _compare("A, row 4", "Fig. A.1", published.A_ROW_4, A[3], 5e-4),
        _compare("K", "Fig. 3.4", published.K, observer_gain(used, C, 1.0, published.R), 5e-5),
        _compare(
            "K_fl, with backlash",
            "Fig. 3.8",
            published.K_FL,
            observer_gain(used, C_L, published.V_D_EXAMPLE, published.V_N),
            5e-5,
        ),
        _compare(
            "K_flno, without",
            "Fig. 3.9",
            published.K_FLNO,
            observer_gain(used, C_L, published.V_DNO, published.V_NNO),
            5e-5,
        ),
    ]


def size_hidden_in_the_filter() -> float:
    """Return the V_d [rad] that reproduces the printed K_fl best: the actual size, told to the estimator."""
    A = model_behind_the_gains()
    printed = np.asarray(published.K_FL)

    def misfit(log_size: float) -> float:
        return float(np.sum((observer_gain(A, C_L, np.exp(log_size), published.V_N) - printed) ** 2))

    best = minimize_scalar(misfit, bounds=(np.log(0.5), np.log(20.0)), method="bounded", options={"xatol": 1e-9})
    return float(np.exp(best.x))


def table_comparison() -> TableComparison:
    """Return the recomputed columns of Table 4.1; errors and MSE from the printed estimates."""
    rows = published.TABLE_4_1
    s = 1000.0 * np.array([row.S for row in rows])
    actual = np.array([row.alpha for row in rows])
    printed = np.array([row.estimate for row in rows])
    mapped = np.polyval(published.MAP_COEFFICIENTS, s)
    errors = 100.0 * np.abs(printed - actual) / actual
    return TableComparison(
        tuple(mapped.tolist()),
        tuple(errors.tolist()),
        float(np.max(np.abs(mapped - printed))),
        float(errors.mean()),
        float(np.mean((printed - actual) ** 2)),
    )
