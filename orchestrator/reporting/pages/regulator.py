"""The page of ``regulator``: margins, gains, what the loop does at rest, and its response at the request."""

import math
from collections.abc import Sequence

from orchestrator.plants.design import GAIN_UNITS, REGULATOR_STATES
from orchestrator.reporting.model import Badge, Facts, Plot, Report, Series
from orchestrator.reporting.pages.record import SIGNALS
from orchestrator.reporting.source import ResultDocument
from orchestrator.shared.results import read
from orchestrator.shared.results.fields import Cell
from orchestrator.shared.results.regulator import ForecastFound, RegulatorFound, gains_table

OPEN_LOOP = "Open-loop gain without a gap, cut at the torque request"
LEAST_PHASE, LEAST_GAIN = math.radians(30.0), 2.0  # 6 dB: below them textbooks call a loop badly damped


def build(source: ResultDocument) -> Report:
    """Return the page."""
    results = read(source.results, RegulatorFound)
    forecast, frequencies = results.forecast, results.frequencies
    states = [f"{SIGNALS[name][0].lower()} {name}" for name in REGULATOR_STATES]
    gain = Series("gain", frequencies, _decibels(results.response))
    phase = Series("phase", frequencies, results.phases)
    return Report(
        title="Regulator of a drivetrain with a gap",
        summary=forecast.rest_text("the loop"),
        badge=_badge(forecast),
        sections=(
            *rest_facts(forecast, "The loop"),
            gains_table(results.gains, states, GAIN_UNITS),
            Plot(OPEN_LOOP, "frequency [Hz]", "gain [dB]", (gain,), log_x=True),
            Plot("Open-loop phase", "frequency [Hz]", "phase [rad]", (phase,), log_x=True),
        ),
        angle_unit="deg",
    )


def _badge(f: ForecastFound) -> tuple[Badge, str]:
    """Return the verdict: usual margins, and rest in spite of the gap."""
    gains = [abs(math.log(factor)) for factor in (f.lower_gain, f.upper_gain) if factor]
    if f.phase_margin < LEAST_PHASE or min(gains, default=math.inf) < math.log(LEAST_GAIN):
        return "bad", "small margins"
    return ("warn", f"limit cycle at {f.frequency:.3g} Hz") if f.cycles else ("good", "it comes to rest")


def rest_facts(f: ForecastFound | None, loop: str) -> tuple[Facts, ...]:
    """Return what a loop does by its gains alone; nothing where the file does not say it."""
    if f is None:
        return ()
    lower, upper = (_decibels([factor])[0] if factor else None for factor in (f.lower_gain, f.upper_gain))
    items: tuple[tuple[str, Cell], ...] = (
        ("phase margin without a gap [rad]", f.phase_margin),
        ("delay margin without a gap [ms]", f.delay_margin and 1e3 * f.delay_margin),
        ("upper gain margin without a gap [dB]", upper),
        ("lower gain margin without a gap [dB]", lower),
        ("limit cycle without friction and load", f.cycles),
        ("frequency of the limit cycle [Hz]", f.frequency or None),
        ("amplitude of the twist [half-gaps]", f.twist or None),
        ("amplitude of the load [half-gaps]", f.load or None),
    )
    return (Facts(f"{loop} at rest", _rounded(items)),)


def _rounded(items: Sequence[tuple[str, Cell]]) -> tuple[tuple[str, Cell], ...]:
    return tuple((name, float(f"{v:.3g}") if isinstance(v, float) else v) for name, v in items if v is not None)


def _decibels(factors: Sequence[float]) -> list[float]:
    return [20.0 * math.log10(factor) if factor > 0.0 else math.nan for factor in factors]
