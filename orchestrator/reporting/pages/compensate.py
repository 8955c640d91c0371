"""The page of ``compensate``: the law to take, time against impact of every traversal, and one of each law."""

from collections.abc import Sequence

from orchestrator.reporting.model import Badge, Plot, Report, Series, Text
from orchestrator.reporting.pages.regulator import rest_facts
from orchestrator.reporting.source import ResultDocument
from orchestrator.shared.results import read
from orchestrator.shared.results.compensate import HARD, CompensateFound, LawFound, laws_tables


def build(source: ResultDocument) -> Report:
    """Return the page."""
    results = read(source.results, CompensateFound)
    bound = Series("bound from rest", results.bound_times, results.bound_speeds)
    clouds = tuple(Series(law.law, law.times, law.impacts, "points") for law in results.laws if law.times)
    paths = tuple(Series(law.law, law.path_times, law.path) for law in results.laws if law.path)
    quickest = Series("bound from rest", results.path_times, results.path)
    badge, summary = _recommend(results.laws, results.impact_speed)
    least = f"The shortest from rest with an impact of {results.impact_speed:g} rad/s takes {results.bound:.3g} s."
    more = "Traversals that start in motion or from a twisted shaft may be faster."
    label = "twist, from the flank at the start [rad]"
    return Report(
        title="Control laws across the gap",
        summary=summary,
        badge=("warn", badge[1]) if results.doubts and badge[0] == "good" else badge,
        sections=(
            *([Text("Doubts", results.doubts)] if results.doubts else []),
            *laws_tables("Medians over plants", results.laws),
            Plot(
                "Traversals",
                "time [s]",
                "impact [rad/s]",
                (bound, *clouds),
                log_x=True,
                log_y=True,
                note=f"{least} {more}",
            ),
            Plot("The first traversal of each law", "time [s]", label, (quickest, *paths)),
            *rest_facts(results.forecast, "The plain LQR"),
        ),
    )


def _recommend(laws: Sequence[LawFound], speed: float) -> tuple[tuple[Badge, str], str]:
    """Return the law to take: of those that are stable and land softly the most accurate, else the softest."""
    stable = [
        (law.impact, law.error, law.law)
        for law in laws
        if not law.unstable and law.impact is not None and law.error is not None
    ]
    if not stable:
        return ("bad", "none is stable"), "No law is stable on every plant, so none is recommended."
    soft = [(impact, error, name) for impact, error, name in stable if impact <= HARD * speed]
    impact, error, best = min(soft, key=lambda law: law[1]) if soft else min(stable)
    why = f"it follows best of those that land with at most {HARD:g} times the {speed:g} rad/s asked for"
    why = why if soft else f"it lands most softly, but harder than the {speed:g} rad/s asked for"
    numbers = f"In the median over plants its largest impact is {impact:.3g} rad/s and its error {error:.3g} rad rms."
    return ("good" if soft else "warn", f"take the {best}"), f"Take the {best}: {why}. {numbers}"
