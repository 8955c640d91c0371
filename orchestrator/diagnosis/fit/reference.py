"""A model with a gap that no encoder sees, along whose motion a filter is linearised."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Start:
    """Where a record begins.

    Attributes:
        state: (k,) the plant's states, in their order, SI units.
        covariance: (k, k) of them.
    """

    state: Array
    covariance: Array


@dataclass(frozen=True)
class Reference:
    """The model along whose motion gains are taken.

    Attributes:
        p: (parameters,) of the predictor.
        starts: where each record begins; none: that is not known.
    """

    p: Array
    starts: tuple[Start, ...] = ()

    @property
    def key(self) -> bytes:
        """Return what tells this reference from others."""
        parts = [self.p, *(array for start in self.starts for array in (start.state, start.covariance))]
        return b"".join(part.tobytes() for part in parts)
