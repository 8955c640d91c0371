"""What a model leaves: measurement noise, noise with a small disturbance, or more."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.settings import DEFAULT, RestSettings

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rest:
    """What a model leaves.

    Attributes:
        explained: nothing but measurement noise.
        disturbed: small stationary noise at the ports beside it.
        share: that noise, as a share of the drive.
        reasons: what speaks against noise.
        blocks: (blocks, outputs) mean square of the innovations over equal parts of the record; noise: 1.
    """

    explained: bool
    disturbed: bool
    share: float
    reasons: tuple[str, ...]
    blocks: Array

    @property
    def nothing_missing(self) -> bool:
        """Whether nothing but noise, and at most a small disturbance, is left."""
        return self.explained or self.disturbed


@dataclass(frozen=True, eq=False)
class Whole:
    """A model over all of a record.

    Attributes:
        best: fit of the model to the part that the search fits.
        last: the same fitted to all rows that were looked at; its run and its Jacobian are those over all rows.
        rest: what that leaves over all rows.
    """

    best: BoxFit
    last: BoxFit
    rest: Rest


def rest_of(fitter: Fitter, fit: BoxFit, rows: slice, settings: RestSettings = DEFAULT.rest) -> Rest:
    """Return what a model leaves over ``rows``; ``fit.y`` must reach so far.

    Args:
        fitter: gives the filters and the record.
        fit: of a model.
        rows: samples to look at.
        settings: the thresholds.

    Returns:
        The shares, and why it counts as unexplained.
    """
    ladder, outputs = fitter.ladder, fitter.problem.outputs
    e = fitter.whitened(fit.y, fit.level)[rows]
    free = fitter.whitened(fit.y, 0)[rows]
    count = e.size
    square = float(np.sum(free * free))
    explained = square < count + settings.deviations * np.sqrt(2.0 * count)
    explained = bool(explained) and not _reasons(free, outputs, settings)
    share = ladder.share(fit.level)
    reasons = _reasons(e, outputs, settings)
    blocks = np.array([np.mean(part * part, axis=0) for part in np.array_split(e, settings.blocks)])
    disturbed = not explained and share <= settings.most_port_noise and not reasons
    return Rest(explained, disturbed, share, tuple(reasons), blocks)


def _reasons(e: Array, outputs: Sequence[str], s: RestSettings) -> list[str]:
    """Return what distinguishes innovations (n, outputs) from white noise of variance 1 (less: it was overstated)."""
    found = []
    n = len(e)
    for name, own in zip(outputs, e.T, strict=True):
        x = own
        mean_square = float(np.mean(x * x))
        if mean_square - 1.0 > s.deviations * np.sqrt(2.0 / n):
            found.append(f"output `{name}`: {mean_square:.2f} times the expected power")
        x = (x - x.mean()) / max(float(x.std()), 1e-300)
        lags = [float(np.mean(x[lag:] * x[:-lag])) for lag in range(1, s.lags + 1)]
        if float(np.sum(np.square(lags))) * n > s.lags + s.most_correlated * np.sqrt(2.0 * s.lags):
            found.append(f"output `{name}`: correlated from sample to sample")
        if float(np.mean(x**4)) - 3 > s.most_kurtosis:
            found.append(f"output `{name}`: comes in bursts")
        parts = np.array([np.mean(p * p) for p in np.array_split(own, s.blocks)])
        if float(parts.max()) / mean_square - 1.0 > s.deviations * np.sqrt(2.0 * s.blocks / n):
            found.append(f"output `{name}`: changes with time")
    return found
