"""The page of ``diagnose``: what the model lacks, how far the misfit shrinks, where, and what is left."""

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.reporting.model import (
    Badge,
    Bar,
    Bars,
    Cell,
    Facts,
    Picture,
    Report,
    ReportTable,
    Section,
    TableColumn,
    Text,
)
from orchestrator.reporting.pages import any_fmu
from orchestrator.reporting.pages.generic import sections_of
from orchestrator.reporting.pages.live import plant_section
from orchestrator.reporting.pages.predictions import SIGNALS, analysed, free_runs, horizons, torque_errors
from orchestrator.reporting.pages.record import record_plots
from orchestrator.reporting.source import ResultDocument, words
from orchestrator.reporting.trust import trust_badge, trust_section

Json = Mapping[str, Any]
PLACED = (
    "schema_version verdict effects parameters where misfit model suspects warnings candidates validation remainder"
)
SHOWN_ELSEWHERE = frozenset(
    (
        *PLACED.split(),
        "cosimulation",
        "also_seen",
        "live",
        "torque_error",
        "seconds",
        "trust",
        "told",
        "records",
        "repeats",
        "play",
        "learned_law",
        "nuisances",
        "horizons",
        "analysis",
        "settings",  # in diagnose.json; they are what was asked for, not what was found
    )
)
VERDICTS: Mapping[str, tuple[Badge, str, str]] = {
    "none": ("good", "nothing is missing", "The model explains the record to its noise."),
    "parameters": (
        "good",
        "nothing is missing; some values are off",
        "The model explains the record once its parameters are re-fitted.",
    ),
    "effects": ("neutral", "effects are missing", ""),
    "unknown": ("bad", "unexplained", "A misfit is left that nothing in the library explains."),
}
SITES = {"shaft": "in the shaft", "motor": "at the motor", "load": "at the load", "actuator": "in the actuator"}
STAGES = {"nominal": "model as given", "parameters": "with re-fitted parameters"}
MISSING = (
    "For each effect: the torque that the model misses without it, and how much of that the fitted law accounts for."
)
HELD_OUT = "Root mean square of simulated minus measured, on the part of the record that no fit has seen."


def build(source: ResultDocument) -> Report:
    """Return the page.

    Args:
        source: results of `diagnose`.

    Returns:
        The report.
    """
    results = source.results
    if results.get("kind") == "fmu":
        return any_fmu.build(source)
    badge, label, sentence = VERDICTS[results["verdict"]]
    effects: list[Json] = list(results.get("effects") or [])
    suspects: list[Json] = list(results.get("suspects") or [])
    misfit: Json = results.get("misfit") or {}
    sections: list[Section] = _in_short(results)
    sections += trust_section(results.get("trust"))
    if effects:
        sections.append(_lacking("What the model lacks", effects))
    nuisances: list[Json] = list(results.get("nuisances") or [])
    if nuisances:
        sections.append(_lacking("What the log has, and the machine has not", nuisances))
    if results.get("warnings"):
        sections.append(Text("Take note", tuple(_sentence(str(w)) for w in results["warnings"])))
    sections += [*_shrinking(misfit), *_misfit_table("Misfit before and after", misfit, HELD_OUT)]
    sections += _each_record(results)
    note = "Root mean square of simulated minus measured, over the whole of the other record."
    sections += _misfit_table("Misfit on the other record", results.get("validation") or {}, note)
    sections += free_runs(results.get("validation") or {})
    sections += horizons(list(results.get("horizons") or []), misfit)
    sections += _picture(source, "missing_torque", "Missing torque", MISSING)
    sections += _learned(source, results.get("learned_law"))
    sections += record_plots(source, "diagnose.csv", (results.get("live") or {}).get("rows") or ())
    sections += plant_section(source, "diagnose.csv", results)
    sections += _where(list(results.get("where") or []))
    sections += [_evidence("Why these effects", effects)] if effects else []
    sections += [_evidence("What came nearest, too little to be named", suspects)] if suspects else []
    sections.append(_parameters(results.get("parameters") or {}))
    sections += [*_candidates(list(results.get("candidates") or [])), *_remainder(results)]
    sections += torque_errors(results.get("torque_error") or {})
    sections += analysed(results.get("analysis") or {})
    sections += _also_seen(source, list(results.get("also_seen") or []))
    sections += sections_of("More", {n: v for n, v in results.items() if n not in SHOWN_ELSEWHERE})
    return Report(
        title="Diagnosis",
        summary=" ".join(filter(None, [sentence, _found(effects), _closed(misfit)])),
        badge=trust_badge(results.get("trust"), label, badge),
        sections=tuple(sections),
        origin=(*source.origin(), *_made(results)),
        downloads=source.downloads(),
    )


def _in_short(results: Json) -> list[Section]:
    """Return the answer in words, and how the corrected model is used."""
    lines = [str(line).strip() for line in results.get("told") or ()]
    if not lines:
        return []
    if results.get("model"):
        lines.append(
            f"The corrected model is {results['model']}: variables as in the model that was given, corrected values as "
            "start values, for any FMI 2.0 tool. corrected.toml beside it is its model file: a diagnosis with it "
            "as the model, without search, judges a new record."
        )
    return [Text("In short", tuple(lines))]


def _made(results: Json) -> list[tuple[str, Cell]]:
    names = {"model": "corrected model", "seconds": "time taken [s]"}
    return [(name, results[key]) for key, name in names.items() if results.get(key) is not None]


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] + ("" if text.endswith(".") else ".")


def _place(effect: Json) -> str:
    name = words(effect["name"]).replace("coulomb", "Coulomb").replace("stribeck", "Stribeck")
    return f"{name} {SITES.get(effect['site'], effect['site'])}"


def _found(effects: Sequence[Json]) -> str:
    named = [_place(e) for e in effects]
    listed = " and ".join(filter(None, [", ".join(named[:-1]), *named[-1:]]))
    return f"The model lacks {listed}." if named else ""


def _closed(misfit: Json) -> str:
    parts = []
    for signal, g in misfit.items():
        before, after = g.get("before"), g.get("after")
        if before is None or after is None:
            continue
        way = "falls" if after < before else "goes"
        noise = f" (noise: {g['noise']:.3g})" if g.get("noise") is not None else ""
        parts.append(f"of the {SIGNALS.get(signal, signal)} {way} from {before:.3g} to {after:.3g} {g['unit']}{noise}")
    return f"On data that no fit has seen, the rms misfit {'; that '.join(parts)}." if parts else ""


def _lacking(title: str, effects: Sequence[Json]) -> ReportTable:
    rows = tuple((_place(e), words(name), _quantity(p)) for e in effects for name, p in e["parameters"].items())
    return ReportTable(title, (TableColumn("effect"), TableColumn("quantity"), TableColumn("value")), rows)


def _quantity(p: Json) -> str:
    if p.get("value") is None:
        return "unknown"
    unit = "" if p.get("unit") in (None, "1") else f" {p['unit']}"
    low, high = p.get("interval") or (None, None)
    if low is not None and high is not None:
        return f"{p['value']:.5g}{unit} (95 %: {low:.5g} to {high:.5g})"
    error = f" ± {p['standard_error']:.2g}" if p.get("standard_error") is not None else ""
    return f"{p['value']:.5g}{error}{unit}"


def _shrinking(misfit: Json) -> list[Section]:
    """Return bars of the misfit from model to model, as multiples of the noise."""
    made: list[Section] = []
    for signal, g in misfit.items():
        stages, noise = list(g.get("stages") or []), g.get("noise")
        if not stages or not noise:
            continue
        largest = max(stage["rms"] for stage in stages)
        items = tuple(
            Bar(_stage(s["model"]), s["rms"] / largest if largest > 0.0 else 0.0, f"{s['rms'] / noise:.3g} times noise")
            for s in stages
        )
        made.append(Bars(f"Misfit of the {SIGNALS.get(signal, signal)}, from model to model", items))
    return made


def _stage(model: str) -> str:
    if not model.startswith("+ "):
        return STAGES.get(model, model)
    name, _, site = model.removeprefix("+ ").partition("@")
    return f"and {_place({'name': name, 'site': site})}".rstrip()


def _each_record(results: Json) -> list[Section]:
    """Return what each of several records says of the common model, and what repeats differ by."""
    floor = (results.get("repeats") or {}).get("floor") or {}
    rows = [
        (one["source"], signal, g["before"], g["after"], g["noise"], floor.get(signal))
        for one in results.get("records") or []
        for signal, g in one["misfit"].items()
    ]
    if not rows:
        return []
    note = "Held-out part of each record; one set of values for all, a start and a noise level for each."
    if floor:
        same = ", ".join((results.get("repeats") or {}).get("sources") or [])
        note += f" {same} had the same input: no model can do better than what they differ by."
    names = ("record", "signal", "before", "after", "encoder's noise", "repeats differ by")
    return [ReportTable("Misfit of each record", tuple(TableColumn(name) for name in names), tuple(rows), note)]


def _misfit_table(title: str, misfit: Json, note: str) -> list[Section]:
    if not misfit:
        return []
    columns = tuple(TableColumn(n) for n in ("signal", "before", "after", "noise", "unit", "times smaller"))
    rows = tuple(
        (s, *(g.get(n) for n in ("before", "after", "noise", "unit")), _quotient(g.get("before"), g.get("after")))
        for s, g in misfit.items()
    )
    return [ReportTable(title, columns, rows, note)]


def _quotient(before: float | None, after: float | None) -> float | None:
    return before / after if before is not None and after else None


def _also_seen(source: ResultDocument, terms: Sequence[Json]) -> list[Section]:
    """Return what the final model leaves that follows position or direction, and the gain at every period."""
    if not terms:
        return []
    names = ("what", "period", "size", "gain in log-likelihood", "gain at an arbitrary period", "beyond chance")
    rows = tuple(
        (
            words(t["name"]),
            None if t.get("period") is None else f"{t['period']:.4g} {t['period_unit']}",
            f"{t['size']:.3g} {t['unit']}",
            *(t.get(n) for n in ("gain", "level", "sure")),
        )
        for t in terms
    )
    note = "Too little to be named as an effect."
    made: list[Section] = [
        ReportTable("What else follows position or direction", tuple(TableColumn(n) for n in names), rows, note)
    ]
    return made + _picture(source, "ripple", "Gain of a ripple at each period", "")


def _picture(source: ResultDocument, name: str, title: str, note: str) -> list[Section]:
    path = source.directory / f"diagnose_{name}.png"
    return [Picture(title, path, note)] if path.is_file() else []


def _learned(source: ResultDocument, law: Json | None) -> list[Section]:
    """Return the law that was learned from what no effect explains: sentence, curve and knots."""
    if not law:
        return []
    title = "A law learned from what is left"
    columns = (
        TableColumn("argument", law["argument_unit"]),
        *(TableColumn(name, law["unit"]) for name in ("value", "95 % from", "to")),
    )
    rows = tuple(zip(law["knots"], law["values"], *law["band"], strict=True))
    note = (
        "Straight lines between the knots, and on beyond the last. It is no name: nothing in the library has this law."
    )
    return [
        Text(title, (_sentence(law["words"]),)),
        *_picture(source, "learned_law", "Learned law", note),
        ReportTable("Knots of the learned law", columns, rows),
    ]


def _where(places: Sequence[Json]) -> list[Section]:
    if not places:
        return []
    names = ("signal", "regime", "from", "to", "unit", "share of the misfit [%]")
    rows = tuple(
        (p["signal"], p["regime"], *_interval(p.get("interval")), p.get("unit"), 100.0 * p["share_of_misfit"])
        for p in places
    )
    return [ReportTable("Where model and record disagree", tuple(TableColumn(n) for n in names), rows)]


def _interval(interval: Any) -> tuple[Cell, Cell]:
    if isinstance(interval, (list, tuple)) and len(interval) == 2:
        return interval[0], interval[1]
    return interval, None


def _evidence(title: str, effects: Sequence[Json]) -> ReportTable:
    columns = ("effect", "gain in log-likelihood", "runner-up", "which gains less by", "cannot be told from")
    rows = []
    for e in effects:
        family = ", ".join(words(name) for name in e.get("family") or () if name != e["name"])
        rows.append((_place(e), e.get("score"), e.get("runner_up"), e.get("margin"), family or None))
    shown = [i for i in range(len(columns)) if i < 4 or any(row[i] for row in rows)]
    return ReportTable(
        title, tuple(TableColumn(columns[i]) for i in shown), tuple(tuple(row[i] for i in shown) for row in rows)
    )


def _parameters(parameters: Json) -> ReportTable:
    columns = ("parameter", "nominal", "value", "standard error", "lower", "upper", "change [%]", "unit")
    rows = tuple(
        (
            name,
            *(p.get(n) for n in ("nominal", "value", "standard_error")),
            *(p.get("interval") or (None, None)),
            _change(p),
            p.get("unit"),
        )
        for name, p in parameters.items()
    )
    note = "Lower and upper: ends of the 95 % interval."
    shown = tuple(TableColumn(c, "", 3 if c in ("standard error", "change [%]") else 6) for c in columns)
    return ReportTable("Parameters", shown, rows, note)


def _change(p: Json) -> float | None:
    nominal, value = p.get("nominal"), p.get("value")
    return 100.0 * (value - nominal) / nominal if nominal and value is not None else None


def _candidates(steps: Sequence[Json]) -> list[Section]:
    rows: list[tuple[Cell, ...]] = []
    for number, step in enumerate(steps, start=1):
        base = ", ".join(step.get("on_top_of") or ()) or "re-fitted parameters"
        rows += [(number, base, t.get("effect"), t.get("gain"), t.get("decided")) for t in step.get("tried") or ()]
    if not rows:
        return []
    columns = ("step", "on top of", "tried", "gain in log-likelihood", "gain on data that decide")
    return [ReportTable("What was tried", tuple(TableColumn(c) for c in columns), tuple(rows), limit=200)]


def _remainder(results: Json) -> list[Section]:
    """Return what the final model leaves, and of which kind it is."""
    remainder: Json = results.get("remainder") or {}
    facts: list[tuple[str, Cell]] = []
    if remainder.get("explained") is not None:
        facts.append(("explained of what re-fitted parameters leave", f"{100.0 * remainder['explained']:.3g} %"))
    if remainder.get("growth") is not None:
        facts.append(("innovations on held-out data over those on fitted data", remainder["growth"]))
    difference = (results.get("cosimulation") or {}).get("largest_difference_from_compiled")
    if difference is not None:
        unit = results["cosimulation"].get("unit", "")
        facts.append(("corrected FMU against the compiled equations", f"{difference:.2g} {unit}".strip()))
    made: list[Section] = [Facts("What is left", tuple(facts))] if facts else []
    follows = list(remainder.get("predictable") or [])
    if follows:
        columns = (
            TableColumn("site"),
            TableColumn("follows"),
            TableColumn("gain in log-likelihood"),
            TableColumn("share of the rest [%]"),
        )
        rows = tuple((p["site"], p["kind"], p["gain"], 100.0 * p["share"]) for p in follows)
        made.append(ReportTable("What the rest follows", columns, rows))
    return made
