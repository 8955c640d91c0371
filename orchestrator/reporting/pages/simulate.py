"""The pages of ``simulate`` and ``ssp``: the paired loops, or any system's signals, against time."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from orchestrator.reporting.model import Facts, Plot, Report, Section, Series, Span
from orchestrator.reporting.pages import generic
from orchestrator.reporting.pages.generic import sections_of
from orchestrator.reporting.pages.record import out_of_contact
from orchestrator.reporting.source import ResultDocument
from orchestrator.shared.arrays import Array
from orchestrator.shared.results import PairFound, SignalsFound, as_plain, read
from orchestrator.shared.results.fields import Cell

SIGNALS_PER_PLOT = 6
Columns = Mapping[str, Array]


def build(source: ResultDocument) -> Report:
    """Return the page."""
    table = source.signals(f"{source.command}.csv")
    results = source.results
    file = Path(str(source.arguments.get("file") or results.get("file") or "")).name
    if not table:
        return generic.build(source)
    if "alpha" in results:
        sections, summary = _pair(source, read(results, PairFound), table)
    else:
        sections, summary = _scenario(read(results, SignalsFound), table)
    title = "Simulation"
    if source.command == "ssp":
        title, summary = f"SSP file {file}", f"{_what_ran(file, read(results, SignalsFound), table)} {summary}"
    return Report(title, summary, tuple(sections))


def _what_ran(file: str, results: SignalsFound, table: Columns) -> str:
    """Return which components of a file ran, for how long and in which steps."""
    components = dict.fromkeys(s.signal.split(".")[0] for s in results.signals if "." in s.signal)
    end = float(np.nanmax(table["time"], initial=0.0))
    step = f" of {end / results.steps:.6g} s" if results.steps else ""
    named = f", with signals of {', '.join(components)}" if components else ""
    return f"The system in {file} was run from 0 to {end:g} s in steps{step}{named}."


def _pair(source: ResultDocument, results: PairFound, table: Columns) -> tuple[list[Section], str]:
    alpha, estimate = results.alpha, results.estimate
    facts: list[tuple[str, Cell]] = [
        ("actual half-gap [rad]", alpha),
        ("S, sum of differences [rad]", results.S),
        ("crossings of the gap", results.crossings),
    ]
    if estimate:
        summary = (
            f"The half-gap of {alpha:g} rad is estimated as {_digits(estimate.alpha)} rad "
            f"(interval {_digits(estimate.lower)} to {_digits(estimate.upper)} rad)."
        )
    else:
        summary = f"Two loops, one with a half-gap of {alpha:g} rad. No estimate: {results.no_estimate}."
    time = table["time"]
    spans = out_of_contact(time, table["contact"]) if "contact" in table else ()
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
        series = tuple(Series(words, time, table[name]) for name, words in names.items() if name in table)
        if series:
            plots.append(Plot(title, "time [s]", label, series, spans, note=gap if spans else ""))
    if {"theta_l_hat", "twin_theta_l_hat"} <= set(table):
        plots.insert(1, _difference(time, table, spans))
    experiment = sections_of("Experiment", results.experiment)
    return [Facts("Overview", tuple(facts)), *plots, *experiment], summary


def _difference(time: Array, table: Columns, spans: tuple[Span, ...]) -> Plot:
    difference = table["theta_l_hat"] - table["twin_theta_l_hat"]
    series = Series("estimated load angle: with backlash minus without", time, difference)
    note = "S is the sum of the absolute values of this curve."
    return Plot("Difference of the loops", "time [s]", "difference [rad]", (series,), spans, note=note)


def _scenario(results: SignalsFound, table: Columns) -> tuple[list[Section], str]:
    time = table["time"]
    by_unit: dict[str, list[str]] = {}
    for signal in results.signals:
        if signal.signal in table:
            by_unit.setdefault(signal.unit or "1", []).append(signal.signal)
    plots: list[Section] = []
    for unit, names in by_unit.items():
        for start in range(0, len(names), SIGNALS_PER_PLOT):
            part = names[start : start + SIGNALS_PER_PLOT]
            series = tuple(Series(name, time, table[name]) for name in part)
            which = f", part {start // SIGNALS_PER_PLOT + 1}" if len(names) > SIGNALS_PER_PLOT else ""
            title = f"Signals in {unit}{which}" if unit != "1" else f"Signals without unit{which}"
            plots.append(Plot(title, "time [s]", f"value [{unit}]", series))
    summary = f"{results.steps} communication steps, {len(results.signals)} recorded signals."
    shown = {name: value for name, value in as_plain(results).items() if name != "schema_version" and value != {}}
    return [*plots, *sections_of("Results", shown)], summary


def _digits(value: float | None) -> str:
    return "unbounded" if value is None else f"{value:.8g}"
