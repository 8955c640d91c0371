"""The derivative of whitened innovations by parameters, and how it is kept up without being taken anew.

A derivative taken by differences costs a run of the predictor for each parameter. Within a fit it is corrected by what
each step has shown of it (Broyden, Mathematics of Computation 19(92), 1965).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.shared.cores import spread

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Free:
    """A parameter that a fit may change: its place in ``p``, scale, bounds and prior (mean, standard deviation)."""

    place: int
    scale: float
    minimum: float
    maximum: float
    prior: tuple[float, float] | None = None


@dataclass(frozen=True)
class Slope:
    """The derivative of whitened innovations by the scaled parameters.

    Attributes:
        p: (parameters,) where it holds.
        q: process noise, as a share of the drive's rms torque.
        z: (samples, channels) whitened innovations there.
        rows: samples of the derivative.
        columns: (rows, channels, free parameters); those of one parameter lie together in memory.
        taken: it was taken there, not kept up from elsewhere.
    """

    p: Array
    q: float
    z: Array
    rows: slice
    columns: Array
    taken: bool = True

    def moved(self, p: Array, z: Array, free: Sequence[Free]) -> "Slope":
        """Return it at another point, corrected by what innovations have done on the way there.

        Args:
            p: (parameters,) of the other point.
            z: (samples, channels) whitened innovations there.
            free: parameters whose derivatives it holds.

        Returns:
            The derivative.
        """
        step = np.array([(p[entry.place] - self.p[entry.place]) / entry.scale for entry in free])
        length = float(step @ step)
        if length == 0.0:
            return self
        change = z[self.rows] - self.z[self.rows]
        missed = change - (self.columns.reshape(-1, step.size) @ step).reshape(change.shape)
        columns = self.columns.transpose(2, 0, 1) + (step / length)[:, None, None] * missed
        return Slope(p, self.q, z, self.rows, columns.transpose(1, 2, 0), taken=False)


def taken(likelihood: RecordLikelihood, p: Array, q: float, free: Sequence[Free], z: Array, rows: slice) -> Slope:
    """Return the derivative taken by differences, one run of the predictor for each parameter.

    Args:
        likelihood: of the record.
        p: (parameters,) of the predictor.
        q: process noise, as a share of the drive's rms torque.
        free: parameters to fit.
        z: (samples, channels) whitened innovations at ``p``.
        rows: the samples.

    Returns:
        The derivative.
    """
    until = likelihood.over(min(likelihood.stop, rows.stop))
    points, steps = [], []
    for entry in free:
        moved = p.copy()
        step = likelihood.settings.fit.difference * entry.scale
        if moved[entry.place] + step > entry.maximum:
            step = -step
        moved[entry.place] += step
        points.append(moved)
        steps.append(step / entry.scale)
    here = z[rows]
    columns = np.empty((len(free), *here.shape))

    def fill(n: int) -> None:
        columns[n] = (until.whitened(points[n], q)[rows] - here) / steps[n]

    spread(fill, range(len(free)))
    return Slope(p, q, z, rows, columns.transpose(1, 2, 0))
