"""The page of ``thesis``: every published number beside the recomputed one."""

from collections.abc import Sequence

from orchestrator.reporting.model import Plot, Report, Section, Series
from orchestrator.reporting.source import ResultDocument, table_of
from orchestrator.shared.results import read
from orchestrator.shared.results.fields import ReportTable, TableColumn
from orchestrator.shared.results.thesis import TableRow, ThesisFound


def build(source: ResultDocument) -> Report:
    """Return the page."""
    results = read(source.results, ThesisFound)
    agree, compared = sum(one.agrees for one in results.gains), len(results.gains)
    table = results.table
    sections: list[Section] = [
        table_of("Model and gains", results.gains),
        _table_4_1(table.rows, table.our_estimates),
        _errors(table.rows, table.our_estimates),
        table_of("Errata", results.errata),
        table_of("Results of others, as the thesis quotes them", results.others),
    ]
    return Report(
        title="The thesis, recomputed",
        summary=(
            f"{agree} of {compared} published models and gains agree with the recomputed ones to all printed digits; "
            f"{len(results.errata)} errata are shown by computation."
        ),
        badge=("neutral", f"{agree} of {compared} agree"),
        sections=tuple(sections),
        origin=source.origin(),
        downloads=source.downloads(),
    )


def _table_4_1(published: Sequence[TableRow], ours: Sequence[float]) -> ReportTable:
    columns = (
        TableColumn("alpha", "rad", 5),
        TableColumn("S", "", 5),
        TableColumn("published estimate", "rad", 5),
        TableColumn("published error", "%"),
        TableColumn("our estimate", "rad", 6),
        TableColumn("our error", "%"),
    )
    rows = tuple(
        (*(row.alpha, row.S, row.estimate, row.error_percent), own, 100.0 * abs(own - row.alpha) / row.alpha)
        for row, own in zip(published, ours, strict=True)
    )
    return ReportTable("Table 4.1", columns, rows)


def _errors(published: Sequence[TableRow], ours: Sequence[float]) -> Plot:
    alpha = [row.alpha for row in published]
    own = [100.0 * abs(o - a) / a for o, a in zip(ours, alpha, strict=True)]
    series = (
        Series("published", alpha, [row.error_percent for row in published], "points"),
        Series("ours", alpha, own, "points"),
    )
    return Plot("Errors of Table 4.1", "alpha [rad]", "error [%]", series, log_y=all(v > 0.0 for v in own))
