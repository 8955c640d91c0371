"""What ``compensate.json`` holds: the same plants under each law."""

from collections.abc import Sequence
from statistics import median
from typing import Annotated

import msgspec

from orchestrator.shared.results import ResultData
from orchestrator.shared.results.fields import Display, ReportTable, TableColumn, fields_table
from orchestrator.shared.results.regulator import ForecastFound

HARD = 1.5  # times the impact speed that is asked for: beyond it a landing is no longer soft


class LawFound(msgspec.Struct, frozen=True):
    """One law on all plants: medians, 95 % quantiles in ``upper``, and every traversal.

    ``error`` is that of the load during the move, ``rest`` its motion at the end, in counts of its encoder.
    ``unstable`` plants leave the end of the move; they are in no other number, and
    where all are, there is none. ``times`` [s] and ``impacts`` [rad/s]
    are of all traversals; ``path_times`` [s] and ``path`` [rad] of one.
    """

    law: Annotated[str, Display("law")]
    impact: Annotated[float | None, Display("largest impact", "rad/s", 3)]
    error: Annotated[float | None, Display("rms error", "rad", 3)]
    rest: Annotated[float | None, Display("rest, peak to peak", "counts", 3)]
    contacts: Annotated[float | None, Display("contacts at rest", "1/s", 3)]
    unstable: Annotated[int, Display("unstable plants")] = 0
    upper: dict[str, float] = {}
    times: tuple[float, ...] = ()
    impacts: tuple[float, ...] = ()
    path_times: tuple[float, ...] = ()
    path: tuple[float, ...] = ()


UPPER = {
    "time": TableColumn("traversal", "s", 3), "landing": TableColumn("impact of a traversal", "rad/s", 3),
    "impact": TableColumn("largest impact", "rad/s", 3), "error": TableColumn("rms error", "rad", 3),
    "rest": TableColumn("rest, peak to peak", "counts", 3),
}  # fmt: skip


def laws_tables(title: str, laws: Sequence[LawFound]) -> tuple[ReportTable, ReportTable]:
    """Return medians and 95 % quantiles over plants."""
    medians = fields_table(title, laws)
    for name, values in (("time", "times"), ("landing", "impacts")):
        found = [median(every) if (every := getattr(law, values)) else None for law in laws]
        medians = medians.with_column(UPPER[name], found)
    rows = tuple((law.law, *map(law.upper.get, UPPER)) for law in laws)
    return medians, ReportTable("95 % quantiles over the plants", (TableColumn("law"), *UPPER.values()), rows)


class CompensateFound(ResultData, frozen=True, kw_only=True):
    """``compensate``: half-gap [rad], impact speed asked for [rad/s], and the least time of a traversal [s].

    ``bound_speeds`` [rad/s] and ``bound_times`` [s] are that time for other speeds; ``path_times`` [s] and ``path``
    [rad] the quickest traversal. ``machine`` is the model's file, ``gains`` are the LQR's for ``weights`` of the states
    and 1 for the request. ``doubts`` say what is not as it should be; ``files`` are what was made of it.
    """

    alpha: float
    tau: float
    impact_speed: float
    bound: float
    laws: tuple[LawFound, ...]
    forecast: ForecastFound | None = None
    machine: str | None = None
    plants: int | None = None
    weights: tuple[float, ...] = ()
    gains: tuple[float, ...] = ()
    doubts: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    bound_speeds: tuple[float, ...] = ()
    bound_times: tuple[float, ...] = ()
    path_times: tuple[float, ...] = ()
    path: tuple[float, ...] = ()
