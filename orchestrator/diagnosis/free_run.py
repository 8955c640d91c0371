"""Free-run simulation of the exact, event-located plant over a part of a record, and the gap that it leaves.

The initial state of the simulation is not measured. It starts from the predictor's estimate at the first sample
(which has seen earlier samples only) and is then chosen so that the simulation lies closest to the measurement:
five numbers against thousands of samples, for the nominal and the corrected model alike. Parameters stay as they are.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from orchestrator.compiled import compiled
from orchestrator.diagnosis.likelihood import Signals
from orchestrator.diagnosis.plants import Plant

Array = NDArray[np.float64]

ITERATIONS = 12
FADE = 1e-10
CLOSE = 1.3  # rms in units of the noise up to which a run is close
GROWING = (0.1, 0.25, 0.5, 1.0)


@dataclass(frozen=True)
class FreeRun:
    """A simulated part of a record.

    Attributes:
        outputs: (n, channels) simulated encoder angles.
        start: (8,) the initial state.
        rms: (channels,) rms of simulated minus measured.
    """

    outputs: Array
    start: Array
    rms: Array


@cache
def _drivetrain_runner() -> Any:
    source = compiled("drivetrain")
    advance, initial_mode, prepare, consistent = (
        source.advance, source.initial_mode, source.prepare, source.consistent_start,
    )  # fmt: skip

    @njit
    def run(start: Any, p: Any, early: Array, late: Array, first: float, h: float, out: Array) -> None:
        x = consistent((start[0], start[1], start[2], start[3], start[4], start[5], start[6], 0.0), p)
        mode = initial_mode(x, p)
        whole = prepare(p, h)
        before, after = prepare(p, max(first, 1e-9)), prepare(p, max(h - first, 1e-9))
        for n in range(out.shape[0]):
            out[n, 0], out[n, 1] = x[0], x[2]
            if first <= 1e-9:
                x, mode = advance(x, mode, p, late[n], 0.0, h, whole)
            else:
                x, mode = advance(x, mode, p, early[n], 0.0, first, before)
                x, mode = advance(x, mode, p, late[n], 0.0, h - first, after)

    return run


@cache
def _servo_axis_runner() -> Any:
    source = compiled("servo_axis")
    advance, initial_mode = source.advance, source.initial_mode

    @njit
    def run(start: Any, p: Any, early: Array, late: Array, first: float, h: float, out: Array) -> None:
        x = (start[0], start[1], start[4])
        mode = initial_mode(x, p, early[0])
        for n in range(out.shape[0]):
            out[n, 0], out[n, 1] = x[0], 0.0
            if first > 1e-9:
                x, mode = advance(x, mode, p, early[n], 0.0, first)
            x, mode = advance(x, mode, p, late[n], 0.0, h - first)

    return run


_RUNNERS: dict[str, Callable[[], Any]] = {"Drivetrain": _drivetrain_runner, "ServoAxis": _servo_axis_runner}


def simulate(plant: Plant, p: Array, start: Array, signals: Signals, part: slice, history: bool = True) -> Array:
    """Return the simulated encoder angles (n, 2) of a part of a record.

    Args:
        plant: the plant.
        p: its parameters.
        start: (8,) state at the part's first sample.
        signals: of the record; requests before the part matter when there is a dead time.
        part: samples to simulate.
        history: requests before the part are still under way in a dead time; False: there were none, as in an FMU
            that starts with the part.
    """
    begin, end, _ = part.indices(signals.size)
    limit = p[plant.index("effects.torque_saturation.limit")]
    delay = float(p[plant.index("effects.input_delay.delay")])
    u = np.clip(signals.u, -limit, limit)
    whole = int(np.floor(delay / signals.h + 1e-9))
    first = delay - whole * signals.h
    at = np.arange(begin, end)
    late, early = (_requests(u, at - back, 0 if history else begin) for back in (whole, whole + 1))
    out = np.empty((end - begin, 2))
    flat = tuple(float(v) for v in p[: len(plant.table)])
    _RUNNERS[plant.name]()(tuple(start.tolist()), flat, early, late, max(first, 0.0), signals.h, out)
    for channel, name in enumerate(plant.offsets):
        out[:, channel] += p[plant.index(name)]
    return out


def _requests(u: Array, at: NDArray[np.int64], first: int) -> Array:
    """Return the requests at samples ``at``; there were none before ``first``."""
    return np.where(at >= first, u[np.maximum(at, 0)], u[0] if first == 0 else 0.0)


def free_run(plant: Plant, p: Array, guess: Array, signals: Signals, part: slice, history: bool = True) -> FreeRun:
    """Return the free run whose initial state lies closest to the measurement.

    Where impacts make the end of a run depend on its start in no simple way, a run that has not come close is sought
    again over growing parts of its length.
    """
    first = _closest(plant, p, guess, signals, part, history)
    if float(np.max(first.rms / signals.noise)) < CLOSE:
        return first
    begin, end, _ = part.indices(signals.size)
    start = guess
    for share in GROWING:
        run = _closest(plant, p, start, signals, slice(begin, begin + max(round(share * (end - begin)), 10)), history)
        start = run.start
    cost, other = (float(np.sum((r.rms / signals.noise) ** 2)) for r in (first, run))
    return run if other < cost else first


def _closest(plant: Plant, p: Array, guess: Array, signals: Signals, part: slice, history: bool) -> FreeRun:
    """Return the free run at which a descent from the ``guess`` of its initial state ends (damped Gauss-Newton)."""
    m = signals.channels
    measured = signals.y[part, :m]
    scale = signals.noise

    def outputs(start: Array) -> Array:
        return simulate(plant, p, start, signals, part, history)[:, :m]

    start = _followed(plant, np.array(guess, dtype=float))
    free = _free_places(plant, p)
    steps = _steps(start, signals, free)
    out = outputs(start)
    cost = _cost(out, measured, scale)
    damping = 1e-6
    for _ in range(ITERATIONS):
        J = np.column_stack(
            [
                ((outputs(_followed(plant, _nudged(start, place, step))) - out) / step / scale).ravel()
                for place, step in zip(free, steps, strict=True)
            ]
        )
        residual = ((out - measured) / scale).ravel()
        if not np.all(np.isfinite(J)):
            break
        improved = False
        for _ in range(6):
            H = J.T @ J
            change = -np.linalg.solve(H + np.diag(damping * np.diag(H) + FADE * np.trace(H)), J.T @ residual)
            moved = start.copy()
            moved[list(free)] += change
            moved = _followed(plant, moved)
            tried = outputs(moved)
            new = _cost(tried, measured, scale)
            if np.isfinite(new) and new < cost:
                improved, start, out, gain, cost, damping = True, moved, tried, cost - new, new, damping / 10.0
                break
            damping *= 10.0
        if not improved or gain < 1e-4 * cost:
            break
    rms = np.sqrt(np.mean((out - measured) ** 2, axis=0))
    return FreeRun(out, start, rms)


def _cost(out: Array, measured: Array, scale: Array) -> float:
    return float(np.sum(((out - measured) / scale) ** 2))


def _nudged(start: Array, place: int, step: float) -> Array:
    moved = start.copy()
    moved[place] += step
    return moved


def _followed(plant: Plant, start: Array) -> Array:
    """Return the state with the extra inertia at rest relative to what carries it."""
    moved = start.copy()
    for place, followed in plant.followers:
        moved[place] = moved[followed]
    return moved


def _free_places(plant: Plant, p: Array) -> tuple[int, ...]:
    return tuple(place for place in plant.states if place != 4 or p[plant.index("tau")] > 0.0)


def _steps(start: Array, signals: Signals, free: tuple[int, ...]) -> list[float]:
    sizes = {0: signals.noise[0], 2: signals.noise[-1], 1: 0.01 * abs(start[1]) + 1e-3, 3: 0.01 * abs(start[3]) + 1e-3}
    sizes[4] = 0.01 * signals.torque
    return [0.1 * float(sizes[place]) for place in free]
