"""The one-step predictor: the plant's own equations, corrected by fixed gains at every sample.

The predictor is in innovation form: ``e = y - C x``, ``x+ = f(x + K e)``. It is compiled once per plant from the
same source that runs inside the FMU (:mod:`orchestrator.plants.compiled`), integrated by classical Runge-Kutta steps.
The direction of dry friction, which that source takes as an argument, builds up over a short distance here (Dahl's
bristle, Canudas de Wit et al., IEEE Trans. Automatic Control 40(3), 1995): real friction does, innovations become
differentiable in the parameters, and as the distance goes to zero it is the signum that the FMU uses. In the same way
the damping of teeth that meet grows with their penetration (Hunt and Crossley, J. Applied Mechanics 42(2), 1975).

Where a gap lies between the encoder and what is not measured, gains of the plant without it lead astray while the
teeth are apart. They are then those of a filter that is linearised along the motion itself, by differences as wide as
its own uncertainty (Norgaard, Poulsen and Ravn, Automatica 36(11), 2000): a flank that may be reached counts in part.
"""

import math
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from orchestrator.plants.description import Plant
from orchestrator.shared.numba_cache import UNCOUNTED, kept

Array = NDArray[np.float64]

NEAR = 1.5  # distances of presliding per sample below which friction counts as turning round
LAGGED = 4  # place of the drive's torque in the state
FINER = 8  # times more steps of a free run in a sample in which dry friction may turn round, as in fits
MOST_STEPS = 1000  # of a free run in a sample: with values that ask for more a model is lost, and not waited for
WAVE = 0.05  # of a wave's period: the farthest that a Runge-Kutta step of a free run goes
CALM = 0.02  # distances of presliding per sample below which it hardly changes


@njit(error_model="numpy", **UNCOUNTED)
def _turned(bristle: float, speed: float, level: float, rest: float, distance: float, h: float) -> Any:
    """Return the bristle [rad] after ``h`` at constant speed and friction's mean direction (Dahl, LuGre)."""
    if level <= 1e-9 * rest or rest == 0.0:
        return 0.0, 0.0
    reach = distance * level / rest
    settled = reach if speed > 0.0 else -reach
    new = settled + (bristle - settled) * math.exp(-abs(speed) * h / reach)
    return new, 0.5 * (bristle + new) / reach


@njit(error_model="numpy", **UNCOUNTED)
def _near_rest(speed: float, acceleration: float, distance: float, h: float) -> Any:
    """Whether dry friction may turn round within ``h``, so far that steps must be short."""
    way, change = abs(speed) * h, 1.5 * h * h * abs(acceleration)
    return way < change + NEAR * distance and way + change > CALM * distance


@njit(error_model="numpy", **UNCOUNTED)
def _along(x: Any, rate: Any, h: float) -> Any:
    """Return the state after a straight step; the last entry is the memory of the shaft's hysteresis here."""
    return (
        x[0] + h * rate[0],
        x[1] + h * rate[1],
        x[2] + h * rate[2],
        x[3] + h * rate[3],
        x[4] + h * rate[4],
        x[5] + h * rate[5],
        x[6] + h * rate[6],
        x[7] + h * rate[7],
    )


@njit(error_model="numpy", **UNCOUNTED)
def _delivered(before: float, asked: float, lag: float, h: float) -> Any:
    """Return the drive's torque at the beginning, in the middle and at the end of a step as it acts, and as it is left.

    It follows what is asked by a lag that may be far quicker than the step. What acts is the straight line with the
    same impulse and the same moment, which moves a mass as far.
    """
    if lag <= 0.0:
        return before, before, before, before
    ratio = h / lag
    if ratio < 1e-3:
        end = before + (asked - before) * ratio * (1.0 - 0.5 * ratio)
        return before, 0.5 * (before + end), end, end
    faded = math.exp(-ratio)
    mean = (1.0 - faded) / ratio
    slope = 12.0 * ((1.0 - faded * (1.0 + ratio)) / ratio**2 - 0.5 * mean)
    off = before - asked
    return (
        asked + off * (mean - 0.5 * slope), asked + off * mean, asked + off * (mean + 0.5 * slope), asked + off * faded,
    )  # fmt: skip


@njit(error_model="numpy", **UNCOUNTED)
def _with_torque(x: Any, torque: float) -> Any:
    """Return the state with another torque of the drive."""
    return (x[0], x[1], x[2], x[3], torque, x[5], x[6], x[7])


@njit(error_model="numpy", **UNCOUNTED)
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


@njit(error_model="numpy")
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


class Sample(NamedTuple):
    """One sample of a plant: ``rest_of(p)``, ``reach_of(p)`` of its dry friction, and ``sample``, compiled."""

    rest_of: Any
    reach_of: Any
    sample: Any


@cache
def sample_of(plant: Plant) -> Sample:
    """Return the compiled equations of one sample.

    References are counted in them: equations of a plant that say nothing else inherit that, and may make arrays.

    Args:
        plant: whose equations they are.

    Returns:
        ``rest_of``, ``reach_of`` and ``sample``.
    """
    friction, stage, (at_m, at_l) = plant.stage()
    at_lag = plant.index(plant.drive.lag)

    @njit(error_model="numpy", forceinline=True)
    def advanced(x: Any, signs: Any, p: Any, torque: float, step: float) -> Any:
        begin, middle, end, left = _delivered(x[LAGGED], torque, p[at_lag], step)
        k1 = stage(_with_torque(x, begin), signs, p, torque)
        k2 = stage(_with_torque(_along(x, k1, 0.5 * step), middle), signs, p, torque)
        k3 = stage(_with_torque(_along(x, k2, 0.5 * step), middle), signs, p, torque)
        k4 = stage(_with_torque(_along(x, k3, step), end), signs, p, torque)
        new = _along(_along(_along(_along(x, k1, step / 6.0), k2, step / 3.0), k3, step / 3.0), k4, step / 6.0)
        return _with_torque(new, left)

    @njit(error_model="numpy")
    def rest_of(p: Any) -> Any:
        at_rest = friction((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), p)
        sliding = friction((0.0, 1e6, 0.0, 1e6, 0.0, 0.0, 0.0, 0.0), p)
        return (max(at_rest[0], sliding[0]), max(at_rest[1], sliding[1]))

    @njit(error_model="numpy")
    def reach_of(p: Any) -> Any:
        return (math.exp(p[at_m]), math.exp(p[at_l]))

    @njit(error_model="numpy", forceinline=True)
    def sample(x: Any, memory: Any, p: Any, rest: Any, reach: Any, torques: Any, first: float, h: float,
               substeps: Any) -> Any:  # fmt: skip
        """Return the state and what friction remembers (bristles, directions) one sample on."""
        bristle_m, bristle_l, sign_m, sign_l = memory
        signs = (sign_m, sign_l)
        steps = substeps[0]
        if rest[0] > 0.0 or rest[1] > 0.0:
            rate = stage(x, signs, p, torques[1])
            turning_m = rest[0] > 0.0 and _near_rest(x[1], rate[1], reach[0], h)
            turning_l = rest[1] > 0.0 and _near_rest(x[3], rate[3], reach[1], h)
            if turning_m or turning_l:
                steps = substeps[1]
        for piece in range(2):
            span, torque = (first, torques[0]) if piece == 0 else (h - first, torques[1])
            if span <= 1e-9 * h:
                continue
            count = math.ceil(steps * span / h - 1e-9)
            step = span / count
            for _ in range(count):
                if rest[0] > 0.0 or rest[1] > 0.0:
                    level = friction(x, p)
                    bristle_m, sign_m = _turned(bristle_m, x[1], level[0], rest[0], reach[0], step)
                    bristle_l, sign_l = _turned(bristle_l, x[3], level[1], rest[1], reach[1], step)
                    signs = (sign_m, sign_l)
                x = advanced(x, signs, p, torque, step)
        return x, (bristle_m, bristle_l, signs[0], signs[1])

    return Sample(rest_of, reach_of, sample)


@cache
def predictor_of(plant: Plant) -> Any:
    """Return ``predict(y, early, late, first, p, h, substeps, gains, offsets, start, innovations, states)``, compiled.

    In each sample the torque ``early`` acts for ``first`` [s], then ``late`` (a dead time is no multiple of ``h``).
    ``substeps`` are the Runge-Kutta steps of a sample, and of one in which dry friction may turn round.
    Shapes: y (n, 2), early and late (n,), gains (n, 8, 2), offsets (2,), start (8,), innovations (n, 2) out,
    states (n, 8) out: the corrected states. ``p`` is the plant's tuple followed by its nuisance parameters.

    Args:
        plant: whose equations it has.

    Returns:
        The function, of machine code.
    """
    rest_of, reach_of, sample = sample_of(plant)

    @kept(error_model="numpy", nogil=True)
    def predict(
        y: Array, early: Array, late: Array, first: float, p: Any, h: float, substeps: Any, gains: Array, offsets: Any,
        start: Any, innovations: Array, states: Array,
    ) -> None:  # fmt: skip
        x = (start[0], start[1], start[2], start[3], start[4], start[5], start[6], 0.0)
        rest, reach = rest_of(p), reach_of(p)
        memory = (0.0, 0.0, 0.0, 0.0)
        for n in range(late.size):
            a = y[n, 0] - x[0] - offsets[0]
            b = y[n, 1] - x[2] - offsets[1]
            innovations[n, 0] = a
            innovations[n, 1] = b
            x = _corrected(x, gains[n], a, b)
            for j in range(8):
                states[n, j] = x[j]
            x, memory = sample(x, memory, p, rest, reach, (early[n], late[n]), first, h, substeps)

    return predict


@cache
def coarse_runner_of(plant: Plant) -> Any:
    """Return ``run(start, p, early, late, first, h, substeps, out)``, compiled: the predictor, never corrected.

    Args:
        plant: whose equations it has.

    Returns:
        The function, of machine code; its arguments are those of :func:`predictor_of`, and out (n, 2), the angles.
    """
    rest_of, reach_of, sample = sample_of(plant)

    @kept(error_model="numpy", nogil=True)
    def run(start: Any, p: Any, early: Array, late: Array, first: float, h: float, substeps: Any, out: Array) -> None:
        x = (start[0], start[1], start[2], start[3], start[4], start[5], start[6], start[7])
        rest, reach = rest_of(p), reach_of(p)
        memory = (0.0, 0.0, 0.0, 0.0)
        for n in range(late.size):
            out[n, 0], out[n, 1] = x[0], x[2]
            x, memory = sample(x, memory, p, rest, reach, (early[n], late[n]), first, h, substeps)

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
    rest_of, reach_of, sample = sample_of(plant)
    followers = np.array(plant.followers, dtype=np.int64).reshape(-1, 2)

    @njit(error_model="numpy")
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

    @kept(error_model="numpy", nogil=True)
    def follow(
        y: Array, early: Array, late: Array, first: float, p: Any, h: float, substeps: Any, offsets: Any, start: Any,
        places: Any, measured: Any, P: Array, Q: Array, R: Array, gains: Array, roots: Array,
    ) -> None:  # fmt: skip
        x = (start[0], start[1], start[2], start[3], start[4], start[5], start[6], 0.0)
        rest, reach = rest_of(p), reach_of(p)
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
                ahead, _ = sample(moved(x, places, root[:, j]), memory, p, rest, reach, torques, first, h, substeps)
                back, _ = sample(moved(x, places, -root[:, j]), memory, p, rest, reach, torques, first, h, substeps)
                for i in range(k):
                    spread[i, j] = 0.5 * (ahead[places[i]] - back[places[i]])
            P = spread @ spread.T + Q
            x, memory = sample(x, memory, p, rest, reach, torques, first, h, substeps)

    return follow
