"""What repeats of one experiment differ by: a floor of noise that needs no model."""

from dataclasses import dataclass

import numpy as np

from orchestrator.shared.arrays import Array


@dataclass(frozen=True)
class Repeats:
    """What repeats differ by: no model does better, and none need."""

    sources: tuple[str, ...]  # the records that have one input
    floor: dict[str, float]  # rms of one run about what the runs have in common, by signal


def repeat_variance(first: Array, second: Array, width: int) -> Array:
    """Return half the variance of the difference of two repeats, over segments with a straight line removed from each.

    The line stands for the start of a segment, which no two runs have in common and which a model's run may choose.
    ``first``: (n, channels) measured in one run; ``second``: (n, channels) measured in the other; ``width``: rows of a
    segment, at least 3.

    Returns:
        (channels,) variance of one run about what both have in common.
    """
    width = min(width, len(first))
    lines, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, width), 2))
    panes = (first - second)[: len(first) // width * width].reshape(-1, width, first.shape[1])
    left = panes - np.einsum("ik,jk,pjc->pic", lines, lines, panes)
    return np.asarray(np.mean(left**2, axis=(0, 1)) * width / (width - 2) / 2.0)
