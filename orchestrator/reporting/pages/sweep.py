"""The page of ``sweep``: how close the estimates are, and every case."""

from collections.abc import Mapping, Sequence

from orchestrator.errors import ScenarioError
from orchestrator.reporting.model import POINT_LIMIT, Badge, Plot, Report, Section, Series
from orchestrator.reporting.source import ResultDocument, by_column, numbers, plain, words
from orchestrator.reporting.trust import trust_badge, trust_section
from orchestrator.shared.results import ErrorsFound, SweepFound, TrustFound, read
from orchestrator.shared.results.fields import ROW_LIMIT, Cell, ReportTable, TableColumn, fields_table

Columns = Mapping[str, list[Cell]]
UNITS = {"alpha": "rad", "noise": "rad"}
MOST_PLOTS = 12
OWN = frozenset({"alpha", "noise", "repetition"})
SUMMARIES = frozenset({"last", "min", "max", "mean", "rms"})
NAMES = {"alpha": "half-gap", "lower": "95 % from", "upper": "to", "error_percent": "error"}
FIRST = ("case", "alpha", "estimate", "lower", "upper", "error_percent", "noise")


def build(source: ResultDocument) -> Report:
    """Return the page."""
    results = read(source.results, SweepFound)
    failed, total = results.failed, results.cases
    first, failures, table = _excerpts(source, total)
    statistics = results.statistics
    name = results.scenario.name if results.scenario is not None else ""
    units = {c.name: c.unit for c in results.columns}
    sections: list[Section] = trust_section(results.trust)
    sections += [_cases("Failed cases", failures, UNITS | units, failed)] if failed else []
    if statistics:
        sections.append(fields_table("Errors by noise level", statistics, COVERAGE))
    if {"alpha", "noise", "estimate", "lower", "upper", "error_percent"} <= set(table):
        sections += [*_plots(table), *_influences(table, units)]
    else:
        sections += _signals(table, units)
    sections.append(_cases("Cases", first, UNITS | units, total))
    return Report(
        title="Backlash sweep" if statistics else f"Sweep of {name}" if name else "Sweep",
        summary=_summary(statistics, total, failed) if statistics else _count(source, results),
        badge=_badge(results.trust, failed, total),
        sections=tuple(sections),
    )


def _badge(trust: TrustFound | None, failed: int, total: int) -> tuple[Badge, str]:
    """Return the colour of the worse of trust and failures, and how many cases are done."""
    if failed:
        return "bad", f"{failed} of {total} cases failed"
    return trust_badge(trust, f"all {total} cases done", "good")


def _count(source: ResultDocument, results: SweepFound) -> str:
    """Return how many cases are done, over what, and what FMUs had to say."""
    total, failed = results.cases, results.failed
    varied = ", ".join(str(text) for text in source.arguments.get("vary") or ())
    remarks = f" {results.remarked} have remarks; the first: {results.first_remark}." if results.remarked else ""
    return f"{total - failed} of {total} cases are done" + (f", over {varied}." if varied else ".") + remarks


def _summary(statistics: Sequence[ErrorsFound], total: int, failed: int) -> str:
    parts = []
    for s in statistics:
        where = f"With encoder noise of {s.noise:g} rad" if s.noise else "Without noise"
        error = f"{s.mean_percent:.3g} % in the mean and {s.worst_percent:.3g} % at worst"
        parts.append(f"{where} the error is {error}.")
    return " ".join([f"The half-gap was estimated in {total - failed} of {total} cases.", *parts])


def _plots(table: Columns) -> list[Section]:
    alpha, estimate = numbers(table["alpha"]), numbers(table["estimate"])
    percent = numbers(table["error_percent"])
    noise = numbers(table["noise"])
    case = [f"case {_whole(c)}" for c in table["case"]]
    lower, upper = numbers(table["lower"]), numbers(table["upper"])
    estimates = _by_noise(noise, alpha, estimate, case, lower, upper)
    errors = _by_noise(noise, alpha, percent, case)
    known = [v for v in (*alpha, *estimate) if v is not None and v > 0.0]
    wide = bool(known) and max(known) / min(known) > 10.0
    return [
        Plot(
            "Estimated against actual half-gap",
            "actual [rad]",
            "estimated [rad]",
            estimates,
            diagonal=True,
            log_x=wide,
            log_y=wide,
            note="Bars: the interval given with each estimate. Dashed: estimated equals actual.",
        ),
        Plot("Error against size", "actual [rad]", "error [%]", errors, log_x=wide, log_y=True),
    ]


def _by_noise(
    noise: Sequence[float | None], x: Sequence[float | None], y: Sequence[float | None], labels: Sequence[str],
    low: Sequence[float | None] = (), high: Sequence[float | None] = (),
) -> tuple[Series, ...]:  # fmt: skip
    """Return a cloud of points for each noise level."""
    made = []
    for level in sorted({n for n in noise if n is not None}):
        rows = [i for i, n in enumerate(noise) if n == level and y[i] is not None]
        least, most = ([column[i] for i in rows] if column else None for column in (low, high))
        name = f"noise {level:g} rad" if level else "no noise"
        told = [labels[i] for i in rows]
        made.append(Series(name, [x[i] for i in rows], [y[i] for i in rows], "points", least, most, told))
    return tuple(made)


def _influences(table: Columns, units: Mapping[str, str]) -> list[Section]:
    """Return the error of the estimate against each parameter that was varied beside the size."""
    alpha, estimate, noise = (numbers(table[n]) for n in ("alpha", "estimate", "noise"))
    error = [None if a is None or e is None else 100.0 * (e - a) / a for a, e in zip(alpha, estimate, strict=True)]
    found: list[Section] = []
    for name in _parameter_columns(table, units):
        if name in OWN:
            continue
        x, categories = _axis(table[name])
        labels = [f"case {_whole(case)}, half-gap {size} rad" for case, size in zip(table["case"], alpha, strict=True)]
        series = _by_noise(noise, x, error, labels)
        note = "Estimated minus actual half-gap, in percent of the actual one."
        found.append(Plot(f"Error against {name}", name, "error [%]", series, categories=categories, note=note))
    return found[:MOST_PLOTS]


def _signals(table: Columns, units: Mapping[str, str]) -> list[Section]:
    """Return each signal's results against each varied parameter, for sweeps of any scenario."""
    varied = _parameter_columns(table, units)
    signals: dict[str, list[str]] = {}
    for column in (n for n in units if n in table):
        head, _, what = column.rpartition(".")
        signals.setdefault(head if what in SUMMARIES and head else column, []).append(column)
    made: list[Section] = []
    for signal, columns in signals.items():
        for name in varied:
            x, categories = _axis(table[name])
            others = [n for n in varied if n != name]
            labels = [", ".join(f"{n} {plain(_whole(table[n][i]))}" for n in ("case", *others)) for i in range(len(x))]
            series = tuple(
                Series(c.removeprefix(f"{signal}."), x, numbers(table[c]), "points", labels=labels) for c in columns
            )
            label = f"{signal} [{units[columns[0]]}]"
            made.append(Plot(f"{signal} against {name}", name, label, series, categories=categories))
    return made[:MOST_PLOTS]


def _parameter_columns(table: Columns, units: Mapping[str, str]) -> list[str]:
    return [n for n in table if n not in units and n not in {"case", "status", "message"}]


def _axis(values: Sequence[Cell]) -> tuple[list[float | None], tuple[str, ...]]:
    """Return numbers to plot against, and what they stand for where the values are words."""
    if any(isinstance(v, str) for v in values):
        words_ = list(dict.fromkeys(str(v) for v in values))
        return [float(words_.index(str(v))) for v in values], tuple(words_)
    return numbers(values), ()


def _excerpts(source: ResultDocument, total: int) -> tuple[Columns, Columns, Columns]:
    """Return the first rows, the first failed rows, and rows spread over all for the plots; memory stays bounded."""
    rows = source.rows("sweep.csv")
    header = next(rows, [])
    if "status" not in header:
        raise ScenarioError(
            f"{source.directory / 'sweep.csv'} must be the table of a sweep, but has no column `status`"
        )
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


def _cases(title: str, table: Columns, units: Mapping[str, str], total: int) -> ReportTable:
    """Return rows as a table, without the columns that are empty in all of them."""
    names = [n for n in dict.fromkeys((*FIRST, *table)) if n in table and any(v is not None for v in table[n])]
    rows = zip(*(table[n] for n in names), strict=True)
    columns = tuple(TableColumn(NAMES.get(n, words(n)), units.get(n, ""), 6) for n in names)
    return ReportTable(title, columns, tuple(_row(names, row) for row in rows), total=total)


def _row(names: Sequence[str], row: Sequence[Cell]) -> tuple[Cell, ...]:
    return tuple(_whole(v) if n in {"case", "repetition"} else v for n, v in zip(names, row, strict=True))


def _whole(value: Cell) -> Cell:
    return int(value) if isinstance(value, float) and value.is_integer() else value


COVERAGE = "Intervals that hold the size: cases whose 95 % interval has the actual half-gap in it; 95 % are due."
