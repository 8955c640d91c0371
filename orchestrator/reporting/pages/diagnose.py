"""The page of ``diagnose``: what is missing in the model, where, and how much of the gap the corrected model closes."""

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.reporting.model import Badge, Cell, Column, Plot, Report, Section, Series, Table, Text
from orchestrator.reporting.pages.generic import sections_of
from orchestrator.reporting.pages.record import record_plots
from orchestrator.reporting.source import Source, words

Json = Mapping[str, Any]
OWN = frozenset({"verdict", "effects", "parameters", "where", "gap", "model", "suspects", "warnings", "candidates"})
VERDICTS: Mapping[str, tuple[Badge, str, str]] = {
    "none": ("good", "nothing is missing", "The model explains the record to its noise."),
    "parameters": (
        "neutral",
        "other parameter values",
        "The model explains the record once its parameters are re-fitted.",
    ),
    "effects": ("neutral", "effects are missing", ""),
    "unknown": ("bad", "unexplained", "A gap is left that nothing in the library explains."),
}


def build(source: Source) -> Report:
    """Return the page."""
    results = source.results
    badge, label, sentence = VERDICTS[results["verdict"]]
    effects: list[Json] = list(results.get("effects") or [])
    gap: Json = results.get("gap") or {}
    sections: list[Section] = []
    if results.get("warnings"):
        sections.append(Text("Warnings", tuple(str(w) for w in results["warnings"])))
    if effects:
        sections.append(_effects("Missing effects", effects))
    if results.get("suspects"):
        sections.append(_effects("Suspects", list(results["suspects"])))
    sections += _gap(gap)
    sections += record_plots(source, "diagnose.csv")
    sections += _where(list(results.get("where") or []))
    sections.append(_parameters(results.get("parameters") or {}))
    sections += _candidates(list(results.get("candidates") or []))
    rest = {name: value for name, value in results.items() if name not in OWN}
    sections += sections_of("Further results", rest)
    return Report(
        title="Diagnosis",
        summary=" ".join(filter(None, [sentence, _found(effects), _closed(gap)])),
        badge=(badge, label),
        sections=tuple(sections),
        origin=(*source.origin(), *((("corrected model", results["model"]),) if results.get("model") else ())),
        downloads=source.downloads(),
    )


def _found(effects: Sequence[Json]) -> str:
    if not effects:
        return ""
    named = [f"{words(e['name'])} ({e['site']})" for e in effects]
    return f"The record shows {', '.join(named)}."


def _closed(gap: Json) -> str:
    parts = [
        f"{signal} from {g['before']:.3g} to {g['after']:.3g} {g['unit']}"
        for signal, g in gap.items()
        if g.get("before") is not None and g.get("after") is not None
    ]
    return f"On held-out data the rms gap falls: {'; '.join(parts)}." if parts else ""


def _effects(title: str, effects: Sequence[Json]) -> Table:
    columns = ("effect", "site", "parameters", "score", "runner-up", "margin", "cannot be told from")
    rows = tuple(
        (
            words(e["name"]),
            e["site"],
            "; ".join(_quantity(name, p) for name, p in e["parameters"].items()),
            e.get("score"),
            e.get("runner_up"),
            e.get("margin"),
            ", ".join(e.get("family") or ()) or None,
        )
        for e in effects
    )
    shown = [i for i in range(len(columns)) if i < 6 or any(row[i] for row in rows)]
    note = "Score: the gain in log-likelihood when the effect was added. Margin: how much less the runner-up gained."
    return Table(
        title, tuple(Column(columns[i]) for i in shown), tuple(tuple(row[i] for i in shown) for row in rows), note
    )


def _quantity(name: str, p: Json) -> str:
    if p.get("value") is None:
        return f"{name} unknown"
    error = f" ± {p['standard_error']:.2g}" if p.get("standard_error") is not None else ""
    unit = "" if p.get("unit") in (None, "1") else f" {p['unit']}"
    return f"{name} {p['value']:.5g}{error}{unit}"


def _gap(gap: Json) -> list[Section]:
    if not gap:
        return []
    columns = (Column("signal"), Column("before"), Column("after"), Column("noise"), Column("unit"))
    rows = tuple((s, g.get("before"), g.get("after"), g.get("noise"), g.get("unit")) for s, g in gap.items())
    note = "Root mean square of simulated minus measured on the part of the record that no fit has seen."
    made: list[Section] = [Table("Gap before and after", columns, rows, note)]
    stages = {s: list(g.get("stages") or []) for s, g in gap.items()}
    names = [stage["model"] for stage in next(iter(stages.values()))]
    if names:
        series = tuple(
            Series(f"{s} [{gap[s]['unit']}]", list(range(len(found))), [stage["rms"] for stage in found], "points")
            for s, found in stages.items()
        )
        title = "Gap of each model in turn"
        made.append(Plot(title, "model", "rms gap", series, log_y=True, categories=tuple(names)))
    return made


def _where(places: Sequence[Json]) -> list[Section]:
    if not places:
        return []
    names = ("signal", "regime", "from", "to", "unit", "share of the gap [%]")
    rows = tuple(
        (p["signal"], p["regime"], *_interval(p.get("interval")), p.get("unit"), 100.0 * p["share_of_gap"])
        for p in places
    )
    labels = tuple(f"{p['signal'].removeprefix('torque of the ')}: {p['regime']}" for p in places)
    share: list[float | None] = [100.0 * float(p["share_of_gap"]) for p in places]
    series = Series("share of the gap", list(range(len(places))), share, "bars")
    return [
        Table("Where model and record disagree", tuple(Column(n) for n in names), rows),
        Plot("Share of the gap", "place", "share [%]", (series,), categories=labels),
    ]


def _interval(interval: Any) -> tuple[Cell, Cell]:
    if isinstance(interval, (list, tuple)) and len(interval) == 2:
        return interval[0], interval[1]
    return interval, None


def _parameters(parameters: Json) -> Table:
    columns = ("parameter", "nominal", "value", "standard error", "change [%]", "unit")
    rows = tuple(
        (name, p.get("nominal"), p.get("value"), p.get("standard_error"), _change(p), p.get("unit"))
        for name, p in parameters.items()
    )
    return Table("Parameters", tuple(Column(c, "", 6) for c in columns), rows)


def _change(p: Json) -> float | None:
    nominal, value = p.get("nominal"), p.get("value")
    return 100.0 * (value - nominal) / nominal if nominal and value is not None else None


def _candidates(steps: Sequence[Json]) -> list[Section]:
    rows: list[tuple[Cell, ...]] = []
    for number, step in enumerate(steps, start=1):
        base = ", ".join(step.get("on_top_of") or ()) or "the model as given"
        rows += [(number, base, t.get("effect"), t.get("gain"), t.get("decided")) for t in step.get("tried") or ()]
    if not rows:
        return []
    columns = (
        Column("step"),
        Column("on top of"),
        Column("tried"),
        Column("gain in log-likelihood"),
        Column("gain on data that decide"),
    )
    return [Table("What was tried", columns, tuple(rows), limit=200)]
