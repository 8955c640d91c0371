"""The frequency scan: which cycles per revolution of a periodic torque the innovations ask for."""

from dataclasses import replace

import numpy as np
from numba import prange
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.response import ErrorResponse, back_propagated, error_response
from orchestrator.diagnosis.settings import ScanSettings
from orchestrator.plants.effects import Scene
from orchestrator.shared.numba_cache import kept

Array = NDArray[np.float64]


def with_cycles(scene: Scene, likelihood: RecordLikelihood, model: Fit, parts: Parts) -> Scene:
    """Return the scene with the peaks of the frequency scan of each periodic effect.

    Args:
        scene: sizes of the record's signals.
        likelihood: of the record.
        model: the fit.
        parts: of the record: fitted, deciding, held out.

    Returns:
        The scene.
    """
    settings, plant = likelihood.settings.scan, likelihood.plant
    raw, states = likelihood.innovations(model.p, model.q)
    part, first = parts.fitted, plant.bodies[0]
    theta, omega = states[part, first.angle], states[part, first.speed]
    turns = float(np.ptp(theta)) / (2.0 * np.pi)
    if turns < settings.least_turns:
        return scene
    response = error_response(likelihood, model)
    effort = back_propagated(response, raw[part, : likelihood.signals.channels])
    cycles = cycle_grid(turns, likelihood.signals.h, scene.speed_m, settings)
    found = {}
    for effect in plant.bank:
        if "cycles_per_rev" in effect.parameters:
            column = plant.sites.index(effect.site)
            table = _gain_table(response, column, settings.response_points)
            power = _scan(np.ascontiguousarray(effort[:, column]), theta, omega, cycles, *table)
            found[effect.name] = tuple(float(c) for c in _peaks(cycles, power, settings))
    return replace(scene, cycles=found)


def cycle_grid(turns: float, h: float, speed: float, settings: ScanSettings) -> Array:
    """Return the cycles per revolution to look at.

    Args:
        turns: travel in revolutions.
        h: sample time [s].
        speed: rms speed [rad/s].
        settings: of the scan.

    Returns:
        The cycles, rising.
    """
    # Lines closer than the reciprocal of the travel cannot be told apart: a few points per such width.
    spacing = 1.0 / (settings.points * turns)
    highest = min(
        max(settings.highest, settings.highest_per_travel / turns), settings.sampling * np.pi / h / max(speed, 1e-9)
    )
    cycles = np.arange(min(settings.lowest_per_travel / turns, 0.5 * highest), highest, spacing)
    return np.asarray(cycles[:: max(1, cycles.size // settings.most_points)])


def _gain_table(response: ErrorResponse, column: int, points: int) -> tuple[Array, float]:
    """Return |response|^2 on a grid of frequencies [rad/s] and the grid's spacing."""
    top = np.pi / response.h
    grid = np.linspace(0.0, top, points)
    identity = np.eye(response.F.shape[0])
    gains = []
    for w in grid:
        phase = np.exp(1j * w * response.h)
        line = response.W @ np.linalg.solve(phase * identity - response.F, response.B[:, column])
        gains.append(float(np.sum(np.abs(response.colour.response(phase) @ line) ** 2)))
    return np.array(gains), float(grid[1])


@kept(parallel=False, nogil=True)
def _scan(effort: Array, theta: Array, omega: Array, cycles: Array, gains: Array, spacing: float) -> Array:
    """Return the gain in log-likelihood of a line at each number of cycles per revolution."""
    power = np.empty(cycles.size)
    last = gains.size - 1
    for n in prange(cycles.size):
        a, b, norm = 0.0, 0.0, 0.0
        for t in range(effort.size):
            angle = cycles[n] * theta[t]
            a += effort[t] * np.sin(angle)
            b += effort[t] * np.cos(angle)
            at = int(abs(cycles[n] * omega[t]) / spacing)
            norm += gains[at] if at <= last else 0.0
        power[n] = (a * a + b * b) / norm if norm > 0.0 else 0.0
    return power


def _peaks(cycles: Array, power: Array, settings: ScanSettings) -> Array:
    """Return the places of the highest separate peaks."""
    order = np.argsort(power)[::-1]
    chosen: list[int] = []
    for at in order:
        if all(abs(int(at) - other) > settings.separation for other in chosen):
            chosen.append(int(at))
        if len(chosen) == settings.peaks:
            break
    return cycles[chosen]


def line_spectrum(likelihood: RecordLikelihood, model: Fit, part: slice, cycles: Array) -> Array:
    """Return the promised gain in log-likelihood of a torque on the driven body at each of ``cycles``.

    Args:
        likelihood: of the record.
        model: the fitted model.
        part: samples that count.
        cycles: cycles per revolution.

    Returns:
        As many gains as cycles.
    """
    raw, states = likelihood.innovations(model.p, model.q)
    first = likelihood.plant.bodies[0]
    response = error_response(likelihood, model)
    effort = back_propagated(response, raw[part, : likelihood.signals.channels])
    table = _gain_table(response, 0, likelihood.settings.scan.response_points)
    return np.asarray(
        _scan(np.ascontiguousarray(effort[:, 0]), states[part, first.angle], states[part, first.speed], cycles, *table)
    )
