"""The page of ``estimate`` for a train of two stages: where the gap is, and the motion that says so."""

from orchestrator.reporting.model import Plot, Report, Section, Series
from orchestrator.reporting.pages.generic import folds_of
from orchestrator.reporting.pages.meanings import fitted_parameters
from orchestrator.reporting.pages.record import measured_and_fitted
from orchestrator.reporting.quantities import interval_words
from orchestrator.reporting.source import ResultDocument
from orchestrator.reporting.trust import trust_badge, trust_section
from orchestrator.shared.results import GapFound
from orchestrator.shared.results.estimate import EstimateFound, LocationFound, location_tables

STAGES = {"1": "stage 1", "2": "stage 2"}


def build_location(source: ResultDocument, results: EstimateFound, location: LocationFound) -> Report:
    """Return the page."""
    sections: list[Section] = [
        *trust_section(results.trust),
        *location_tables(location),
        *_twists(source, location),
        *folds_of(
            {
                "Measured and fitted": measured_and_fitted(source, "stages.csv"),
                "Values of the fit": fitted_parameters(location.parameters),
            }
        ),
    ]
    sizes = [f"The half-gap of {STAGES[n]} is {_size(location.stages[n])}." for n in location.answers if n in STAGES]
    summary = " ".join([results.message or "", *sizes])
    said = f"in {location.answer}" if location.answers else "nowhere seen"
    badge = trust_badge(results.trust, said, "good" if len(location.answers) == 1 else "warn")
    unit = results.record.angle_unit if results.record else "rad"
    return Report("Where the gap is", summary, tuple(sections), badge, angle_unit=unit)


def _size(gap: GapFound) -> str:
    value, low, high = interval_words(gap.alpha, gap.lower, gap.upper)
    return f"{value} rad at its gear's output (95 %: {low} to {high})"


def _twists(source: ResultDocument, location: LocationFound) -> list[Section]:
    """Return the twist of each stage as fitted, with its flanks."""
    table = source.signals("stages.csv")
    plots: list[Section] = []
    for name, stage in STAGES.items():
        if not {"time", f"twist_{name}"} <= set(table):
            continue
        time, half = table["time"], location.stages[name].alpha
        series = [Series("twist", time, table[f"twist_{name}"])]
        if half:
            ends = [float(time[0]), float(time[-1])]
            series += [Series(f"flank {sign:+d}", ends, [sign * half, sign * half]) for sign in (-1, 1)]
        note = "From the fitted motion; between the flanks no teeth touch."
        plots.append(Plot(f"Twist of {stage}", "time [s]", "twist [rad]", tuple(series), note=note))
    return plots
