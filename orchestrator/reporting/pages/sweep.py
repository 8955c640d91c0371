"""The page of ``sweep``: how close the estimates are, and every case."""

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.reporting.model import POINT_LIMIT, ROW_LIMIT, Cell, Column, Plot, Report, Section, Series, Table
from orchestrator.reporting.pages.generic import sections_of
from orchestrator.reporting.source import Source, by_column, numbers, table_of, words

Columns = Mapping[str, list[Cell]]
UNITS = {"alpha": "rad", "noise": "rad"}
MOST_PLOTS = 12
FIRST = ("case", "alpha", "estimate", "lower", "upper", "error_percent", "noise")
STATISTICS = {
    "noise": ("noise", "rad"),
    "count": ("cases", ""),
    "mean_percent": ("mean error", "%"),
    "worst_percent": ("worst error", "%"),
    "mse": ("mean squared error", "rad²"),
    "coverage": ("coverage of intervals", "%"),
}


def build(source: Source) -> Report:
    """Return the page."""
    results = source.results
    failed, total = int(results["failed"]), int(results["cases"])
    first, failures, table = _excerpts(source, total)
    statistics: list[Mapping[str, Any]] = list(results.get("statistics", []))
    units = {c["name"]: c["unit"] for c in results.get("columns", [])}
    sections: list[Section] = [_cases("Failed cases", failures, UNITS | units, failed)] if failed else []
    if statistics:
        sections.append(_statistics(statistics))
    if {"alpha", "noise", "estimate", "lower", "upper", "error_percent"} <= set(table):
        sections += _plots(table)
    else:
        sections += _signals(table, units)
    sections.append(_cases("Cases", first, UNITS | units, total))
    sections += _provenance(results)
    return Report(
        title="Backlash sweep" if statistics else "Sweep",
        summary=_summary(statistics, total, failed) if statistics else f"{total - failed} of {total} cases are done.",
        badge=("bad", f"{failed} of {total} cases failed") if failed else ("good", f"all {total} cases done"),
        sections=tuple(sections),
        origin=source.origin(),
        downloads=source.downloads(),
    )


def _summary(statistics: Sequence[Mapping[str, Any]], total: int, failed: int) -> str:
    parts = []
    for s in statistics:
        where = f"With encoder noise of {s['noise']:g} rad" if s["noise"] else "Without noise"
        error = f"{s['mean_percent']:.3g} % in the mean and {s['worst_percent']:.3g} % at worst"
        parts.append(f"{where} the error is {error}.")
    return " ".join([f"The half-gap was estimated in {total - failed} of {total} cases.", *parts])


def _statistics(statistics: Sequence[Mapping[str, Any]]) -> Table:
    names = [name for name in STATISTICS if name in statistics[0]]
    columns = tuple(Column(*STATISTICS[name]) for name in names)
    rows = [{**s, "coverage": 100.0 * s["coverage"]} for s in statistics]
    return Table("Errors by noise level", columns, tuple(tuple(row[name] for name in names) for row in rows))


def _plots(table: Columns) -> list[Section]:
    alpha, estimate = numbers(table["alpha"]), numbers(table["estimate"])
    percent = numbers(table["error_percent"])
    noise = numbers(table["noise"])
    case = [f"case {_whole(c)}" for c in table["case"]]
    lower, upper = numbers(table["lower"]), numbers(table["upper"])
    estimates, errors = [], []
    for level in sorted({n for n in noise if n is not None}):
        rows = [i for i, n in enumerate(noise) if n == level and estimate[i] is not None]
        name = f"noise {level:g} rad" if level else "no noise"
        x, labels = [alpha[i] for i in rows], [case[i] for i in rows]
        low, high = [lower[i] for i in rows], [upper[i] for i in rows]
        estimates.append(Series(name, x, [estimate[i] for i in rows], "points", low, high, labels))
        errors.append(Series(name, x, [percent[i] for i in rows], "points", labels=labels))
    known = [v for v in (*alpha, *lower) if v is not None]
    wide = bool(known) and min(known) > 0.0 and max(known) / min(known) > 10.0
    return [
        Plot(
            "Estimated against actual half-gap",
            "actual [rad]",
            "estimated [rad]",
            tuple(estimates),
            diagonal=True,
            log_x=wide,
            log_y=wide,
            note="Bars: the interval given with each estimate. Dashed: estimated equals actual.",
        ),
        Plot("Error against size", "actual [rad]", "error [%]", tuple(errors), log_x=wide, log_y=True),
    ]


def _signals(table: Columns, units: Mapping[str, str]) -> list[Section]:
    """Return each result against the parameter that was varied first, for sweeps of any scenario."""
    varied = [n for n in table if n not in units and n not in {"case", "status", "message"}]
    numeric = [n for n in varied if any(v is not None for v in numbers(table[n]))]
    if not numeric:
        return []
    name = numeric[0]
    x = numbers(table[name])
    others = [n for n in varied if n != name]
    labels = [", ".join(f"{n} {table[n][i]}" for n in ("case", *others)) for i in range(len(x))]
    shown = [n for n in units if n in table][:MOST_PLOTS]
    return [
        Plot(n, name, f"{n} [{units[n]}]", (Series(n, x, numbers(table[n]), "points", labels=labels),)) for n in shown
    ]


def _excerpts(source: Source, total: int) -> tuple[Columns, Columns, Columns]:
    """Return the first rows, the first failed rows, and rows spread over all for the plots; memory stays bounded."""
    rows = source.rows("sweep.csv")
    header = next(rows, [])
    status = header.index("status")
    stride = max(1, -(-total // POINT_LIMIT))
    first: list[list[Cell]] = []
    failures: list[list[Cell]] = []
    spread: list[list[Cell]] = []
    for number, row in enumerate(rows):
        if number < ROW_LIMIT:
            first.append(row)
        if row[status] != "done" and len(failures) < ROW_LIMIT:
            failures.append(row)
        if number % stride == 0:
            spread.append(row)
    return by_column(header, first), by_column(header, failures), by_column(header, spread)


def _cases(title: str, table: Columns, units: Mapping[str, str], total: int) -> Table:
    """Return rows as a table, without the columns that are empty in all of them."""
    names = [n for n in dict.fromkeys((*FIRST, *table)) if n in table and any(v is not None for v in table[n])]
    rows = zip(*(table[n] for n in names), strict=True)
    columns = tuple(Column(words(n), units.get(n, ""), 6) for n in names)
    return Table(title, columns, tuple(_row(names, row) for row in rows), total=total)


def _row(names: Sequence[str], row: Sequence[Cell]) -> tuple[Cell, ...]:
    return tuple(_whole(v) if n in {"case", "repetition"} else v for n, v in zip(names, row, strict=True))


def _whole(value: Cell) -> Cell:
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _provenance(results: Mapping[str, Any]) -> list[Section]:
    made: list[Section] = []
    calibrations = results.get("calibrations") or {}
    if calibrations:
        made.append(
            table_of("Calibrations", [{"noise [rad]": n, **c} for n, c in calibrations.items()], note=CALIBRATION_NOTE)
        )
    for name in ("experiment", "fmus"):
        if isinstance(results.get(name), Mapping):
            made += sections_of({"fmus": "FMUs by content"}.get(name, name.capitalize()), results[name])
    return made


CALIBRATION_NOTE = "The monotone map from S to the half-gap, made from runs that no sweep uses."
