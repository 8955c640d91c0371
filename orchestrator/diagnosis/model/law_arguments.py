"""The signals that a torque of a plant may follow where no effect explains it."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.data.signals import triangle_average
from orchestrator.diagnosis.model.interface import LawArgument, ModelPoint
from orchestrator.diagnosis.model.torque_balance import TorqueBalance
from orchestrator.plants.learned import Argument, arguments_of
from pyfmu_sources.laws.learned_law import DRIVE, LOAD_ANGLE, LOAD_SPEED, MOTOR_SPEED, TWIST

Array = NDArray[np.float64]


def law_arguments(models: Sequence[TorqueBalance], points: Sequence[ModelPoint], metric: bool) -> list[LawArgument]:
    """Return what a law of a plant may be a function of."""
    plant = models[0].plant
    found = []
    for argument in arguments_of(plant):
        values = [_signal(model, argument, model.values_at(point)) for model, point in zip(models, points, strict=True)]
        if any(value is None for value in values):
            continue
        responses = tuple(
            partial(_respond, model.residual_scale(point)[:, None] * _gains(model, argument)[:, None])
            for model, point in zip(models, points, strict=True)
        )
        unit = argument.unit.replace("rad", "m").replace("N.m", "N") if metric else argument.unit
        found.append(
            LawArgument(
                argument.signal, argument.site, unit, "N" if metric else "N.m",
                tuple(value for value in values if value is not None), responses, argument.code,
                argument.code == DRIVE,
            )
        )  # fmt: skip
    return found


def _signal(model: TorqueBalance, argument: Argument, p: Array) -> Array | None:
    scales = model.scales
    if model.hides_load and argument.site != "motor":
        return None
    signals: dict[int, Callable[[], Array]] = {
        MOTOR_SPEED: lambda: scales.speeds["motor"],
        LOAD_SPEED: lambda: scales.speeds["load"],
        LOAD_ANGLE: lambda: scales.angles["load"],
        TWIST: lambda: scales.twist,
        DRIVE: lambda: model.drive_torque(p),
    }
    return signals[argument.code]()


def _gains(model: TorqueBalance, argument: Argument) -> Array:
    """Return (channels,) the change of each balance by a unit of a torque against the motion."""
    if argument.code == TWIST:
        return np.array([-1.0 / model.plant.ratio(model.nominal), 1.0])
    at = model.channels.index(argument.site) if argument.site in model.channels else 0
    gains = np.zeros(len(model.channels))
    gains[at] = -1.0
    return gains


def _respond(gains: Array, torque: Array) -> Array:
    return np.asarray(gains * triangle_average(torque))
