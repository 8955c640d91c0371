"""Sizes from the torque that a motion needs: of a single axis under position control, the least disturbed ones.

A controller that holds an axis on its path answers every disturbance with its torque: the motion hardly knows of it,
the torque does. Predictions of the motion from that torque take the answer for a drive, and inertia and friction for
larger than they are, however what is left is whitened. The torque that the motion needs, compared with the measured
one, does not (inverse dynamic identification; Gautier and Poignet, Control Engineering Practice 9(12), 2001). In open
loop it is the other way round; predictions tell which of both holds.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.slope import Free
from orchestrator.plants.description import Plant
from orchestrator.shared.inference.colour import colour_of
from orchestrator.shared.inference.inverse import pseudo_inverse
from orchestrator.shared.inference.long_run import long_run_covariance

Array = NDArray[np.float64]
Motion = tuple[Array, Array, Array, Array]  # position, speed, acceleration, measured torque

# Of parameters that the filtered torque says nothing of: the drive's timing, and contacts shorter than the filter.
TIMING_UNITS = ("s", "N.m/s")
CONTACT = "effects.end_stop."
UNIFORM = math.sqrt(3.0)  # half of an interval over the standard deviation of the uniform distribution on it


def torque_fit(likelihood: RecordLikelihood, found: Fit, part: slice) -> Fit | None:
    """Return a fit whose sizes are those of the smallest torque error, in the plant's inverse model.

    A value that the torque does not tell is one that the model file allows.

    Args:
        likelihood: of the record.
        found: the fit whose model it is.
        part: the samples that are fitted.

    Returns:
        The fit, its errors whatever the colour of the torque; None: the plant has no inverse, or lags, or some of what
        is fitted has no part in it.
    """
    plant, settings = likelihood.plant, likelihood.settings.inverse
    free = tuple(entry for entry in found.free if entry.place < len(plant.table))
    entries = [plant.entry(entry.place) for entry in found.free]
    unseen = any(entry.unit in TIMING_UNITS or entry.name.startswith(CONTACT) for entry in entries)
    if plant.inverse is None or unseen or not free or plant.value(found.p, plant.drive.lag) > 0.0:
        return None
    moved = motion(likelihood, part)
    if moved[3].size < settings.least_rows * len(free):
        return None
    scales = np.array([entry.scale for entry in free])
    places = [entry.place for entry in free]

    def missing(values: Array) -> Array:
        p = found.p.copy()
        p[places] = values * scales
        return lacking_torque(plant, moved, p)

    low, high = (np.array([getattr(entry, end) for entry in free]) / scales for end in ("minimum", "maximum"))
    solved = _solved(missing, found.p[places] / scales, low, high)
    if not np.all(np.isfinite(solved.x)):
        return None
    scaled = _covariance(np.asarray(solved.jac), solved.fun, likelihood.settings.fit.blocks)
    least, most = _stated(free, scales, solved.x, settings.untold * np.sqrt(np.diag(scaled)))
    if np.any(least > low) or np.any(most < high):
        solved = _solved(missing, solved.x, np.maximum(low, least), np.minimum(high, most))
    p = found.p.copy()
    p[places] = solved.x * scales
    z = likelihood.whitened(p, found.q)
    if not np.all(np.isfinite(z)):
        return None
    covariance = found.covariance.copy()
    own = [found.free.index(entry) for entry in free]
    covariance[np.ix_(own, own)] = scaled * np.outer(scales, scales)
    return replace(found, p=p, z=z, covariance=covariance, colour=colour_of(z, part))


def _solved(missing: Callable[[Array], Array], start: Array, low: Array, high: Array) -> Any:
    """Return scipy's least-squares solution between bounds."""
    from scipy.optimize import least_squares

    return least_squares(missing, np.clip(start, low, high), bounds=(low, np.maximum(high, low + 1e-9)), x_scale="jac")


def _stated(free: Sequence[Free], scales: Array, values: Array, doubt: Array) -> tuple[Array, Array]:
    """Return bounds of scaled values: what is stated of those that lie outside of that by no more than ``doubt``.

    Of a motion that hardly accelerates, the torque tells no inertia: it is one of those that the data sheet allows.
    """
    least, most = np.full(len(free), -np.inf), np.full(len(free), np.inf)
    for n, entry in enumerate(free):
        if entry.prior is None:
            continue
        middle, reach = entry.prior[0] / scales[n], UNIFORM * entry.prior[1] / scales[n]
        if reach < abs(values[n] - middle) <= reach + doubt[n]:
            least[n], most[n] = middle - reach, middle + reach
    return least, most


def explained(likelihood: RecordLikelihood, found: Fit, part: slice) -> float:
    """Return the share of the measured torque's variance that a model explains.

    Args:
        likelihood: of the record; its plant has an inverse model.
        found: the model.
        part: the samples.

    Returns:
        The share; negative where it explains less than a constant torque.
    """
    moved = motion(likelihood, part)
    return share_explained(lacking_torque(likelihood.plant, moved, found.p), moved[3])


def lacking_torque(plant: Plant, moved: Motion, p: Array) -> Array:
    """Return the measured torque less what a model needs for a motion.

    Args:
        plant: that has an inverse model.
        moved: position, speed, acceleration and torque, as :func:`motion` returns them.
        p: (parameters,) of the model.

    Returns:
        (n,) the rest.
    """
    assert plant.inverse is not None
    position, speed, acceleration, given = moved
    return np.asarray(given - plant.inverse(position, speed, acceleration, p))


def share_explained(left: Array, given: Array) -> float:
    """Return the share of a torque's variance that a model explains.

    Args:
        left: (n,) what the model leaves of it.
        given: (n,) the torque.

    Returns:
        The share; negative where it explains less than a constant torque.
    """
    return 1.0 - float(left @ left) / float(np.sum((given - given.mean()) ** 2))


def motion(likelihood: RecordLikelihood, part: slice) -> Motion:
    """Return position, speed, acceleration and measured torque of a part, all behind one filter.

    Rows around a reversal are left out: behind the filter, dry friction turns round slowly. So are rows at rest: there
    it holds against whatever torque is asked.

    Args:
        likelihood: of the record.
        part: the samples.

    Returns:
        Each, (n,).
    """
    rows = [_filtered(likelihood, stretch) for stretch in likelihood.signals.stretches(part)]
    position, speed, acceleration, given = (np.concatenate(each) for each in zip(*rows, strict=True))
    return position, speed, acceleration, given


def _filtered(likelihood: RecordLikelihood, rows: slice) -> tuple[Array, Array, Array, Array]:
    """Return what :func:`motion` does, of one stretch."""
    from scipy.signal import butter, filtfilt

    settings, signals = likelihood.settings.inverse, likelihood.signals
    b, a = butter(settings.order, settings.cut_off)
    padding = {"padlen": min(3 * max(len(a), len(b)), rows.stop - rows.start - 1)}
    position, given = (filtfilt(b, a, values[rows], **padding) for values in (signals.y[:, 0], signals.u))
    speed = np.gradient(position, signals.h)
    acceleration = np.gradient(speed, signals.h)
    reach = round(1.0 / settings.cut_off)
    reversals = np.diff(np.sign(speed), prepend=np.sign(speed[0])) != 0.0
    away = np.convolve(reversals, np.ones(2 * reach + 1), "same") < 0.5
    away &= np.abs(speed) > settings.at_rest * np.percentile(np.abs(speed), 99.0)
    border = 4 * reach  # where the filter settles
    kept = np.flatnonzero(away[border:-border])[:: max(reach // 2, 1)] + border
    return position[kept], speed[kept], acceleration[kept], given[kept]


def _covariance(J: Array, missing: Array, blocks: int) -> Array:
    """Return the covariance of scaled parameters, whatever the colour; as wide as blocks left out ask for."""
    bread = pseudo_inverse(J.T @ J)
    scores = J * missing[:, None]
    covariance = bread @ long_run_covariance(scores) @ bread
    groups = np.array_split(np.arange(len(scores)), blocks)
    changes = [pseudo_inverse(J.T @ J - J[rows].T @ J[rows]) @ scores[rows].sum(axis=0) for rows in groups]
    spread = (blocks - 1.0) / blocks * np.sum(np.square(changes), axis=0)
    stretch = np.sqrt(np.maximum(spread / np.maximum(np.diag(covariance), 1e-300), 1.0))
    return np.asarray(covariance * np.outer(stretch, stretch))
