"""Recursive filters: kernels."""

from typing import Annotated, Any

from orchestrator.building.translation.kernel_arrays import Reals
from orchestrator.building.translation.kinds import REAL, ArrayKind

__all__ = ["pass_lag", "pass_sections"]

Sections = Annotated[Any, ArrayKind(REAL, (None, 5))]
States = Annotated[Any, ArrayKind(REAL, (None, 2))]


def pass_lag(values: Reals, now: float, before: float, decay: float, state: float, out: Reals) -> None:
    """Fill ``out[n] = decay out[n - 1] + now values[n] + before values[n - 1]``.

    Args:
        values: (n,).
        state: what comes to the first value from those before it.
        out: (n,) filled.
    """
    for n in range(len(values)):
        out[n] = now * values[n] + state
        state = before * values[n] + decay * out[n]


def pass_sections(values: Reals, sections: Sections, states: States, out: Reals) -> None:
    """Fill what sections of second order, one behind the other, make of values.

    Args:
        values: (n,).
        sections: (k, 5) factors b0, b1, b2, a1, a2 of each, a0 being one.
        states: (k, 2) at the first value; changed.
        out: (n,) filled.
    """
    for n in range(len(values)):
        x = values[n]
        for k in range(len(sections)):
            y = sections[k, 0] * x + states[k, 0]
            states[k, 0] = sections[k, 1] * x - sections[k, 3] * y + states[k, 1]
            states[k, 1] = sections[k, 2] * x - sections[k, 4] * y
            x = y
        out[n] = x
