"""The sampled-data stationary Kalman filter of the drivetrain without backlash, with the load torque as a state.

The state is ``(theta_m, omega_m, theta_l, omega_l, T_l, T_m)``, the measurement ``(theta_m, theta_l)``. Predict with
the held input of the past sample, then correct (Anderson and Moore, Optimal Filtering, 1979, chapter 5):

    x- = A x + B u,   e = y - C x-,   x = x- + L e,   d^2 = e' S^-1 e
"""

Vector6 = tuple[float, float, float, float, float, float]
Matrix6 = tuple[Vector6, Vector6, Vector6, Vector6, Vector6, Vector6]
Pair = tuple[float, float]
Gain = tuple[Pair, Pair, Pair, Pair, Pair, Pair]
Weight = tuple[float, float, float]
Update = tuple[Vector6, float, float, float]


def product(row: Vector6, x: Vector6) -> float:
    """Return the scalar product of two vectors of six."""
    return row[0] * x[0] + row[1] * x[1] + row[2] * x[2] + row[3] * x[3] + row[4] * x[4] + row[5] * x[5]


def predict(x: Vector6, u: float, A: Matrix6, B: Vector6) -> Vector6:
    """Return the state one sample later with the torque request ``u`` [N.m] held."""
    return (
        product(A[0], x) + B[0] * u,
        product(A[1], x) + B[1] * u,
        product(A[2], x) + B[2] * u,
        product(A[3], x) + B[3] * u,
        product(A[4], x) + B[4] * u,
        product(A[5], x) + B[5] * u,
    )


def correct(x: Vector6, theta_m: float, theta_l: float, L: Gain, weight: Weight) -> Update:
    """Return the corrected state, both innovations [rad] and the normalised innovation squared.

    ``theta_m``: measured motor angle [rad]; ``theta_l``: measured load angle [rad]; ``L``: gain, 6 x 2; ``weight``:
    ``(S11, S12, S22)`` of the inverse innovation covariance [1/rad2].
    """
    e_m = theta_m - x[0]
    e_l = theta_l - x[2]
    square = weight[0] * e_m * e_m + 2.0 * weight[1] * e_m * e_l + weight[2] * e_l * e_l
    corrected = (
        x[0] + L[0][0] * e_m + L[0][1] * e_l,
        x[1] + L[1][0] * e_m + L[1][1] * e_l,
        x[2] + L[2][0] * e_m + L[2][1] * e_l,
        x[3] + L[3][0] * e_m + L[3][1] * e_l,
        x[4] + L[4][0] * e_m + L[4][1] * e_l,
        x[5] + L[5][0] * e_m + L[5][1] * e_l,
    )
    return (corrected, e_m, e_l, square)


def update(
    x: Vector6, u: float, theta_m: float, theta_l: float, A: Matrix6, B: Vector6, L: Gain, weight: Weight
) -> Update:
    """Return :func:`correct` after :func:`predict`: one sample of the filter.

    ``u``: torque request [N.m] that was held since then; ``theta_m``: measured motor angle [rad] now; ``theta_l``:
    measured load angle [rad] now.
    """
    return correct(predict(x, u, A, B), theta_m, theta_l, L, weight)
