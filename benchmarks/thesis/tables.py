"""Published numbers beside recomputed ones, as rows of tables."""

from collections.abc import Sequence
from typing import Annotated

import msgspec

from orchestrator.shared.results.fields import Display, ReportTable, TableColumn, fields_table


class Comparison(msgspec.Struct, frozen=True):
    """A published number or vector beside the recomputed one.

    ``deviation`` is the largest difference relative to the largest published value; ``agrees`` tells whether it lies
    within the rounding of the printed figures.
    """

    what: Annotated[str, Display("what")]
    where: Annotated[str, Display("where")]
    published: Annotated[tuple[float, ...], Display("published", digits=5)]
    recomputed: Annotated[tuple[float, ...], Display("recomputed", digits=5)]
    deviation: Annotated[float, Display("largest deviation", digits=2)]
    agrees: Annotated[bool, Display("agrees")]
    note: Annotated[str, Display("note")] = ""


class TableRow(msgspec.Struct, frozen=True):
    """One row of Table 4.1: actual and estimated half-gap."""

    alpha: Annotated[float, Display("alpha", "rad", 5)]
    S: Annotated[float, Display("S", "rad", 5)]
    estimate: Annotated[float, Display("published estimate", "rad", 5)]
    error_percent: Annotated[float, Display("published error", "%")]


class TableComparison(msgspec.Struct, frozen=True):
    """Table 4.1 by the quadratic map through it: estimates [rad], errors [%], and their statistics."""

    estimates: tuple[float, ...]
    errors_percent: tuple[float, ...]
    largest_deviation: float
    mean_error_percent: float
    mse: float


class Erratum(msgspec.Struct, frozen=True):
    """What is printed, what is right, and the numbers that show it."""

    number: Annotated[int, Display("number")]
    where: Annotated[str, Display("where")]
    printed: Annotated[str, Display("printed")]
    right: Annotated[str, Display("right")]
    shown_by: Annotated[str, Display("shown by")]


class OtherResult(msgspec.Struct, frozen=True):
    """A result of others that the thesis compares itself with."""

    who: Annotated[str, Display("who")]
    method: Annotated[str, Display("method")]
    figure: Annotated[str, Display("figure")]


def thesis_tables(
    gains: Sequence[Comparison], rows: Sequence[TableRow], table: TableComparison, our_estimates: Sequence[float]
) -> tuple[ReportTable, ReportTable]:
    """Return model and gains, and Table 4.1 with what the thesis's map and our estimates [rad] make of it."""
    ours = [100.0 * abs(own - row.alpha) / row.alpha for row, own in zip(rows, our_estimates, strict=True)]
    sizes = fields_table("Table 4.1", rows)
    for label, unit, digits, cells in (
        ("by the quadratic", "rad", 5, table.estimates), ("its error", "%", 4, table.errors_percent),
        ("our estimate", "rad", 6, our_estimates), ("our error", "%", 4, ours),
    ):  # fmt: skip
        sizes = sizes.with_column(TableColumn(label, unit, digits), cells)
    return fields_table("Model and gains, recomputed with the A that the thesis used", gains), sizes
