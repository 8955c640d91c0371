"""The signals that a torque of a plant may follow where no effect explains it."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from orchestrator.diagnosis.data.signals import triangle_average
from orchestrator.diagnosis.model.interface import LawArgument, ModelPoint
from orchestrator.diagnosis.model.torque_balance import TorqueBalance
from orchestrator.shared.arrays import Array


def law_arguments(
    models: Sequence[TorqueBalance], points: Sequence[ModelPoint], unit_in: Callable[[str], str]
) -> list[LawArgument]:
    """Return what a law of a plant may be a function of; ``unit_in``: an SI unit of an axis that turns -> the log's."""
    first = models[0]
    scales = [model.scales for model in models]
    values = [model.values_at(point) for model, point in zip(models, points, strict=True)]
    signals = {  # name, site, unit: of each record
        ("speed", "motor", "rad/s"): [one.speeds["motor"] for one in scales],
        ("torque of the drive", "motor", "N.m"): [
            model.drive_torque(p) for model, p in zip(models, values, strict=True)
        ],
    }
    if first.plant.shaft is None:
        signals["position", "motor", "rad"] = [one.angles["load"] for one in scales]
    elif not any(model.hides_load for model in models):
        signals["speed", "load", "rad/s"] = [one.speeds["load"] for one in scales]
        signals["angle", "load", "rad"] = [one.angles["load"] for one in scales]
        signals["twist", "shaft", "rad"] = [one.twist for one in scales]
    found = []
    for (name, site, unit), signal in signals.items():
        responses = tuple(
            partial(_respond, model.residual_scale(point, p)[:, None] * _gains(model, site)[:, None])
            for model, point, p in zip(models, points, values, strict=True)
        )
        drives = unit == "N.m"
        found.append(LawArgument(name, site, unit_in(unit), unit_in("N.m"), tuple(signal), responses, drives=drives))
    return found


def _gains(model: TorqueBalance, site: str) -> Array:
    """Return (channels,) the change of each balance by a unit of a torque against the motion."""
    if site == "shaft":
        return np.array([-1.0 / model.plant.ratio(model.nominal), 1.0])
    gains = np.zeros(len(model.channels))
    gains[model.channels.index(site)] = -1.0
    return gains


def _respond(gains: Array, torque: Array) -> Array:
    return np.asarray(gains * triangle_average(torque))
