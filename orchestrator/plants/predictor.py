"""The one-step predictor: the plant's own equations, corrected by fixed gains at every sample.

The predictor is in innovation form: ``e = y - C x``, ``x+ = f(x + K e)``. It is compiled once per plant from the
same source that runs inside the FMU (:mod:`orchestrator.plants.compiled`), one sample after the other
(:mod:`orchestrator.plants.sample`).

Where a gap lies between the encoder and what is not measured, gains of the plant without it lead astray while the
teeth are apart. They are then those of a filter that is linearised along the motion itself, by differences as wide as
its own uncertainty (Norgaard, Poulsen and Ravn, Automatica 36(11), 2000): a flank that may be reached counts in part.
"""

import math
from functools import cache, lru_cache
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from orchestrator.plants.description import Plant
from orchestrator.plants.sample import is_usual, parameters_of, sample_of
from orchestrator.shared.numba_cache import ALGEBRA, UNCOUNTED, kept

Array = NDArray[np.float64]

FINER = 8  # times more steps of a free run in a sample in which friction may turn round or teeth meet, as in fits
MOST_STEPS = 1000  # of a free run in a sample: with values that ask for more a model is lost, and not waited for
WAVE = 0.05  # of a wave's period: the farthest that a Runge-Kutta step of a free run goes


@njit(error_model="numpy", **ALGEBRA, **UNCOUNTED)
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
        x[7],
    )


@njit(error_model="numpy", **ALGEBRA)
def _root(P: Array) -> Array:
    """Return the lower Cholesky factor of a covariance; directions that are known exactly get a column of zeros."""
    k = P.shape[0]
    root = np.zeros((k, k))
    for j in range(k):
        pivot = P[j, j]
        for i in range(j):
            pivot -= root[j, i] ** 2
        if pivot <= 1e-12 * P[j, j]:
            continue
        root[j, j] = math.sqrt(pivot)
        for r in range(j + 1, k):
            total = P[r, j]
            for i in range(j):
                total -= root[r, i] * root[j, i]
            root[r, j] = total / root[j, j]
    return root


def predictor_of(plant: Plant, p: Any) -> Any:
    """Return ``predict(y, early, late, first, p, h, substeps, gains, offsets, start, innovations, states)``, compiled.

    In each sample the torque ``early`` acts for ``first`` [s], then ``late`` (a dead time is no multiple of ``h``).
    ``substeps`` are the Runge-Kutta steps of a sample, and of one in which friction may turn round or teeth meet.
    Shapes: y (n, 2), early and late (n,), gains (n, 8, 2), offsets (2,), start (8,), innovations (n, 2) out,
    states (n, 8) out: the corrected states. ``p`` is the plant's tuple followed by its nuisance parameters.

    Args:
        plant: whose equations it has.
        p: parameters that it is to be called with.

    Returns:
        The function, of machine code.
    """
    return _predictor(plant, is_usual(plant, p))


@cache
def _predictor(plant: Plant, usual: bool) -> Any:
    prepared, sample = sample_of(plant)
    parameters = parameters_of(plant, usual)

    @kept(error_model="numpy", nogil=True, **ALGEBRA)
    def predict(
        y: Array, early: Array, late: Array, first: float, p: Any, h: float, substeps: Any, gains: Array, offsets: Any,
        start: Any, innovations: Array, states: Array,
    ) -> None:  # fmt: skip
        x = (start[0], start[1], start[2], start[3], start[4], start[5], start[6], 0.0)
        values = parameters(p)
        common = prepared(values, first, h, substeps)
        memory = (0.0, 0.0, 0.0, 0.0)
        for n in range(late.size):
            a = y[n, 0] - x[0] - offsets[0]
            b = y[n, 1] - x[2] - offsets[1]
            innovations[n, 0] = a
            innovations[n, 1] = b
            x = _corrected(x, gains[n], a, b)
            for j in range(8):
                states[n, j] = x[j]
            x, memory = sample(x, memory, values, common, (early[n], late[n]))

    return predict


def coarse_runner_of(plant: Plant, p: Any) -> Any:
    """Return ``run(start, p, early, late, first, h, substeps, out)``, compiled: the predictor, never corrected.

    Args:
        plant: whose equations it has.
        p: parameters that it is to be called with.

    Returns:
        The function, of machine code; its arguments are those of :func:`predictor_of`, and out (n, 2), the angles.
    """
    return _coarse_runner(plant, is_usual(plant, p))


@cache
def _coarse_runner(plant: Plant, usual: bool) -> Any:
    prepared, sample = sample_of(plant)
    parameters = parameters_of(plant, usual)

    @kept(error_model="numpy", nogil=True, **ALGEBRA)
    def run(start: Any, p: Any, early: Array, late: Array, first: float, h: float, substeps: Any, out: Array) -> None:
        x = (start[0], start[1], start[2], start[3], start[4], start[5], start[6], start[7])
        values = parameters(p)
        common = prepared(values, first, h, substeps)
        memory = (0.0, 0.0, 0.0, 0.0)
        for n in range(late.size):
            out[n, 0], out[n, 1] = x[0], x[2]
            x, memory = sample(x, memory, values, common, (early[n], late[n]))

    return run


def runs_coarsely(plant: Plant, p: Array) -> bool:
    """Tell whether the predictor's own steps follow a model closely, at far less than its exact runs cost.

    So it is for two bodies with nonlinear effects of the bank, but none that makes impacts or a resonance of its own.

    Args:
        plant: the plant.
        p: the predictor's parameters.

    Returns:
        True when they do.
    """
    shaft, added, drive = plant.shaft, plant.resonance, plant.drive
    if shaft is None or (shaft.gap and plant.value(p, shaft.gap) > 0.0):
        return False
    if added is not None and plant.value(p, added.inertia) > 0.0:
        return False
    quick = {*plant.linear, *plant.offsets, *plant.enumerations, drive.delay, drive.limit}
    on = {entry.name for n, entry in enumerate(plant.table) if p[n] != entry.default} - quick
    known = {name for effect in plant.bank for name in effect.parameters.values()}
    return bool(on) and on <= known


def waves_of(plant: Plant, p: Array) -> dict[int, float]:
    """Return the periods, in the motor's angle [rad], of what repeats in a model with position.

    Args:
        plant: the plant.
        p: the predictor's parameters.

    Returns:
        Place of each amplitude -> period.
    """
    found = {}
    for effect in plant.bank:
        place = effect.places(plant)[effect.size]
        if effect.phase and p[place] != 0.0:
            cycles = effect.parameters.get("cycles_per_rev")
            turns = abs(plant.value(p, cycles)) if cycles else 1.0 / plant.ratio(p)
            if turns > 0.0:  # else it is one torque everywhere
                found[place] = 2.0 * math.pi / turns
    return found


def coarse_steps(plant: Plant, p: Array, h: float, turn: float) -> int:
    """Return the predictor's own steps in a sample with which a free run follows a model's modes and its waves.

    Args:
        plant: the plant.
        p: the predictor's parameters.
        h: a sample [s].
        turn: the farthest that the motor turns in it [rad].

    Returns:
        At least 1, and ``MOST_STEPS`` at most.
    """
    return _coarse_steps(plant, p.tobytes(), h, turn)


@lru_cache(maxsize=256)
def _coarse_steps(plant: Plant, values: bytes, h: float, turn: float) -> int:
    """Return what :func:`coarse_steps` does; a model is run many times from one start after the other."""
    p = np.frombuffer(values)
    shortest = min(waves_of(plant, p).values(), default=math.inf)
    return min(max(plant.substeps(p, h), math.ceil(min(turn / (WAVE * shortest), MOST_STEPS))), MOST_STEPS)


@cache
def follower_of(plant: Plant) -> Any:
    """Return ``run(y, early, late, first, p, h, substeps, offsets, start, places, measured, P, Q, R, gains, roots)``.

    It fills the gains of a filter that is linearised along its own motion. ``places`` (k,) are the states that the
    filter has, ``measured`` (m,) the rows of them that are measured, P (k, k), Q (k, k) and R (m, m) covariances of
    start, process and measurement; gains (n, k, m) and roots (n, m, m), inverse Cholesky factors of the innovations'
    covariance, are filled. The others are as in :func:`predictor_of`.

    Args:
        plant: whose equations it has.

    Returns:
        The function, of machine code.
    """
    prepared, sample = sample_of(plant)
    followers = np.array(plant.followers, dtype=np.int64).reshape(-1, 2)

    @njit(error_model="numpy", **ALGEBRA)
    def moved(x: Any, places: Any, by: Array) -> Any:
        wide = np.zeros(8)
        for j in range(by.size):
            wide[places[j]] = by[j]
        for n in range(followers.shape[0]):
            wide[followers[n, 0]] = wide[followers[n, 1]]
        return (
            x[0] + wide[0], x[1] + wide[1], x[2] + wide[2], x[3] + wide[3], x[4] + wide[4], x[5] + wide[5],
            x[6] + wide[6], x[7],
        )  # fmt: skip

    @kept(error_model="numpy", nogil=True, **ALGEBRA)
    def follow(
        y: Array, early: Array, late: Array, first: float, p: Any, h: float, substeps: Any, offsets: Any, start: Any,
        places: Any, measured: Any, P: Array, Q: Array, R: Array, gains: Array, roots: Array,
    ) -> None:  # fmt: skip
        x = (start[0], start[1], start[2], start[3], start[4], start[5], start[6], 0.0)
        common = prepared(p, first, h, substeps)
        memory = (0.0, 0.0, 0.0, 0.0)
        k, m = places.size, measured.size
        C = np.zeros((m, k))
        for c in range(m):
            C[c, measured[c]] = 1.0
        spread, identity = np.zeros((k, k)), np.eye(k)
        error = np.zeros(m)
        for n in range(late.size):
            S = C @ P @ C.T + R
            roots[n] = np.linalg.inv(np.linalg.cholesky(S))
            gain = P @ C.T @ np.linalg.inv(S)
            gains[n] = gain
            error[0] = y[n, 0] - x[0] - offsets[0]
            if m > 1:
                error[1] = y[n, 1] - x[2] - offsets[1]
            x = moved(x, places, gain @ error)
            unmeasured = identity - gain @ C
            P = unmeasured @ P @ unmeasured.T + gain @ R @ gain.T
            root = _root(P)
            torques = (early[n], late[n])
            for j in range(k):
                ahead, _ = sample(moved(x, places, root[:, j]), memory, p, common, torques)
                back, _ = sample(moved(x, places, -root[:, j]), memory, p, common, torques)
                for i in range(k):
                    spread[i, j] = 0.5 * (ahead[places[i]] - back[places[i]])
            P = spread @ spread.T + Q
            x, memory = sample(x, memory, p, common, torques)

    return follow
