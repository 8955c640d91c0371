"""What the record that a model was fitted to has shown and left open: the table ``[record]`` of a corrected model."""

from typing import Annotated

import msgspec
import numpy as np
from numpy.typing import NDArray

Positive = Annotated[float, msgspec.Meta(gt=0.0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0.0)]


class FittedRecord(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Verdict and joint uncertainty of a fit, and the signals that it had."""

    source: str  # the record's file
    verdict: str  # "none", "parameters", "effects" or "unknown"
    trust: str  # "green", "amber" or "red"
    reasons: tuple[str, ...] = ()  # why it is not green
    torque: Positive  # largest request of the record [N.m]
    noise: tuple[NotNegative, ...]  # standard deviation of each encoder, motor first, rounding included [rad]
    counts: tuple[NotNegative, ...]  # one count of each encoder [rad]; 0: not rounded
    unknowns: tuple[str, ...] = ()  # names of the parameters that were fitted
    values: tuple[float, ...] = ()  # that were fitted, in their units
    # (unknowns, unknowns) of these, in their units; its 95 % intervals are those of the fit
    covariance: tuple[tuple[float, ...], ...] = ()

    def problem(self, parameters: frozenset[str]) -> str:
        """Return what is wrong with its numbers, as "`key` must ..."; "" where nothing is."""
        unknown = [name for name in self.unknowns if name not in parameters]
        if unknown or len(set(self.unknowns)) < len(self.unknowns):
            return f"`record.unknowns` must name parameters of the model, each once, but is {', '.join(self.unknowns)}"
        n = len(self.unknowns)
        if len(self.values) != n:
            return (
                f"`record.values` must have {n} numbers, one for each of `record.unknowns`, but has {len(self.values)}"
            )
        matrix = np.array(self.covariance, dtype=float) if all(len(row) == n for row in self.covariance) else None
        if matrix is None or len(self.covariance) != n:
            return f"`record.covariance` must have {n} rows and columns, one for each of `record.unknowns`"
        if n and (not np.isfinite(matrix).all() or not is_covariance(matrix)):
            return "`record.covariance` must be symmetric, with no negative eigenvalue"
        return ""


def is_covariance(matrix: NDArray[np.float64]) -> bool:
    """Tell whether a matrix is symmetric and, scaled to unit variances, has no negative eigenvalue but by rounding."""
    deviations = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    scale = np.where(deviations > 0.0, deviations, 1.0)
    scaled = matrix / np.outer(scale, scale)
    return bool(np.allclose(scaled, scaled.T, atol=1e-9) and np.linalg.eigvalsh(scaled).min() > -1e-6)
