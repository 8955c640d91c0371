"""The page of ``regulator``: gains, what the loop does at rest, and its response at the request."""

from orchestrator.plants.design import GAIN_UNITS, REGULATOR_STATES
from orchestrator.reporting.model import Facts, Plot, Report, Series
from orchestrator.reporting.source import ResultDocument
from orchestrator.shared.results import read
from orchestrator.shared.results.fields import fields_facts
from orchestrator.shared.results.regulator import ForecastFound, RegulatorFound, gains_table


def build(source: ResultDocument) -> Report:
    """Return the page."""
    results = read(source.results, RegulatorFound)
    f = results.forecast
    return Report(
        title="Regulator of a drivetrain with a gap",
        summary=f.rest_text("the loop"),
        sections=(
            gains_table(results.gains, REGULATOR_STATES, GAIN_UNITS),
            *rest_facts(f, "The loop"),
            Plot(
                "Open-loop gain without a gap, cut at the torque request",
                "frequency [Hz]",
                "gain",
                (Series("gain", results.frequencies, results.response),),
                log_x=True,
                log_y=True,
            ),
            Plot(
                "Open-loop phase",
                "frequency [Hz]",
                "phase [rad]",
                (Series("phase", results.frequencies, results.phases),),
                log_x=True,
            ),
        ),
        origin=source.origin(),
        downloads=source.downloads(),
    )


def rest_facts(f: ForecastFound | None, loop: str) -> tuple[Facts, ...]:
    """Return what a loop does by its gains alone; nothing where the file does not say it."""
    if f is None:
        return ()
    return (Facts(f"{loop} at rest", fields_facts(f)),)
