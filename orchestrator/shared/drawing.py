"""What all figures share: colours, and the time in the gap as a shade."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.plain_text import plain_text

BLUE, ORANGE, GREY, SHADE = "#2166ac", "#d6604d", "#555555", "#f4d58d"


def label_text(name: str) -> str:
    """Return a name of others as a figure takes it: plain, and no formula."""
    return plain_text(name).replace("$", r"\$")


def shade_gap(axis: Any, time: NDArray[np.float64], contact: NDArray[Any], label: str | None = None) -> None:
    """Shade the spans of ``time`` (n,) [s] in which no teeth touch (``contact`` (n,) is 0), the first with a label."""
    free = np.concatenate([[False], contact == 0, [False]])
    edges = np.flatnonzero(free[1:] != free[:-1])
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        axis.axvspan(time[first], time[min(last, time.size - 1)], color=SHADE, alpha=0.6, linewidth=0.0, label=label)
        label = None
