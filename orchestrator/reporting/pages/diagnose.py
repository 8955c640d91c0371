"""The page of ``diagnose``: what the model lacks, how far the misfit shrinks, where, and what is left."""

from collections.abc import Mapping, Sequence

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
from orchestrator.shared.results import read
from orchestrator.shared.results.diagnose import (
    DiagnoseFound,
    EffectFound,
    FloorFound,
    LearnedFound,
    MisfitFound,
    ParameterFound,
    PlaceFound,
    StepFound,
    TermFound,
    ValidatedFound,
    ValueFound,
)

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
    if source.results.get("kind") == "fmu":
        return any_fmu.build(source)
    results = read(source.results, DiagnoseFound)
    badge, label, sentence = VERDICTS[results.verdict]
    effects, misfit = results.effects, results.misfit
    sections: list[Section] = _in_short(results)
    sections += trust_section(results.trust)
    if effects:
        sections.append(_lacking("What the model lacks", effects))
    if results.nuisances:
        sections.append(_lacking("What the log has, and the machine has not", results.nuisances))
    if results.warnings:
        sections.append(Text("Take note", tuple(_sentence(w) for w in results.warnings)))
    sections += [*_shrinking(misfit), *_misfit_table("Misfit before and after", misfit, HELD_OUT)]
    sections += _each_record(results)
    note = "Root mean square of simulated minus measured, over the whole of the other record."
    sections += _misfit_table("Misfit on the other record", results.validation or {}, note)
    sections += free_runs(results.validation or {})
    sections += horizons(results.horizons, misfit)
    sections += _picture(source, "missing_torque", "Missing torque", MISSING)
    sections += _learned(source, results.learned_law)
    sections += record_plots(source, "diagnose.csv", results.live.rows if results.live else ())
    sections += plant_section(source, "diagnose.csv", results.live)
    sections += _where(results.where)
    sections += [_evidence("Why these effects", effects)] if effects else []
    sections += [_evidence("What came nearest, too little to be named", results.suspects)] if results.suspects else []
    sections.append(_parameters(results.parameters))
    sections += [*_candidates(results.candidates), *_remainder(results)]
    sections += torque_errors(results.torque_error or {})
    sections += analysed(results.analysis)
    sections += _also_seen(source, results.also_seen)
    sections += sections_of("More", {n: v for n, v in source.results.items() if n not in SHOWN_ELSEWHERE})
    return Report(
        title="Diagnosis",
        summary=" ".join(filter(None, [sentence, _found(effects), _closed(misfit)])),
        badge=trust_badge(results.trust, label, badge),
        sections=tuple(sections),
        origin=source.origin(("corrected model", results.model), ("time taken [s]", results.seconds)),
        downloads=source.downloads(),
    )


def _in_short(results: DiagnoseFound) -> list[Section]:
    """Return the answer in words, and how the corrected model is used."""
    lines = [line.strip() for line in results.told]
    if not lines:
        return []
    if results.model:
        lines.append(
            f"The corrected model is {results.model}: variables as in the model that was given, corrected values as "
            "start values, for any FMI 2.0 tool. corrected.toml beside it is its model file: a diagnosis with it "
            "as the model, without search, judges a new record."
        )
    return [Text("In short", tuple(lines))]


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] + ("" if text.endswith(".") else ".")


def _place(name: str, site: str) -> str:
    name = words(name).replace("coulomb", "Coulomb").replace("stribeck", "Stribeck")
    return f"{name} {SITES.get(site, site)}"


def _found(effects: Sequence[EffectFound]) -> str:
    named = [_place(e.name, e.site) for e in effects]
    listed = " and ".join(filter(None, [", ".join(named[:-1]), *named[-1:]]))
    return f"The model lacks {listed}." if named else ""


def _closed(misfit: Mapping[str, MisfitFound]) -> str:
    parts = []
    for signal, g in misfit.items():
        before, after = g.before, g.after
        if before is None or after is None:
            continue
        way = "falls" if after < before else "goes"
        noise = f" (noise: {g.noise:.3g})" if g.noise is not None else ""
        parts.append(f"of the {SIGNALS.get(signal, signal)} {way} from {before:.3g} to {after:.3g} {g.unit}{noise}")
    return f"On data that no fit has seen, the rms misfit {'; that '.join(parts)}." if parts else ""


def _lacking(title: str, effects: Sequence[EffectFound]) -> ReportTable:
    rows = tuple(
        (_place(e.name, e.site), words(name), _quantity(p)) for e in effects for name, p in e.parameters.items()
    )
    return ReportTable(title, (TableColumn("effect"), TableColumn("quantity"), TableColumn("value")), rows)


def _quantity(p: ValueFound) -> str:
    if p.value is None:
        return "unknown"
    unit = "" if p.unit in (None, "1") else f" {p.unit}"
    low, high = p.interval or (None, None)
    if low is not None and high is not None:
        return f"{p.value:.5g}{unit} (95 %: {low:.5g} to {high:.5g})"
    error = f" ± {p.standard_error:.2g}" if p.standard_error is not None else ""
    return f"{p.value:.5g}{error}{unit}"


def _shrinking(misfit: Mapping[str, MisfitFound]) -> list[Section]:
    """Return bars of the misfit from model to model, as multiples of the noise."""
    made: list[Section] = []
    for signal, g in misfit.items():
        stages = [(_stage(stage.model), stage.rms) for stage in g.stages if stage.rms is not None]
        if not stages or not g.noise:
            continue
        largest = max(rms for _, rms in stages)
        items = tuple(
            Bar(name, rms / largest if largest > 0.0 else 0.0, f"{rms / g.noise:.3g} times noise")
            for name, rms in stages
        )
        made.append(Bars(f"Misfit of the {SIGNALS.get(signal, signal)}, from model to model", items))
    return made


def _stage(model: str) -> str:
    if not model.startswith("+ "):
        return STAGES.get(model, model)
    name, _, site = model.removeprefix("+ ").partition("@")
    return f"and {_place(name, site)}".rstrip()


def _each_record(results: DiagnoseFound) -> list[Section]:
    """Return what each of several records says of the common model, and what repeats differ by."""
    repeats = results.repeats or FloorFound((), {})
    rows = [
        (one.source, signal, g.before, g.after, g.noise, repeats.floor.get(signal))
        for one in results.records
        for signal, g in one.misfit.items()
    ]
    if not rows:
        return []
    note = "Held-out part of each record; one set of values for all, a start and a noise level for each."
    if repeats.floor:
        note += f" {', '.join(repeats.sources)} had the same input: no model can do better than what they differ by."
    names = ("record", "signal", "before", "after", "encoder's noise", "repeats differ by")
    return [ReportTable("Misfit of each record", tuple(TableColumn(name) for name in names), tuple(rows), note)]


def _misfit_table(title: str, misfit: Mapping[str, MisfitFound | ValidatedFound], note: str) -> list[Section]:
    if not misfit:
        return []
    columns = tuple(TableColumn(n) for n in ("signal", "before", "after", "noise", "unit", "times smaller"))
    rows = tuple((s, g.before, g.after, g.noise, g.unit, _quotient(g.before, g.after)) for s, g in misfit.items())
    return [ReportTable(title, columns, rows, note)]


def _quotient(before: float | None, after: float | None) -> float | None:
    return before / after if before is not None and after else None


def _also_seen(source: ResultDocument, terms: Sequence[TermFound]) -> list[Section]:
    """Return what the final model leaves that follows position or direction, and the gain at every period."""
    if not terms:
        return []
    names = ("what", "period", "size", "gain in log-likelihood", "gain at an arbitrary period", "beyond chance")
    rows = tuple(
        (
            words(t.name),
            None if t.period is None else f"{t.period:.4g} {t.period_unit}",
            f"{t.size:.3g} {t.unit}",
            *(t.gain, t.level, t.sure),
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


def _learned(source: ResultDocument, law: LearnedFound | None) -> list[Section]:
    """Return the law that was learned from what no effect explains: sentence, curve and knots."""
    if law is None:
        return []
    title = "A law learned from what is left"
    columns = (
        TableColumn("argument", law.argument_unit),
        *(TableColumn(name, law.unit) for name in ("value", "95 % from", "to")),
    )
    rows = tuple(zip(law.knots, law.values, *law.band, strict=True))
    note = (
        "Straight lines between the knots, and on beyond the last. It is no name: nothing in the library has this law."
    )
    return [
        Text(title, (_sentence(law.words), *_in_the_fmu(law))),
        *_picture(source, "learned_law", "Learned law", note),
        ReportTable("Knots of the learned law", columns, rows),
    ]


def _in_the_fmu(law: LearnedFound) -> tuple[str, ...]:
    """Return in a sentence how the corrected FMU has the law; none where it has not."""
    if (fmu := law.exported) is None:
        return ()
    missed = ", ".join(f"{name} by {rms:.4g} {fmu.unit}" for name, rms in fmu.misfit.items() if rms is not None)
    return (f"The corrected FMU has it, off until its parameter {fmu.parameter} is 1; then it misses {missed}.",)


def _where(places: Sequence[PlaceFound]) -> list[Section]:
    if not places:
        return []
    names = ("signal", "regime", "from", "to", "unit", "share of the misfit [%]")
    rows = tuple((p.signal, p.regime, *p.interval, p.unit, 100.0 * p.share_of_misfit) for p in places)
    return [ReportTable("Where model and record disagree", tuple(TableColumn(n) for n in names), rows)]


def _evidence(title: str, effects: Sequence[EffectFound]) -> ReportTable:
    columns = ("effect", "gain in log-likelihood", "runner-up", "which gains less by", "cannot be told from")
    rows = []
    for e in effects:
        family = ", ".join(words(name) for name in e.family if name != e.name)
        rows.append((_place(e.name, e.site), e.score, e.runner_up, e.margin, family or None))
    shown = [i for i in range(len(columns)) if i < 4 or any(row[i] for row in rows)]
    return ReportTable(
        title, tuple(TableColumn(columns[i]) for i in shown), tuple(tuple(row[i] for i in shown) for row in rows)
    )


def _parameters(parameters: Mapping[str, ParameterFound]) -> ReportTable:
    columns = ("parameter", "nominal", "value", "standard error", "lower", "upper", "change [%]", "unit")
    rows = tuple(
        (name, p.nominal, p.value, p.standard_error, *(p.interval or (None, None)), _change(p), p.unit)
        for name, p in parameters.items()
    )
    note = "Lower and upper: ends of the 95 % interval."
    shown = tuple(TableColumn(c, "", 3 if c in ("standard error", "change [%]") else 6) for c in columns)
    return ReportTable("Parameters", shown, rows, note)


def _change(p: ParameterFound) -> float | None:
    return 100.0 * (p.value - p.nominal) / p.nominal if p.nominal and p.value is not None else None


def _candidates(steps: Sequence[StepFound]) -> list[Section]:
    rows: list[tuple[Cell, ...]] = []
    for number, step in enumerate(steps, start=1):
        base = ", ".join(step.on_top_of) or "re-fitted parameters"
        rows += [(number, base, t.effect, t.gain, t.decided) for t in step.tried]
    if not rows:
        return []
    columns = ("step", "on top of", "tried", "gain in log-likelihood", "gain on data that decide")
    return [ReportTable("What was tried", tuple(TableColumn(c) for c in columns), tuple(rows), limit=200)]


def _remainder(results: DiagnoseFound) -> list[Section]:
    """Return what the final model leaves, and of which kind it is."""
    remainder, built = results.remainder, results.cosimulation
    facts: list[tuple[str, Cell]] = []
    if remainder.explained is not None:
        facts.append(("explained of what re-fitted parameters leave", f"{100.0 * remainder.explained:.3g} %"))
    if remainder.growth is not None:
        facts.append(("innovations on held-out data over those on fitted data", remainder.growth))
    if built.largest_difference_from_compiled is not None:
        difference = f"{built.largest_difference_from_compiled:.2g} {built.unit}".strip()
        facts.append(("corrected FMU against the compiled equations", difference))
    made: list[Section] = [Facts("What is left", tuple(facts))] if facts else []
    if remainder.predictable:
        columns = (
            TableColumn("site"),
            TableColumn("follows"),
            TableColumn("gain in log-likelihood"),
            TableColumn("share of the rest [%]"),
        )
        rows = tuple((p.site, p.kind, p.gain, 100.0 * p.share) for p in remainder.predictable)
        made.append(ReportTable("What the rest follows", columns, rows))
    return made
