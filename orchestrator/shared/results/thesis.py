"""What ``thesis.json`` holds: published numbers beside recomputed ones."""

import msgspec

from orchestrator.shared.results import ResultData


class Comparison(msgspec.Struct, frozen=True):
    """A published number or vector beside the recomputed one.

    ``deviation`` is the largest difference relative to the largest published value; ``agrees`` tells whether it lies
    within the rounding of the printed figures.
    """

    what: str
    where: str
    published: tuple[float, ...]
    recomputed: tuple[float, ...]
    deviation: float
    agrees: bool
    note: str = ""


class TableRow(msgspec.Struct, frozen=True):
    """One row of Table 4.1: actual and estimated half-gap [rad], S [rad], error [%]."""

    alpha: float
    S: float
    estimate: float
    error_percent: float


class TableComparison(msgspec.Struct, frozen=True):
    """Table 4.1 by the quadratic map through it: estimates [rad], errors [%], and their statistics."""

    estimates: tuple[float, ...]
    errors_percent: tuple[float, ...]
    largest_deviation: float
    mean_error_percent: float
    mse: float


class ThesisTable(TableComparison, frozen=True):
    """The same with the rows as printed, and with our estimates [rad] of their sizes."""

    rows: tuple[TableRow, ...]
    our_estimates: tuple[float, ...]


class Erratum(msgspec.Struct, frozen=True):
    """What is printed, what is right, and the numbers that show it."""

    number: int
    where: str
    printed: str
    right: str
    shown_by: str


class OtherResult(msgspec.Struct, frozen=True):
    """A result of others that the thesis compares itself with."""

    who: str
    method: str
    figure: str


class ThesisFound(ResultData, frozen=True, kw_only=True):
    """``thesis``: models and gains, Table 4.1, errata, and what others found."""

    gains: tuple[Comparison, ...]
    table: ThesisTable
    errata: tuple[Erratum, ...]
    others: tuple[OtherResult, ...] = ()
