"""Free runs of a plant on which no effect acts: its transition over a sample, solved once, repeated at every sample."""

from collections.abc import Callable

import numpy as np
from scipy.linalg import expm

from orchestrator.building.translation.kernels import Kernels
from orchestrator.plants.description import Plant
from orchestrator.shared.arrays import Array

LINEAR = Kernels("orchestrator.plants.kernels.linear")
Run = Callable[[Array, Array, Array, Array], None]


def is_linear(plant: Plant, p: Array) -> bool:
    """Tell whether a model moves as the linear plant does: what acts on it changes the request or the encoders alone.

    It does where no gap is open, and all effects but a limit, a delay and offsets are off.
    """
    drive = plant.drive
    apart = {*plant.linear, *plant.offsets, drive.delay, drive.limit}
    return all(p[n] == entry.default for n, entry in enumerate(plant.table) if entry.name not in apart)


def linear_run_of(plant: Plant, p: Array, first: float, h: float) -> Run:
    """Return ``run(start, early, late, out)`` of a model that :func:`is_linear`.

    It fills out (n, 2), the angles, from start (8,); in each sample the request ``early`` (n,) acts for ``first`` [s],
    then ``late`` (n,). Over each of both pieces the motion is the exponential of the plant's matrix: no error of a
    step adds up. ``first``: length of the first piece [s]; ``h``: length of a sample [s].
    """
    A, B = plant.jacobian(p), plant.request_column(p)
    places = list(state_places(plant, p))
    rows = [plant.states.index(place) for place in places]
    held = np.block([[A[np.ix_(rows, rows)], B[rows, None]], [np.zeros((1, len(rows) + 1))]])
    (before, by_early), (behind, by_late) = (
        (step[:-1, :-1], step[:-1, -1]) for step in (expm(held * first), expm(held * (h - first)))
    )
    phi, by_early = behind @ before, behind @ by_early
    shown = np.array([places.index(place) if place in places else -1 for place in (0, 2)])

    def run(start: Array, early: Array, late: Array, out: Array) -> None:
        LINEAR.repeat(start[places], phi, by_early, by_late, early, late, shown, np.empty(len(places)), out)

    return run


def state_places(plant: Plant, p: Array) -> tuple[int, ...]:
    """Return the places of the states that the linear plant has: without a lag the drive has none."""
    lagged = plant.value(p, plant.drive.lag) > 0.0
    return tuple(place for place in plant.states if place != plant.drive.torque or lagged)
