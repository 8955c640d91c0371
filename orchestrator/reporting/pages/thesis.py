"""The page of ``thesis``: every published number beside the recomputed one."""

from collections.abc import Mapping
from typing import Any

from orchestrator.reporting.model import Plot, Report, ReportTable, Section, Series, TableColumn
from orchestrator.reporting.source import ResultDocument, plain, table_of


def build(source: ResultDocument) -> Report:
    """Return the page.

    Args:
        source: results of `thesis`.

    Returns:
        The report.
    """
    results = source.results
    gains: list[Mapping[str, Any]] = list(results["gains"])
    agree = sum(bool(g["agrees"]) for g in gains)
    published: list[Mapping[str, Any]] = list(results["table"]["rows"])
    ours = [float(v) for v in results["table"]["our_estimates"]]
    sections: list[Section] = [
        table_of("Model and gains", gains),
        _table_4_1(published, ours),
        _errors(published, ours),
        table_of("Errata", list(results["errata"])),
        table_of("Results of others, as the thesis quotes them", list(results.get("others", []))),
    ]
    return Report(
        title="The thesis, recomputed",
        summary=(
            f"{agree} of {len(gains)} published models and gains agree with the recomputed ones to all printed digits; "
            f"{len(results['errata'])} errata are shown by computation."
        ),
        badge=("neutral", f"{agree} of {len(gains)} agree"),
        sections=tuple(sections),
        origin=source.origin(),
        downloads=source.downloads(),
    )


def _table_4_1(published: list[Mapping[str, Any]], ours: list[float]) -> ReportTable:
    columns = (
        TableColumn("alpha", "rad", 5),
        TableColumn("S", "", 5),
        TableColumn("published estimate", "rad", 5),
        TableColumn("published error", "%"),
        TableColumn("our estimate", "rad", 6),
        TableColumn("our error", "%"),
    )
    rows = tuple(
        (
            *(plain(row[name]) for name in ("alpha", "S", "estimate", "error_percent")),
            own,
            100.0 * abs(own - row["alpha"]) / row["alpha"],
        )
        for row, own in zip(published, ours, strict=True)
    )
    return ReportTable("Table 4.1", columns, rows)


def _errors(published: list[Mapping[str, Any]], ours: list[float]) -> Plot:
    alpha = [float(row["alpha"]) for row in published]
    own = [100.0 * abs(o - a) / a for o, a in zip(ours, alpha, strict=True)]
    series = (
        Series("published", alpha, [float(row["error_percent"]) for row in published], "points"),
        Series("ours", alpha, own, "points"),
    )
    return Plot("Errors of Table 4.1", "alpha [rad]", "error [%]", series, log_y=all(v > 0.0 for v in own))
