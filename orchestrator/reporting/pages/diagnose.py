"""The page of ``diagnose``: what the model lacks, how far the gap shrinks, where, and what is left."""

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.reporting.model import (
    Badge,
    Bar,
    Bars,
    Cell,
    Column,
    Facts,
    Picture,
    Report,
    Section,
    Table,
    Text,
)
from orchestrator.reporting.pages.generic import sections_of
from orchestrator.reporting.pages.record import record_plots
from orchestrator.reporting.source import Source, words

Json = Mapping[str, Any]
PLACED = "verdict effects parameters where gap model suspects warnings candidates validation remainder"
SHOWN_ELSEWHERE = frozenset((*PLACED.split(), "cosimulation", "also_seen", "torque_error", "seconds"))
VERDICTS: Mapping[str, tuple[Badge, str, str]] = {
    "none": ("good", "nothing is missing", "The model explains the record to its noise."),
    "parameters": (
        "good",
        "nothing is missing; some values are off",
        "The model explains the record once its parameters are re-fitted.",
    ),
    "effects": ("neutral", "effects are missing", ""),
    "unknown": ("bad", "unexplained", "A gap is left that nothing in the library explains."),
}
SITES = {"shaft": "in the shaft", "motor": "at the motor", "load": "at the load", "actuator": "in the actuator"}
SIGNALS = {"theta_m": "motor angle", "theta_l": "load angle"}
STAGES = {"nominal": "model as given", "parameters": "with re-fitted parameters"}
COMPARED = {"before": "as given", "parameters": "re-fitted", "after": "with effects"}
MISSING = "For each effect: the torque that the model misses without it, and the law that was fitted."
HELD_OUT = "Root mean square of simulated minus measured, on the part of the record that no fit has seen."


def build(source: Source) -> Report:
    """Return the page."""
    results = source.results
    badge, label, sentence = VERDICTS[results["verdict"]]
    effects: list[Json] = list(results.get("effects") or [])
    suspects: list[Json] = list(results.get("suspects") or [])
    gap: Json = results.get("gap") or {}
    sections: list[Section] = []
    if effects:
        sections.append(_lacking(effects))
    if results.get("warnings"):
        sections.append(Text("Take note", tuple(_sentence(str(w)) for w in results["warnings"])))
    sections += [*_shrinking(gap), *_gap_table("Gap before and after", gap, HELD_OUT)]
    note = "Root mean square of simulated minus measured, over the whole of the other record."
    sections += _gap_table("Gap on the other record", results.get("validation") or {}, note)
    sections += _free_runs(results.get("validation") or {})
    sections += _picture(source, "missing_torque", "Missing torque", MISSING)
    sections += record_plots(source, "diagnose.csv")
    sections += _where(list(results.get("where") or []))
    sections += [_evidence("Why these effects", effects)] if effects else []
    sections += [_evidence("What came nearest, too little to be named", suspects)] if suspects else []
    sections.append(_parameters(results.get("parameters") or {}))
    sections += [*_candidates(list(results.get("candidates") or [])), *_remainder(results)]
    sections += _torque_errors(results.get("torque_error") or {})
    sections += _also_seen(source, list(results.get("also_seen") or []))
    sections += sections_of("More", {n: v for n, v in results.items() if n not in SHOWN_ELSEWHERE})
    return Report(
        title="Diagnosis",
        summary=" ".join(filter(None, [sentence, _found(effects), _closed(gap)])),
        badge=(badge, label),
        sections=tuple(sections),
        origin=(*source.origin(), *_made(results)),
        downloads=source.downloads(),
    )


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


def _closed(gap: Json) -> str:
    parts = []
    for signal, g in gap.items():
        before, after = g.get("before"), g.get("after")
        if before is None or after is None:
            continue
        way = "falls" if after < before else "goes"
        noise = f" (noise: {g['noise']:.3g})" if g.get("noise") is not None else ""
        parts.append(f"of the {SIGNALS.get(signal, signal)} {way} from {before:.3g} to {after:.3g} {g['unit']}{noise}")
    return f"On data that no fit has seen, the rms gap {'; that '.join(parts)}." if parts else ""


def _lacking(effects: Sequence[Json]) -> Table:
    rows = tuple((_place(e), words(name), _quantity(p)) for e in effects for name, p in e["parameters"].items())
    return Table("What the model lacks", (Column("effect"), Column("quantity"), Column("value")), rows)


def _quantity(p: Json) -> str:
    if p.get("value") is None:
        return "unknown"
    unit = "" if p.get("unit") in (None, "1") else f" {p['unit']}"
    low, high = p.get("interval") or (None, None)
    if low is not None and high is not None:
        return f"{p['value']:.5g}{unit} (95 %: {low:.5g} to {high:.5g})"
    error = f" ± {p['standard_error']:.2g}" if p.get("standard_error") is not None else ""
    return f"{p['value']:.5g}{error}{unit}"


def _shrinking(gap: Json) -> list[Section]:
    """Return bars of the gap from model to model, as multiples of the noise."""
    made: list[Section] = []
    for signal, g in gap.items():
        stages, noise = list(g.get("stages") or []), g.get("noise")
        if not stages or not noise:
            continue
        largest = max(stage["rms"] for stage in stages)
        items = tuple(
            Bar(_stage(s["model"]), s["rms"] / largest if largest > 0.0 else 0.0, f"{s['rms'] / noise:.3g} times noise")
            for s in stages
        )
        made.append(Bars(f"Gap of the {SIGNALS.get(signal, signal)}, from model to model", items))
    return made


def _stage(model: str) -> str:
    if not model.startswith("+ "):
        return STAGES.get(model, model)
    name, _, site = model.removeprefix("+ ").partition("@")
    return f"and {_place({'name': name, 'site': site})}".rstrip()


def _gap_table(title: str, gap: Json, note: str) -> list[Section]:
    if not gap:
        return []
    columns = tuple(Column(n) for n in ("signal", "before", "after", "noise", "unit", "times smaller"))
    rows = tuple(
        (s, *(g.get(n) for n in ("before", "after", "noise", "unit")), _quotient(g.get("before"), g.get("after")))
        for s, g in gap.items()
    )
    return [Table(title, columns, rows, note)]


def _quotient(before: float | None, after: float | None) -> float | None:
    return before / after if before is not None and after else None


def _free_runs(validation: Json) -> list[Section]:
    """Return how much of the other record one free run over all of it explains."""
    rows = tuple(
        (SIGNALS.get(signal, signal), *(g["r_squared"].get(n) for n in COMPARED))
        for signal, g in validation.items()
        if g.get("r_squared")
    )
    columns = tuple(Column(n, "", 6) for n in ("signal", *COMPARED.values()))
    return [Table("R² of one free run over all of the other record", columns, rows)] if rows else []


def _torque_errors(errors: Json) -> list[Section]:
    """Return the relative error of the torque that the inverse model computes from the motion."""
    rows = tuple((words(record), *(_percent(e.get(n)) for n in COMPARED)) for record, e in errors.items())
    columns = tuple(Column(n) for n in ("on", *(f"{name} [%]" for name in COMPARED.values())))
    return [Table("Relative torque error of the inverse model", columns, rows)] if rows else []


def _percent(share: float | None) -> float | None:
    return None if share is None else 100.0 * share


def _also_seen(source: Source, terms: Sequence[Json]) -> list[Section]:
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
        Table("What else follows position or direction", tuple(Column(n) for n in names), rows, note)
    ]
    return made + _picture(source, "ripple", "Gain of a ripple at each period", "")


def _picture(source: Source, name: str, title: str, note: str) -> list[Section]:
    path = source.directory / f"diagnose_{name}.png"
    return [Picture(title, path, note)] if path.is_file() else []


def _where(places: Sequence[Json]) -> list[Section]:
    if not places:
        return []
    names = ("signal", "regime", "from", "to", "unit", "share of the gap [%]")
    rows = tuple(
        (p["signal"], p["regime"], *_interval(p.get("interval")), p.get("unit"), 100.0 * p["share_of_gap"])
        for p in places
    )
    return [Table("Where model and record disagree", tuple(Column(n) for n in names), rows)]


def _interval(interval: Any) -> tuple[Cell, Cell]:
    if isinstance(interval, (list, tuple)) and len(interval) == 2:
        return interval[0], interval[1]
    return interval, None


def _evidence(title: str, effects: Sequence[Json]) -> Table:
    columns = ("effect", "gain in log-likelihood", "runner-up", "which gains less by", "cannot be told from")
    rows = []
    for e in effects:
        family = ", ".join(words(name) for name in e.get("family") or () if name != e["name"])
        rows.append((_place(e), e.get("score"), e.get("runner_up"), e.get("margin"), family or None))
    shown = [i for i in range(len(columns)) if i < 4 or any(row[i] for row in rows)]
    return Table(title, tuple(Column(columns[i]) for i in shown), tuple(tuple(row[i] for i in shown) for row in rows))


def _parameters(parameters: Json) -> Table:
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
    shown = tuple(Column(c, "", 3 if c in ("standard error", "change [%]") else 6) for c in columns)
    return Table("Parameters", shown, rows, note)


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
    return [Table("What was tried", tuple(Column(c) for c in columns), tuple(rows), limit=200)]


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
        columns = (Column("site"), Column("follows"), Column("gain in log-likelihood"), Column("share of the rest [%]"))
        rows = tuple((p["site"], p["kind"], p["gain"], 100.0 * p["share"]) for p in follows)
        made.append(Table("What the rest follows", columns, rows))
    return made
