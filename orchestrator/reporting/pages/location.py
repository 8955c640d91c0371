"""The page of ``estimate`` for a train of two stages: where the gap is, and the motion that says so."""

from orchestrator.reporting.model import Plot, Report, Section, Series
from orchestrator.reporting.pages.record import one_step_errors, record_plots
from orchestrator.reporting.source import ResultDocument
from orchestrator.reporting.trust import trust_badge, trust_section
from orchestrator.shared.results.estimate import EstimateFound, LocationFound, location_tables, parameters_table

STAGES = {"1": "stage 1", "2": "stage 2"}


def build_location(source: ResultDocument, results: EstimateFound, location: LocationFound) -> Report:
    """Return the page."""
    sections: list[Section] = [
        *trust_section(results.trust),
        *location_tables(location),
        *_twists(source, location),
        *record_plots(source, "stages.csv"),
        *one_step_errors(source.signals("stages.csv")),
        parameters_table("Parameters fitted with the gaps", location.parameters),
    ]
    said = f"in {location.answer}" if location.answers else "nowhere seen"
    badge = trust_badge(results.trust, said, "good" if len(location.answers) == 1 else "warn")
    unit = results.record.angle_unit if results.record else "rad"
    return Report(
        "Where the gap is", results.message or "", tuple(sections), badge, source.origin(), source.downloads(), unit
    )


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
