"""The one-step predictor: the plant's own equations, corrected by fixed gains at every sample.

The predictor is in innovation form: ``e = y - C x``, ``x+ = f(x + K e)``. It is compiled once per plant from the
same source that runs inside the FMU (:mod:`orchestrator.compiled`) and integrated by classical Runge-Kutta steps.
The direction of dry friction, which that source takes as an argument, builds up over a short distance here (Dahl's
bristle, Canudas de Wit et al., IEEE Trans. Automatic Control 40(3), 1995): real friction does, innovations become
differentiable in the parameters, and as the distance goes to zero it is the signum that the FMU uses. In the same way
the damping of teeth that meet grows with their penetration (Hunt and Crossley, J. Applied Mechanics 42(2), 1975).
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

NEAR = 1.5  # distances of presliding per sample below which friction counts as turning round
CALM = 0.02  # distances of presliding per sample below which it hardly changes

# Nuisance parameters, appended to the plant's own: logarithms [rad] of the distance over which dry friction builds up,
# and of the penetration over which the damping of teeth in contact does.
NUISANCES = ("presliding.motor", "presliding.load", "contact.onset")


def _drivetrain_stage() -> tuple[Any, Any, Any]:
    source = compiled("equations")
    rates, twist, contact_of, level = source.rates, source.twist, source.contact_of, source.sliding_friction
    twist_rate, twist_slope = source.twist_rate, source.twist_slope
    alpha_at, end = dt.P_ALPHA, dt.COUNT
    damping_at, motor_at, load_at, onset_at = dt.P_C, dt.P_J_M, dt.P_J_L, dt.COUNT + 2
    m = (dt.P_COULOMB_M, dt.P_STRIBECK_M, dt.P_BREAKAWAY_M, dt.P_STRIBECK_SPEED_M)
    n = (dt.P_COULOMB_L, dt.P_STRIBECK_L, dt.P_BREAKAWAY_L, dt.P_STRIBECK_SPEED_L)

    @njit(error_model="numpy")
    def friction(x: Any, p: Any) -> Any:
        return level(x[1], p[m[0]], p[m[1]], p[m[2]], p[m[3]]), level(x[3], p[n[0]], p[n[1]], p[n[2]], p[n[3]])

    @njit(error_model="numpy")
    def stage(x: Any, signs: Any, p: Any, u: float) -> Any:
        if p[alpha_at] <= 0.0:
            return rates(x, 1, signs[0], signs[1], p, u, 0.0)
        angle = twist(x, p)
        contact = contact_of(angle, p[alpha_at])
        r = rates(x, contact, signs[0], signs[1], p, u, 0.0)
        if contact == 0:
            return r
        depth = abs(angle) - p[alpha_at]
        lacking = p[damping_at] * twist_rate(x, p) * math.exp(-depth / math.exp(p[onset_at]))
        motor, load = lacking * twist_slope(x, p) / p[motor_at], lacking / p[load_at]
        return (r[0], r[1] + motor, r[2], r[3] - load, r[4], r[5], r[6], r[7])

    return friction, stage, (end, end + 1)


def _servo_axis_stage() -> tuple[Any, Any, Any]:
    source = compiled("servo_axis")
    rates, level = source.rates, source.friction
    end = sa.COUNT

    @njit(error_model="numpy")
    def friction(x: Any, p: Any) -> Any:
        return level((x[0], x[1], x[4]), p), 0.0

    @njit(error_model="numpy")
    def stage(x: Any, signs: Any, p: Any, u: float) -> Any:
        speed, acceleration, lag = rates((x[0], x[1], x[4]), signs[0], p, u, 0.0)
        return (speed, acceleration, 0.0, 0.0, lag, 0.0, 0.0, 0.0)

    return friction, stage, (end, end)


_STAGES: dict[str, Callable[[], tuple[Any, Any, Any]]] = {
    "Drivetrain": _drivetrain_stage,
    "ServoAxis": _servo_axis_stage,
}


@cache
def stage_of(plant: str) -> tuple[Any, Any, Any]:
    """Return the compiled ``friction(x, p)`` (motor, load) and ``stage(x, signs, p, u) -> rates`` of a plant.

    The third item holds the places of the two nuisance parameters in the extended parameter tuple.
    """
    return _STAGES[plant]()


@njit(error_model="numpy")
def _turned(bristle: float, speed: float, level: float, rest: float, distance: float, h: float) -> Any:
    """Return the bristle [rad] after ``h`` at constant speed and friction's mean direction (Dahl, LuGre)."""
    if level <= 1e-9 * rest or rest == 0.0:
        return 0.0, 0.0
    reach = distance * level / rest
    settled = reach if speed > 0.0 else -reach
    new = settled + (bristle - settled) * math.exp(-abs(speed) * h / reach)
    return new, 0.5 * (bristle + new) / reach


@njit(error_model="numpy")
def _near_rest(speed: float, acceleration: float, distance: float, h: float) -> Any:
    """Whether dry friction may turn round within ``h``, so far that steps must be short."""
    way, change = abs(speed) * h, 1.5 * h * h * abs(acceleration)
    return way < change + NEAR * distance and way + change > CALM * distance


@njit(error_model="numpy")
def _along(x: Any, rate: Any, h: float) -> Any:
    """Return the state after a straight step; the last entry, relaxed shaft twist, is not used here."""
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
def _corrected(x: Any, g: Array, a: float, b: float) -> Any:
    """Return the state corrected by the innovations ``a`` (motor) and ``b`` (load)."""
    return (
        x[0] + g[0, 0] * a + g[0, 1] * b,
        x[1] + g[1, 0] * a + g[1, 1] * b,
        x[2] + g[2, 0] * a + g[2, 1] * b,
        x[3] + g[3, 0] * a + g[3, 1] * b,
        x[4] + g[4, 0] * a + g[4, 1] * b,
        x[5] + g[5, 0] * a + g[5, 1] * b,
        x[6] + g[6, 0] * a + g[6, 1] * b,
        0.0,
    )


@cache
def predictor_of(plant: str) -> Any:
    """Return ``predict(y, early, late, first, p, h, substeps, gains, offsets, start, innovations, states)``, compiled.

    In each sample the torque ``early`` acts for ``first`` [s], then ``late`` (a dead time is no multiple of ``h``).
    ``substeps`` are the Runge-Kutta steps of a sample, and of one in which dry friction may turn round.
    Shapes: y (n, 2), early and late (n,), gains (n, 8, 2), offsets (2,), start (8,), innovations (n, 2) out,
    states (n, 8) out: the corrected states. ``p`` is the plant's tuple followed by ``NUISANCES``.
    """
    friction, stage, nuisance = stage_of(plant)
    at_m, at_l = nuisance

    @njit(error_model="numpy")
    def advanced(x: Any, signs: Any, p: Any, torque: float, step: float) -> Any:
        k1 = stage(x, signs, p, torque)
        k2 = stage(_along(x, k1, 0.5 * step), signs, p, torque)
        k3 = stage(_along(x, k2, 0.5 * step), signs, p, torque)
        k4 = stage(_along(x, k3, step), signs, p, torque)
        return _along(_along(_along(_along(x, k1, step / 6.0), k2, step / 3.0), k3, step / 3.0), k4, step / 6.0)

    @njit(error_model="numpy", nogil=True)
    def predict(
        y: Array, early: Array, late: Array, first: float, p: Any, h: float, substeps: Any, gains: Array, offsets: Any,
        start: Any, innovations: Array, states: Array,
    ) -> None:  # fmt: skip
        x = (start[0], start[1], start[2], start[3], start[4], start[5], start[6], 0.0)
        at_rest = friction((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), p)
        sliding = friction((0.0, 1e6, 0.0, 1e6, 0.0, 0.0, 0.0, 0.0), p)
        rest = (max(at_rest[0], sliding[0]), max(at_rest[1], sliding[1]))
        reach_m, reach_l = math.exp(p[at_m]), math.exp(p[at_l])
        bristle_m, bristle_l = 0.0, 0.0
        signs = (0.0, 0.0)
        for n in range(late.size):
            a = y[n, 0] - x[0] - offsets[0]
            b = y[n, 1] - x[2] - offsets[1]
            innovations[n, 0] = a
            innovations[n, 1] = b
            x = _corrected(x, gains[n], a, b)
            for j in range(8):
                states[n, j] = x[j]
            steps = substeps[0]
            if rest[0] > 0.0 or rest[1] > 0.0:
                rate = stage(x, signs, p, late[n])
                turning_m = rest[0] > 0.0 and _near_rest(x[1], rate[1], reach_m, h)
                turning_l = rest[1] > 0.0 and _near_rest(x[3], rate[3], reach_l, h)
                if turning_m or turning_l:
                    steps = substeps[1]
            for piece in range(2):
                span, torque = (first, early[n]) if piece == 0 else (h - first, late[n])
                if span <= 1e-9 * h:
                    continue
                count = math.ceil(steps * span / h - 1e-9)
                step = span / count
                for _ in range(count):
                    if rest[0] > 0.0 or rest[1] > 0.0:
                        level = friction(x, p)
                        bristle_m, sign_m = _turned(bristle_m, x[1], level[0], rest[0], reach_m, step)
                        bristle_l, sign_l = _turned(bristle_l, x[3], level[1], rest[1], reach_l, step)
                        signs = (sign_m, sign_l)
                    x = advanced(x, signs, p, torque, step)

    return predict
