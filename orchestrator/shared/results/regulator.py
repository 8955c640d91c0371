"""What ``regulator.json`` holds: gains of an LQR, and what its loop does."""

import math
from collections.abc import Mapping, Sequence

import msgspec

from orchestrator.shared.results import ResultData
from orchestrator.shared.results.fields import ReportTable, TableColumn


class ForecastFound(msgspec.Struct, frozen=True):
    """A loop with a gap at rest, without friction and load, by its gains alone; margins are those without a gap.

    ``settled``: the motion was followed until it repeated itself or came to rest. Amplitudes and frequency are 0 where
    it is still. None: there is no such margin.
    """

    cycles: bool
    twist: float  # amplitude, in half-gaps
    load: float  # amplitude, in half-gaps
    frequency: float  # [Hz]
    phase_margin: float  # [rad]
    delay_margin: float | None  # [s]
    rank: int  # controllable states, of six
    settled: bool = True
    lower_gain: float | None = None  # as a factor, like the upper one
    upper_gain: float | None = None

    def rest_text(self, loop: str) -> str:
        """Say in one line what ``loop`` does at rest by its gains alone."""
        rest = "comes to rest"
        if self.cycles:
            rest = (
                f"has a limit cycle at {self.frequency:.3g} Hz, with an amplitude of {self.load:.3g} half-gaps at the "
                f"load and {self.twist:.3g} half-gaps in the twist"
            )
        rest += "" if self.settled else "; the motion still changes at the end of the prediction"
        return f"Without friction, load torque and torque limit, {loop} {rest}."

    def margins_text(self) -> str:
        """Say in one line which margins the loop has without a gap, and how many states are controllable."""
        delay = "any delay" if self.delay_margin is None else f"{1e3 * self.delay_margin:.3g} ms"
        upper = "any factor" if self.upper_gain is None else f"{self.upper_gain:.3g}"
        return (
            f"Margins of the loop without a gap: phase margin {math.degrees(self.phase_margin):.3g} degrees, delay "
            f"margin {delay}, gain margins {self.lower_gain or 0.0:.3g} to {upper}. "
            f"{self.rank} of 6 states are controllable; the load torque is not."
        )


class RegulatorFound(ResultData, frozen=True, kw_only=True):
    """``regulator``: gains by name, the forecast, and the loop's response at the request.

    ``frequencies`` [Hz], ``response`` its size, ``phases`` [rad].
    """

    gains: dict[str, float]
    sample_time: float
    delay: int
    forecast: ForecastFound
    frequencies: tuple[float, ...] = ()
    response: tuple[float, ...] = ()
    phases: tuple[float, ...] = ()


def gains_table(gains: Mapping[str, float], states: Sequence[str], units: Sequence[str]) -> ReportTable:
    """Return the gains by name, each with its state and unit."""
    columns = (TableColumn("gain"), TableColumn("state"), TableColumn("value", digits=9), TableColumn("unit"))
    return ReportTable("Gains of the regulator", columns, tuple(zip(gains, states, gains.values(), units, strict=True)))
