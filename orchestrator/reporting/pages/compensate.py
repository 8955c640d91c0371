"""The page of ``compensate``: time against impact of every traversal, and one of each law beside the bound."""

from statistics import median

from orchestrator.reporting.model import Facts, Plot, Report, Series
from orchestrator.reporting.pages.regulator import rest_facts
from orchestrator.reporting.source import ResultDocument
from orchestrator.shared.results import read
from orchestrator.shared.results.compensate import CompensateFound, laws_tables


def build(source: ResultDocument) -> Report:
    """Return the page."""
    results = read(source.results, CompensateFound)
    bound = Series("bound from rest", results.bound_times, results.bound_speeds)
    clouds = tuple(Series(law.law, law.times, law.impacts, "points") for law in results.laws if law.times)
    paths = tuple(Series(law.law, law.path_times, law.path) for law in results.laws if law.path)
    quickest = Series("bound from rest", results.path_times, results.path)
    last = results.laws[-1]
    time = f"takes {median(last.times):.3f} s (median)" if last.times else "does not occur"
    impact, plain = (
        "not known" if law.impact is None else f"{law.impact:.3g} rad/s" for law in (last, results.laws[0])
    )
    return Report(
        title="Control laws across the gap",
        summary=(
            f"With the {last.law}, a traversal {time}. The shortest possible traversal from rest with an impact speed "
            f"of {results.impact_speed:g} rad/s takes {results.bound:.4f} s. The largest impact is {impact} with the "
            f"{last.law} and {plain} with the {results.laws[0].law}."
        ),
        sections=(
            *laws_tables("Medians over plants", results.laws),
            *([Facts("Doubts", tuple(("", doubt) for doubt in results.doubts))] if results.doubts else []),
            *rest_facts(results.forecast, "The plain LQR"),
            Plot(
                "Traversals",
                "time [s]",
                "impact [rad/s]",
                (bound, *clouds),
                log_x=True,
                log_y=True,
                note="Traversals that start in motion or from a twisted shaft may be faster than the bound from rest.",
            ),
            Plot(
                "The first traversal of each law",
                "time [s]",
                "twist, from the flank at the start [rad]",
                (quickest, *paths),
            ),
        ),
        origin=source.origin(),
        downloads=source.downloads(),
    )
