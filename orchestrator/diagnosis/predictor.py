"""The one-step predictor: the plant's own equations, corrected by fixed gains at every sample.

The predictor is in innovation form: ``e = y - C x``, ``x+ = f(x + K e)``. It is compiled once per plant from the
same source that runs inside the FMU (:mod:`orchestrator.compiled`), with friction's direction smoothed by ``tanh``
so that the innovations are differentiable in the parameters, and integrated by classical Runge-Kutta steps.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from orchestrator.compiled import compiled
from pyfmu_sources import drivetrain_parameters as dt
from pyfmu_sources import servo_axis as sa

Array = NDArray[np.float64]

# Width of the smoothed friction as a share of the speed that friction removes within one step: small enough to be
# sharp, large enough for the Runge-Kutta step to be stable.
SMOOTHING = 0.6
LEAST_WIDTH_M, LEAST_WIDTH_L = 1e-3, 3e-4


def _drivetrain_stage() -> tuple[Any, Any]:
    source = compiled("equations")
    rates, twist, contact_of = source.rates, source.twist, source.contact_of
    alpha_at, j_m, j_l = dt.P_ALPHA, dt.P_J_M, dt.P_J_L
    c_m, c_l = dt.P_COULOMB_M, dt.P_COULOMB_L
    s_m, s_l, b_m, b_l = dt.P_STRIBECK_M, dt.P_STRIBECK_L, dt.P_BREAKAWAY_M, dt.P_BREAKAWAY_L

    @njit(error_model="numpy")
    def widths(p: Any, h: float) -> Any:
        friction_m = abs(p[c_m]) + max(abs(p[s_m]), abs(p[b_m]))
        friction_l = abs(p[c_l]) + max(abs(p[s_l]), abs(p[b_l]))
        width_m = max(LEAST_WIDTH_M, SMOOTHING * friction_m * h / p[j_m]) if friction_m > 0.0 else 0.0
        width_l = max(LEAST_WIDTH_L, SMOOTHING * friction_l * h / p[j_l]) if friction_l > 0.0 else 0.0
        return width_m, width_l

    @njit(error_model="numpy")
    def stage(x: Any, width: Any, p: Any, u: float) -> Any:
        sign_m = math.tanh(x[1] / width[0]) if width[0] > 0.0 else 0.0
        sign_l = math.tanh(x[3] / width[1]) if width[1] > 0.0 else 0.0
        contact = contact_of(twist(x, p), p[alpha_at]) if p[alpha_at] > 0.0 else 1
        return rates(x, contact, sign_m, sign_l, p, u, 0.0)

    return widths, stage


def _servo_axis_stage() -> tuple[Any, Any]:
    rates = compiled("servo_axis").rates
    inertia, coulomb, sliding, breakaway = sa.P_J, sa.P_COULOMB, sa.P_STRIBECK, sa.P_BREAKAWAY

    @njit(error_model="numpy")
    def widths(p: Any, h: float) -> Any:
        friction = abs(p[coulomb]) + max(abs(p[sliding]), abs(p[breakaway]))
        width = max(1e-9, SMOOTHING * friction * h / p[inertia]) if friction > 0.0 else 0.0
        return width, 0.0

    @njit(error_model="numpy")
    def stage(x: Any, width: Any, p: Any, u: float) -> Any:
        sign = math.tanh(x[1] / width[0]) if width[0] > 0.0 else 0.0
        speed, acceleration, lag = rates((x[0], x[1], x[4]), sign, p, u, 0.0)
        return (speed, acceleration, 0.0, 0.0, lag, 0.0, 0.0, 0.0)

    return widths, stage


_STAGES: dict[str, Callable[[], tuple[Any, Any]]] = {
    "Drivetrain": _drivetrain_stage,
    "ServoAxis": _servo_axis_stage,
}


@cache
def stage_of(plant: str) -> tuple[Any, Any]:
    """Return the compiled ``widths(p, h)`` and ``stage(x, width, p, u) -> rates`` of a plant."""
    return _STAGES[plant]()


@cache
def predictor_of(plant: str) -> Any:
    """Return ``predict(y, u, p, h, substeps, gains, offsets, start, innovations, states)`` of a plant, compiled.

    Shapes: y (n, 2), u (n,), gains (n, 8, 2), offsets (2,), start (8,), innovations (n, 2) out, states (n, 8) out:
    the corrected states.
    """
    widths, stage = stage_of(plant)

    @njit(error_model="numpy")
    def along(x: Any, rate: Any, h: float) -> Any:
        return (
            x[0] + h * rate[0],
            x[1] + h * rate[1],
            x[2] + h * rate[2],
            x[3] + h * rate[3],
            x[4] + h * rate[4],
            x[5] + h * rate[5],
            x[6] + h * rate[6],
            0.0,
        )

    @njit(error_model="numpy")
    def predict(
        y: Array, u: Array, p: Any, h: float, substeps: int, gains: Array, offsets: Any, start: Any,
        innovations: Array, states: Array,
    ) -> None:  # fmt: skip
        step = h / substeps
        width = widths(p, step)
        x = (start[0], start[1], start[2], start[3], start[4], start[5], start[6], 0.0)
        for n in range(u.size):
            a = y[n, 0] - x[0] - offsets[0]
            b = y[n, 1] - x[2] - offsets[1]
            innovations[n, 0] = a
            innovations[n, 1] = b
            g = gains[n]
            x = (
                x[0] + g[0, 0] * a + g[0, 1] * b,
                x[1] + g[1, 0] * a + g[1, 1] * b,
                x[2] + g[2, 0] * a + g[2, 1] * b,
                x[3] + g[3, 0] * a + g[3, 1] * b,
                x[4] + g[4, 0] * a + g[4, 1] * b,
                x[5] + g[5, 0] * a + g[5, 1] * b,
                x[6] + g[6, 0] * a + g[6, 1] * b,
                0.0,
            )
            for j in range(8):
                states[n, j] = x[j]
            for _ in range(substeps):
                k1 = stage(x, width, p, u[n])
                k2 = stage(along(x, k1, 0.5 * step), width, p, u[n])
                k3 = stage(along(x, k2, 0.5 * step), width, p, u[n])
                k4 = stage(along(x, k3, step), width, p, u[n])
                x = along(along(along(along(x, k1, step / 6.0), k2, step / 3.0), k3, step / 3.0), k4, step / 6.0)

    return predict
