"""The page of ``thesis``: every published number beside the recomputed one."""

from collections.abc import Sequence

from orchestrator.reporting.model import Plot, Report, Section, Series
from orchestrator.reporting.source import ResultDocument
from orchestrator.shared.results import read
from orchestrator.shared.results.thesis import TableRow, ThesisFound, thesis_tables


def build(source: ResultDocument) -> Report:
    """Return the page."""
    results = read(source.results, ThesisFound)
    agree, compared = sum(one.agrees for one in results.gains), len(results.gains)
    table = results.table
    gains, sizes, *others = thesis_tables(results)
    sections: list[Section] = [gains, sizes, _errors(table.rows, table.our_estimates), *others]
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


def _errors(published: Sequence[TableRow], ours: Sequence[float]) -> Plot:
    alpha = [row.alpha for row in published]
    own = [100.0 * abs(o - a) / a for o, a in zip(ours, alpha, strict=True)]
    series = (
        Series("published", alpha, [row.error_percent for row in published], "points"),
        Series("ours", alpha, own, "points"),
    )
    return Plot("Errors of Table 4.1", "alpha [rad]", "error [%]", series, log_y=all(v > 0.0 for v in own))
