"""Runs that diverge: recorded signals of a size that no quantity has."""

import numpy as np
from numpy.typing import NDArray

from orchestrator.master.result import RunRemark
from orchestrator.master.system import split

BEYOND = 1e36
"""Size from which a value in any usual unit is taken as run away: the mass of the sun in kg is 2e30."""


def divergence_remarks(
    names: tuple[str, ...], rows: NDArray[np.float64], times: NDArray[np.float64]
) -> list[RunRemark]:
    """Return a remark for each instance that has a signal beyond all sizes, on the one that comes there first.

    ``rows``: (times, names) recorded; ``times``: [s].
    """
    far = np.abs(rows) > BEYOND  # NaN is not: a result with it is refused
    first: dict[str, tuple[int, int]] = {}
    for k in map(int, np.flatnonzero(far.any(axis=0))):
        at = int(np.argmax(far[:, k]))
        name = split(names[k])[0]
        first[name] = min(first.get(name, (at, k)), (at, k))
    found = []
    for name, (at, k) in first.items():
        text = f"`{names[k]}` runs away: it is {rows[at, k]:.3g} at t = {times[at]:g} s"
        found.append(
            RunRemark(name, f"{text}. The run diverges: shorter steps, or other parameters, may keep it finite")
        )
    return found
