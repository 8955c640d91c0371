"""The pages of ``simulate`` and ``ssp``: the paired loops, or any system's signals, against time."""

from collections.abc import Mapping
from typing import Any

from orchestrator.reporting.model import Cell, Facts, Plot, Report, Section, Series, Span
from orchestrator.reporting.pages import generic
from orchestrator.reporting.pages.generic import sections_of
from orchestrator.reporting.pages.record import out_of_contact
from orchestrator.reporting.source import Source, numbers

SIGNALS_PER_PLOT = 6
Columns = Mapping[str, list[Cell]]


def build(source: Source) -> Report:
    """Return the page."""
    table = source.columns(f"{source.command}.csv")
    results = source.results
    if not table:
        return generic.build(source)
    sections, summary = _pair(results, table) if "alpha" in results else _scenario(results, table)
    return Report("Simulation", summary, tuple(sections), None, source.origin(), source.downloads())


def _pair(results: Mapping[str, Any], table: Columns) -> tuple[list[Section], str]:
    alpha, estimate = float(results["alpha"]), results.get("estimate")
    facts: list[tuple[str, Cell]] = [
        ("actual half-gap [rad]", alpha),
        ("S, sum of differences [rad]", results["S"]),
        ("crossings of the gap", results.get("crossings")),
    ]
    if estimate:
        summary = (
            f"The half-gap of {alpha:g} rad is estimated as {estimate['alpha']:.8g} rad "
            f"(interval {estimate['lower']:.8g} to {estimate['upper']:.8g} rad)."
        )
        facts += [(f"estimate: {name} [rad]", estimate[name]) for name in ("alpha", "lower", "upper")]
    else:
        summary = f"Two loops, one with a half-gap of {alpha:g} rad. No estimate: {results.get('no_estimate')}."
    time = numbers(table["time"])
    spans = out_of_contact(time, numbers(table["contact"])) if "contact" in table else ()
    gap = "Shaded: the teeth of the loop with backlash are not in contact."
    plots: list[Section] = []
    for title, label, names in (
        (
            "Load angle",
            "angle [rad]",
            {"theta_l": "with backlash", "twin_theta_l": "without", "reference": "reference"},
        ),
        ("Motor angle", "angle [rad]", {"theta_m": "with backlash", "twin_theta_m": "without"}),
        ("Requested torque", "torque [N.m]", {"u": "with backlash", "twin_u": "without"}),
        ("Shaft torque", "torque [N.m]", {"T_shaft": "with backlash", "twin_T_shaft": "without"}),
    ):
        series = tuple(Series(words, time, numbers(table[name])) for name, words in names.items() if name in table)
        if series:
            plots.append(Plot(title, "time [s]", label, series, spans, note=gap if spans else ""))
    if {"theta_l_hat", "twin_theta_l_hat"} <= set(table):
        plots.insert(1, _difference(time, table, spans))
    experiment = sections_of("Experiment", results.get("experiment") or {})
    return [Facts("Overview", tuple(facts)), *plots, *experiment], summary


def _difference(time: list[float | None], table: Columns, spans: tuple[Span, ...]) -> Plot:
    pairs = zip(numbers(table["theta_l_hat"]), numbers(table["twin_theta_l_hat"]), strict=True)
    difference = [None if a is None or b is None else a - b for a, b in pairs]
    series = Series("estimated load angles, with minus without", time, difference)
    note = "S is the sum of the absolute values of this curve."
    return Plot("Difference of the loops", "time [s]", "difference [rad]", (series,), spans, note=note)


def _scenario(results: Mapping[str, Any], table: Columns) -> tuple[list[Section], str]:
    signals: list[Mapping[str, Any]] = list(results.get("signals", []))
    time = numbers(table["time"])
    by_unit: dict[str, list[str]] = {}
    for signal in signals:
        if signal["signal"] in table:
            by_unit.setdefault(signal.get("unit") or "1", []).append(signal["signal"])
    plots: list[Section] = []
    for unit, names in by_unit.items():
        for start in range(0, len(names), SIGNALS_PER_PLOT):
            part = names[start : start + SIGNALS_PER_PLOT]
            series = tuple(Series(name, time, numbers(table[name])) for name in part)
            which = f", part {start // SIGNALS_PER_PLOT + 1}" if len(names) > SIGNALS_PER_PLOT else ""
            title = f"Signals in {unit}{which}" if unit != "1" else f"Signals without unit{which}"
            plots.append(Plot(title, "time [s]", f"value [{unit}]", series))
    summary = f"{results.get('steps')} communication steps, {len(signals)} recorded signals."
    return [*plots, *sections_of("Results", results)], summary
