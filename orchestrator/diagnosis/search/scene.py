"""Typical sizes of a record's signals under a fitted model, which starting values depend on."""

import numpy as np

from orchestrator.diagnosis.fit.fitting import Fit
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.plants.effects import Scene
from orchestrator.shared.inference.noise import rms


@np.errstate(over="ignore", invalid="ignore")  # of a model that runs away
def scene_of(likelihood: RecordLikelihood, model: Fit) -> Scene:
    """Return the sizes of the record's signals under a fitted model.

    Args:
        likelihood: of the record.
        model: the fit.

    Returns:
        The sizes.
    """
    plant, signals, p = likelihood.plant, likelihood.signals, model.p
    _, states = likelihood.innovations(p, model.q)
    x = states[likelihood.settings.likelihood.settled :]
    first, last = plant.bodies[0], plant.bodies[-1]
    turns = float(np.ptp(x[:, first.angle])) / (2.0 * np.pi)
    speeds = rms(x[:, first.speed]), rms(x[:, last.speed])
    angles = x[:, last.angle].copy()
    reach = float(np.min(angles)), float(np.max(angles))
    way = signals.way(slice(likelihood.settings.likelihood.head, likelihood.stop), likelihood.settings.search.one_way)
    if plant.shaft is None:
        inertia = plant.value(p, first.inertia)
        return Scene(
            signals.h, signals.torque, signals.u, *speeds, 1.0, inertia, 1.0, 1.0, turns, *reach,
            angles=angles, way=way,
        )  # fmt: skip
    twist = float(np.quantile(np.abs(plant.twist(p, x)), likelihood.settings.search.twist_quantile))
    inertia, stiffness = (plant.value(likelihood.nominal, name) for name in (last.inertia, plant.shaft.stiffness))
    return Scene(
        signals.h, signals.torque, signals.u, *speeds, twist, inertia, stiffness, plant.ratio(p), turns, *reach,
        angles=angles, way=way,
    )  # fmt: skip
