"""The page of ``bench``: each tool's time against ours, and how our cost grows."""

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.reporting.model import Column, Plot, Report, Section, Series, Table
from orchestrator.reporting.source import Source, table_of, words

Json = Mapping[str, Any]


def build(source: Source) -> Report:
    """Return the page."""
    rows: list[Json] = list(source.results.get("rows") or [])
    measured = [row for row in rows if row.get("wall") is not None]
    sections: list[Section] = [_tools(rows, measured)]
    if measured:
        names = tuple(str(row["title"]) for row in measured)
        wall: list[float | None] = [1e3 * float(row["wall"]) for row in measured]
        series = Series("wall time", list(range(len(measured))), wall, "bars")
        sections.append(Plot("Wall time of one run", "tool", "time [ms]", (series,), categories=names))
    sections += _scaling(list(source.results.get("scaling") or []))
    sections += _growth(list(source.results.get("sweeps") or []), list(source.results.get("records") or []))
    return Report(
        title="Benchmark",
        summary=_summary(rows, measured),
        sections=tuple(sections),
        origin=source.origin(),
        downloads=source.downloads(),
    )


def _summary(rows: Sequence[Json], measured: Sequence[Json]) -> str:
    missing = len(rows) - len(measured)
    left_out = f" {missing} could not be measured here." if missing else ""
    return f"{len(measured)} tools ran the same FMUs and the same scenario, in turn.{left_out}"


def _tools(rows: Sequence[Json], measured: Sequence[Json]) -> Table:
    columns = (
        Column("tool"),
        Column("version"),
        Column("scheme"),
        Column("wall", "ms"),
        Column("processor", "ms"),
        Column("wall ratio", "", 3),
        Column("processor ratio", "", 3),
        Column("deviation", "rad", 1),
        Column("note"),
    )
    base = measured[0] if measured else {}
    cells = tuple(
        (
            row["title"],
            row.get("version") or None,
            row.get("scheme"),
            *(_milliseconds(row.get(name)) for name in ("wall", "cpu")),
            *(_ratio(base.get(name), row.get(name)) for name in ("wall", "cpu")),
            row.get("deviation"),
            row.get("note") or None,
        )
        for row in rows
    )
    return Table("Tools", columns, cells, "Medians. Ratio: the time of the first tool over that of the row's.")


def _milliseconds(seconds: float | None) -> float | None:
    return None if seconds is None else 1e3 * seconds


def _ratio(base: float | None, value: float | None) -> float | None:
    return base / value if base is not None and value else None


def _scaling(costs: Sequence[Json]) -> list[Section]:
    if not costs:
        return []
    by_fmus: dict[int, list[Json]] = {}
    for cost in costs:
        by_fmus.setdefault(int(cost["fmus"]), []).append(cost)
    series = tuple(
        Series(
            f"{count} FMUs",
            [float(c["steps"]) for c in found],
            [float(c["microseconds"]) for c in found],
            "points",
            labels=[f"{c['steps']} steps" for c in found],
        )
        for count, found in by_fmus.items()
    )
    units = {"microseconds": "µs"}
    return [
        Plot("Cost per FMU and step", "steps", "cost [µs]", series, log_x=True),
        table_of("Cost of our master", [{words(k): v for k, v in c.items()} for c in costs], units=units),
    ]


def _growth(sweeps: Sequence[Json], records: Sequence[Json]) -> list[Section]:
    sections: list[Section] = []
    if sweeps:
        units = {"total": "s", "per_case": "s", "peak": "MiB"}
        sections.append(table_of("Sweeps", sweeps, units=units))
    if records:
        units = {"growth": "MiB", "expected": "MiB"}
        sections.append(table_of("Memory of records", records, units=units))
    return sections
