"""The page of a diagnosis of any FMU: what is missing around it, how far the misfit shrinks, what is left."""

from collections.abc import Mapping

import msgspec

from orchestrator.reporting.model import Badge, Cell, Facts, Plot, Report, Section, Series, Span, Text
from orchestrator.reporting.pages.generic import sections_of
from orchestrator.reporting.source import ResultDocument, table_of, words
from orchestrator.reporting.trust import trust_badge, trust_section
from orchestrator.shared.results import read
from orchestrator.shared.results.any_fmu import DeliveredFound, FmuDiagnosisFound, FmuRemainingFound
from orchestrator.shared.results.diagnose import EffectFound

VERDICTS: Mapping[str, tuple[Badge, str]] = {
    "none": ("good", "nothing is missing"),
    "parameters": ("good", "some values are off"),
    "effects": ("neutral", "effects are missing"),
    "unknown": ("bad", "unexplained"),
}
STAGES = {"nominal": "model as given", "refitted": "with re-fitted parameters", "corrected": "with the effects"}
KNOWN = frozenset(FmuDiagnosisFound.__struct_fields__)


def build(source: ResultDocument) -> Report:
    """Return the page."""
    found = read(source.results, FmuDiagnosisFound)
    badge, label = VERDICTS.get(found.verdict, ("neutral", found.verdict))
    sentence = found.summary[0].partition(". ")[2] if found.summary else f"{label[:1].upper()}{label[1:]}."
    made = (("walls", found.walls), ("runs of the FMU", found.runs), ("time taken [s]", found.seconds))
    return Report(
        title="Diagnosis of an FMU",
        summary=sentence,
        badge=trust_badge(found.trust, label, badge),
        sections=(
            *trust_section(found.trust),
            *_effect_sections(found),
            *_misfit(found, source),
            *_search_sections(found),
            *sections_of("More", {k: v for k, v in source.results.items() if k not in KNOWN}),
        ),
        origin=source.origin(*made),
        downloads=source.downloads(),
    )


def _effect_sections(results: FmuDiagnosisFound) -> list[Section]:
    """Return the effects, and what is said in sentences."""
    sections: list[Section] = []
    if results.effects:
        sections.append(table_of("What is missing", [row for effect in results.effects for row in _rows(effect)]))
    reasons = () if results.trust is None else results.trust.reasons
    for title, texts in (("In words", results.summary[1:]), ("Take note", results.notes)):
        lines = tuple(text for text in texts if text not in reasons)
        if lines:
            sections.append(Text(title, lines))
    return sections


def _rows(effect: EffectFound) -> list[dict[str, object]]:
    return [
        {
            "effect": words(effect.name),
            "at": effect.site,
            "grade": effect.grade,
            "parameter": name,
            "value": value.value,
            "95 % interval": "" if value.interval is None else "{:.6g} to {:.6g}".format(*value.interval),
            "unit": value.unit,
            "not told from": ", ".join(effect.family),
        }
        for name, value in effect.parameters.items()
    ]


def _misfit(results: FmuDiagnosisFound, source: ResultDocument) -> list[Section]:
    """Return the misfit as a table, and the outputs over the first record."""
    rows = [
        {"record": test.source, "output": name, **msgspec.structs.asdict(values)}
        for test in (*results.test, *([results.validation] if results.validation else []))
        for name, values in test.misfit.items()
    ]
    sections: list[Section] = [table_of("Misfit of runs on data that nothing was fitted to", rows)] if rows else []
    return [*sections, *_output_plots(results, source)]


def _output_plots(results: FmuDiagnosisFound, source: ResultDocument) -> list[Section]:
    """Return each output, measured and simulated, and what each simulation misses of it; shaded: test data."""
    table = source.signals("diagnose.csv")
    units = {name: misfit.unit for test in results.test for name, misfit in test.misfit.items()}
    made: list[Section] = []
    for name in (n for n in units if n in table and "time" in table):
        time, unit = table["time"], units[name]
        test = () if results.test_start is None else (Span(results.test_start, float(time[-1]), "test data"),)
        runs = {word: table[f"{name}_{stage}"] for stage, word in STAGES.items() if f"{name}_{stage}" in table}
        left = tuple(Series(word, time, run - table[name]) for word, run in runs.items())
        both = (Series("measured", time, table[name]), *(Series(word, time, run) for word, run in runs.items()))
        made.append(Plot(f"{name}: simulated minus measured", "time [s]", f"difference [{unit}]", left, test))
        made.append(Plot(name, "time [s]", f"{name} [{unit}]", both, test))
    return made


def _search_sections(results: FmuDiagnosisFound) -> list[Section]:
    """Return parameters, candidates, what is left, and the corrected system."""
    sections: list[Section] = []
    parameters = [{"parameter": name, **msgspec.structs.asdict(p)} for name, p in results.parameters.items()]
    if parameters:
        sections.append(table_of("Parameters", parameters))
    tried = [
        {
            "on top of": ", ".join(step.on_top_of) or "parameters",
            "effect": c.effect,
            "gain": c.gain,
            "over its error": c.t,
        }
        for step in results.candidates
        for c in step.tried[:5]
    ]
    if tried:
        sections.append(table_of("Candidates", tried))
    return [*sections, *_residual_sections(results.remaining), *_delivery_sections(results.delivery)]


def _residual_sections(remaining: FmuRemainingFound) -> list[Section]:
    """Return what the final model leaves of each output, and what that follows."""
    facts: list[tuple[str, Cell]] = [
        (f"share of the power of {name} [%]", None if share is None else 100.0 * share)
        for name, share in remaining.outputs.items()
    ]
    facts += [
        (f"follows the {one.argument} [%]", None if one.share is None else 100.0 * one.share)
        for one in remaining.follows
    ]
    return [Facts("What is left", tuple(facts))] if facts else []


def _delivery_sections(files: tuple[DeliveredFound, ...]) -> list[Section]:
    """Return the corrected system, or why there is none."""
    rows = [
        {
            "file": one.file,
            "effects": ", ".join(part.effect for part in one.parts),
            "differs from the fit by [noise]": one.difference_over_noise,
            "note": one.note,
        }
        for one in files
    ]
    return [table_of("Corrected system", rows)] if rows else []
