"""A chain of three hidden states: the teeth touch at the lower flank, nowhere, or at the upper one; kernels."""

import math
from typing import Annotated, Any

from orchestrator.building.translation.kernel_arrays import Reals, Wholes, scratch
from orchestrator.building.translation.kinds import REAL, ArrayKind

__all__ = ["densities", "smooth"]

States = Annotated[Any, ArrayKind(REAL, (None, 3))]
Change = Annotated[Any, ArrayKind(REAL, (3, 3))]
STATES = 3
OUTLIER = 1e-6  # share of points that may be anything, so that one bad row cannot rule
ROOT_HALF = math.sqrt(0.5)


def densities(left: Reals, variance: Reals, alpha: float, mask: Wholes, out: States) -> None:
    """Fill ``out`` (n, 3) with the density of each point's twist in each state, for a half-gap [rad].

    ``left``: (n,) twist about mid-gap [rad]; ``variance``: of its noise [rad^2]; ``mask``: (n,) 1 where a point counts.
    """
    for k in range(len(left)):
        if mask[k] == 0:
            for s in range(3):
                out[k, s] = 1.0
            continue
        sigma = math.sqrt(variance[k])
        r = left[k]
        low, high = (r + alpha) / sigma, (r - alpha) / sigma
        bell = 0.3989422804014327 / sigma
        floor = OUTLIER * bell
        out[k, 0] = bell * math.exp(-0.5 * low * low) + floor
        out[k, 2] = bell * math.exp(-0.5 * high * high) + floor
        inside = 0.5 * (math.erfc(-low * ROOT_HALF) - math.erfc(-high * ROOT_HALF))
        out[k, 1] = inside / (2.0 * alpha) + floor


def smooth(density: States, change: Change, scale: Reals, ahead: States, share: States, steps: Change) -> float:
    """Return the log likelihood; fill each state's share at each point and the expected steps between states.

    ``change``: (3, 3) probabilities of the next state; ``scale`` (n,) and ``ahead`` (n, 3) are scratch; ``share``
    (n, 3) is each state's probability given all points, ``steps`` (3, 3) the expected number of steps between them.
    """
    n = len(density)
    total = 0.0
    for k in range(n):
        norm = 0.0
        for s in range(3):
            if k == 0:
                value = 1.0 / 3.0
            else:
                value = 0.0
                for r in range(3):
                    value += ahead[k - 1, r] * change[r, s]
            ahead[k, s] = value * density[k, s]
            norm += ahead[k, s]
        scale[k] = norm
        total += math.log(norm)
        for s in range(3):
            ahead[k, s] /= norm
    back = scratch(3)
    before = scratch(3)
    for s in range(3):
        back[s] = 1.0
        for r in range(3):
            steps[r, s] = 0.0
        share[n - 1, s] = ahead[n - 1, s]
    for k in range(n - 2, -1, -1):
        for r in range(3):
            value = 0.0
            for s in range(3):
                flow = change[r, s] * density[k + 1, s] * back[s] / scale[k + 1]
                steps[r, s] += ahead[k, r] * flow
                value += flow
            before[r] = value
        norm = 0.0
        for r in range(3):
            back[r] = before[r]
            share[k, r] = ahead[k, r] * back[r]
            norm += share[k, r]
        for r in range(3):
            share[k, r] /= norm
    return total
