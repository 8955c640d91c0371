"""The page of ``bench``: each tool's time against ours, and how our cost grows."""

from collections.abc import Sequence

from benchmarks.masters.alone import RecordCost, SweepCost
from benchmarks.masters.measure import ToolRow
from benchmarks.masters.results import BenchFound
from benchmarks.masters.scaling import Cost
from orchestrator.reporting.model import Plot, Report, ReportTable, Section, Series, TableColumn
from orchestrator.reporting.source import ResultDocument, table_of, words
from orchestrator.shared.results import as_plain, read


def build(source: ResultDocument) -> Report:
    """Return the page."""
    results = read(source.results, BenchFound)
    rows = results.rows
    measured = [row for row in rows if row.wall is not None]
    sections: list[Section] = [_tools(rows, measured)]
    if measured:
        names = tuple(row.title for row in measured)
        wall: list[float | None] = [_milliseconds(row.wall) for row in measured]
        series = Series("wall time", list(range(len(measured))), wall, "bars")
        sections.append(Plot("Wall time of one run", "tool", "time [ms]", (series,), categories=names))
    sections += _scaling(results.scaling)
    sections += _growth(results.sweeps, results.records)
    return Report(
        title="Benchmark",
        summary=_summary(rows, measured),
        sections=tuple(sections),
        origin=source.origin(),
        downloads=source.downloads(),
    )


def _summary(rows: Sequence[ToolRow], measured: Sequence[ToolRow]) -> str:
    missing = len(rows) - len(measured)
    left_out = f" {missing} could not be measured here." if missing else ""
    return f"{len(measured)} tools ran the same FMUs and the same scenario, in turn.{left_out}"


def _tools(rows: Sequence[ToolRow], measured: Sequence[ToolRow]) -> ReportTable:
    columns = (
        TableColumn("tool"),
        TableColumn("version"),
        TableColumn("scheme"),
        TableColumn("wall", "ms"),
        TableColumn("processor", "ms"),
        TableColumn("wall ratio", "", 3),
        TableColumn("processor ratio", "", 3),
        TableColumn("deviation", "rad", 1),
        TableColumn("note"),
    )
    wall, cpu = (measured[0].wall, measured[0].cpu) if measured else (None, None)
    cells = tuple(
        (
            row.title,
            row.version or None,
            row.scheme,
            _milliseconds(row.wall),
            _milliseconds(row.cpu),
            _ratio(wall, row.wall),
            _ratio(cpu, row.cpu),
            row.deviation,
            row.note or None,
        )
        for row in rows
    )
    return ReportTable("Tools", columns, cells, "Medians. Ratio: the time of the first tool over that of the row's.")


def _milliseconds(seconds: float | None) -> float | None:
    return None if seconds is None else 1e3 * seconds


def _ratio(base: float | None, value: float | None) -> float | None:
    return base / value if base is not None and value else None


def _scaling(costs: Sequence[Cost]) -> list[Section]:
    if not costs:
        return []
    by_fmus: dict[int, list[Cost]] = {}
    for cost in costs:
        by_fmus.setdefault(cost.fmus, []).append(cost)
    series = tuple(
        Series(
            f"{count} FMUs",
            [float(c.steps) for c in found],
            [c.microseconds for c in found],
            "points",
            labels=[f"{c.steps} steps" for c in found],
        )
        for count, found in by_fmus.items()
    )
    units = {"microseconds": "µs"}
    return [
        Plot("Cost per FMU and step", "steps", "cost [µs]", series, log_x=True),
        table_of("Cost of our master", [{words(k): v for k, v in as_plain(c).items()} for c in costs], units=units),
    ]


def _growth(sweeps: Sequence[SweepCost], records: Sequence[RecordCost]) -> list[Section]:
    sections: list[Section] = []
    if sweeps:
        units = {"total": "s", "per_case": "s", "peak": "MiB"}
        sections.append(table_of("Sweeps", sweeps, units=units))
    if records:
        units = {"growth": "MiB", "expected": "MiB"}
        sections.append(table_of("Memory of records", records, units=units))
    return sections
