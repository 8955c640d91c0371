"""What a loop with a gap will do at rest, in sentences."""

import math
from collections.abc import Sequence

from orchestrator.control.standstill import LONGEST
from orchestrator.errors import ScenarioError
from orchestrator.plants.design import REGULATOR_STATES
from orchestrator.shared.numbers import within
from orchestrator.shared.results.regulator import ForecastFound

LARGEST_WEIGHT = 1e12


def rest_text(f: ForecastFound, loop: str) -> str:
    """Say in one line what ``loop`` does at rest by its gains alone."""
    if f.cycles:
        rest = f"cycles at {f.frequency:.3g} Hz: its load by {f.load:.3g} half-gaps, its twist by {f.twist:.3g}"
    else:
        rest = "comes to rest"
    if not f.settled:
        rest += f"; this is its motion after {LONGEST:g} s, which still changes: it never settles, or takes longer"
    return f"Without friction, load and limit of the torque {loop} {rest}."


def margins_text(f: ForecastFound) -> str:
    """Say in one line which margins the loop has without a gap, and what it cannot move."""
    late = "any further delay" if f.delay_margin is None else f"{1e3 * f.delay_margin:.3g} ms of further delay"
    most = "any number of" if f.upper_gain is None else f"{f.upper_gain:.3g}"
    return (
        f"Without a gap it bears {late}, {math.degrees(f.phase_margin):.3g} degrees of phase, and a gain from "
        f"{f.lower_gain or 0.0:.3g} to {most} times as large. "
        f"Its request moves {f.rank} of 6 states: not the load torque."
    )


def five(name: str, numbers: Sequence[float], least: float) -> tuple[float, ...]:
    """Return five numbers within their bounds, one for each of ``REGULATOR_STATES``."""
    if len(numbers) != len(REGULATOR_STATES):
        raise ScenarioError(f"`{name}` must be {len(REGULATOR_STATES)} numbers, but are {len(numbers)}", name)
    return tuple(within(name, float(number), least, LARGEST_WEIGHT) for number in numbers)
