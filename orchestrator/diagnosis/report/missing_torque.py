"""For each effect the torque that the model misses without it, and what of that its law accounts for."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from orchestrator.diagnosis.data.signals import smooth
from orchestrator.diagnosis.model.plant_effects import unit_in
from orchestrator.diagnosis.result import Diagnosis, GradedEffect
from orchestrator.shared.arrays import Array

BINS = 40
WIDEST_GAP = 0.2  # of what a signal takes: no line is drawn over values that it does not take
SHOWN_SECONDS = 4.0  # of an effect that follows the time


@dataclass(frozen=True)
class MissingTorque:
    """The missing torque over the signal that an effect's law follows: means of bins, or values over the time."""

    label: str  # name and site, as the bank of effects has them
    x_label: str  # the signal that the law follows, with its unit in brackets
    y_label: str  # torque or force, its place and unit
    x: Array  # (n,) NaN where the signal leaves a wide gap
    missing: Array  # (n,) what is missing without the effect
    law: Array  # (n,) what of it the law accounts for
    spread: Array | None  # (n,) standard deviation within the bins; None over the time


def missing_torques(diagnosis: Diagnosis) -> Iterator[MissingTorque]:
    """Yield the missing torque of each effect of the final model; a gap that the estimator found has none."""
    labels = set(diagnosis.workings.search.final.labels)
    return (_missing_torque(diagnosis, effect) for effect in diagnosis.effects if effect.label in labels)


def _missing_torque(diagnosis: Diagnosis, effect: GradedEffect) -> MissingTorque:
    balance, found = diagnosis.workings.balances[0], diagnosis.workings.search
    point = found.problem.record_points(found.final.point)[0]
    with_it = balance.balance(balance.values_at(point))
    without = balance.balance(balance.values_at(point.without_effects([effect.label])))
    bodies = [n for n, name in enumerate(balance.channels) if name == effect.site]
    channel = bodies[0] if bodies else int(np.argmax(np.mean((without - with_it) ** 2, axis=1)))
    inner = slice(balance.size // 20, -(balance.size // 20))
    cutoff = balance.cutoffs[channel]
    missing, left = (smooth(values[channel], balance.step, cutoff)[inner] for values in (without, with_it))
    missing, law = -missing, left - missing
    x, x_label = _abscissa(diagnosis, effect, channel)
    x = x[inner]
    force = diagnosis.test[0].signals[0].unit == "m"
    unit = unit_in("N.m", diagnosis.model)
    y_label = f"{'force' if force else 'torque'} at the {balance.channels[channel]} [{unit}]"
    if x_label.startswith("time"):
        shown = slice(0, min(x.size, round(SHOWN_SECONDS / balance.step)))
        return MissingTorque(effect.label, x_label, y_label, x[shown], missing[shown], law[shown], None)
    edges = np.unique(np.quantile(x, np.linspace(0.0, 1.0, BINS + 1)))
    at = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, edges.size - 2)
    counts = np.maximum(np.bincount(at, minlength=edges.size - 1), 1)
    centre, mean, fitted = (np.bincount(at, values, edges.size - 1) / counts for values in (x, missing, law))
    spread = np.sqrt(np.maximum(np.bincount(at, missing**2, edges.size - 1) / counts - mean**2, 0.0))
    gaps = np.flatnonzero(np.diff(centre) > WIDEST_GAP * np.ptp(centre)) + 1
    parts = (np.insert(values, gaps, np.nan) for values in (centre, mean, fitted, spread))
    return MissingTorque(effect.label, x_label, y_label, *parts)


def _abscissa(diagnosis: Diagnosis, effect: GradedEffect, channel: int) -> tuple[Array, str]:
    balance, row = diagnosis.workings.balances[0], diagnosis.model.plant.effect(effect.label)
    scales, unit = balance.scales, diagnosis.test[0].signals[0].unit
    site = effect.site if effect.site in scales.speeds else balance.channels[channel]
    if row.against == "speed":
        return scales.speeds[site], f"{site} speed [{unit}/s]"
    if row.wave_site:
        cycles = effect.parameters["cycles_per_rev"].value
        return np.mod(cycles * scales.angles[row.wave_site], 2.0 * np.pi), "phase of the cycle [rad]"
    if row.against == "angle":
        angle = scales.angles[site]
        turns = np.ptp(angle) > 2.0 * np.pi
        return np.mod(angle, 2.0 * np.pi) if turns else angle, "load angle [rad]"
    if row.against == "position":
        return scales.angles[site], f"load position [{unit}]"
    if effect.site == "shaft" and scales.twist.size:
        return scales.twist, "twist [rad]"
    return np.asarray(balance.step * np.arange(balance.size)), "time [s]"
