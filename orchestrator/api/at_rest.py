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
        rest = (
            f"has a limit cycle at {f.frequency:.3g} Hz, with an amplitude of {f.load:.3g} half-gaps at the load and "
            f"{f.twist:.3g} half-gaps in the twist"
        )
    else:
        rest = "comes to rest"
    if not f.settled:
        rest += f"; this is the motion after {LONGEST:g} s, when it still changes"
    return f"Without friction, load torque and torque limit, {loop} {rest}."


def margins_text(f: ForecastFound) -> str:
    """Say in one line which margins the loop has without a gap, and how many states are controllable."""
    delay = "any delay" if f.delay_margin is None else f"{1e3 * f.delay_margin:.3g} ms"
    upper = "any factor" if f.upper_gain is None else f"{f.upper_gain:.3g}"
    return (
        f"Margins of the loop without a gap: phase margin {math.degrees(f.phase_margin):.3g} degrees, delay margin "
        f"{delay}, gain margins {f.lower_gain or 0.0:.3g} to {upper}. "
        f"{f.rank} of 6 states are controllable; the load torque is not."
    )


def five(name: str, numbers: Sequence[float], least: float) -> tuple[float, ...]:
    """Return five numbers within their bounds, one for each of ``REGULATOR_STATES``."""
    if len(numbers) != len(REGULATOR_STATES):
        raise ScenarioError(f"`{name}` must be {len(REGULATOR_STATES)} numbers, but are {len(numbers)}", name)
    return tuple(within(name, float(number), least, LARGEST_WEIGHT) for number in numbers)
