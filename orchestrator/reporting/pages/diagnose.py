"""The page of ``diagnose``: what the model lacks and how sure, how far the misfit shrinks on test data, what is
left.
"""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from orchestrator.effects.words import place_words
from orchestrator.reporting.model import Facts, Plot, Report, Section, Series, Text
from orchestrator.reporting.pages import any_fmu
from orchestrator.reporting.pages.diagnosis_answer import (
    SIGNALS,
    answer_table,
    headline,
    in_words,
    next_steps,
    worth_on_test_data,
)
from orchestrator.reporting.pages.diagnosis_tables import (
    VERDICTS,
    candidate_table,
    evidence_table,
    parameter_table,
)
from orchestrator.reporting.pages.generic import folds_of
from orchestrator.reporting.pages.meanings import with_meanings
from orchestrator.reporting.pages.record import signal_plots
from orchestrator.reporting.source import ResultDocument
from orchestrator.reporting.trust import trust_badge, trust_section
from orchestrator.shared.results import read
from orchestrator.shared.results.diagnose import (
    DiagnoseFound,
    EffectFound,
    LearnedFound,
    RemainingFound,
    misfit_tables,
    torque_tables,
)
from orchestrator.shared.results.fields import fields_table

MISSING = "The torque that the model misses without the effect, and how much of that its law accounts for."


def build(source: ResultDocument) -> Report:
    """Return the page."""
    if source.results.get("kind") == "fmu":
        return any_fmu.build(source)
    results = read(source.results, DiagnoseFound)
    badge, label = VERDICTS[results.verdict]
    table, live = source.signals("diagnose.csv"), results.live
    restarts = live.rows if live else ()
    sections: list[Section] = [
        *answer_table(results.effects, results.test, results.nuisances),
        *trust_section(results.trust),
        *worth_on_test_data(results.test, table, ("before", "after"), restarts),
        *next_steps(results.summary, _on_the_corrected_model(results)),
    ]
    notes = tuple(_sentence(note) for note in results.notes)
    metric = any(signal.unit == "m" for test in results.test for signal in test.misfit.values())
    folds: dict[str, list[Section]] = {
        "Take note": [Text("Notes", notes)] if notes else [],
        "In words": in_words(results.summary),
        "Evidence for each effect": [
            *evidence_table(results.effects),
            *_missing_plots(results.effects),
        ],
        "Test data": [*_tests(results), *signal_plots(table, restarts, metric)],
        "What remains unexplained": [*_residual_sections(results.remaining), *_law_sections(results.learned_law)],
        "Values, search and analysis": [
            with_meanings(parameter_table(results.parameters), live),
            *candidate_table(results.candidates),
            *_analysis(results),
        ],
    }
    sections += folds_of(folds)
    return Report(
        title="Diagnosis",
        summary=headline(results.summary),
        badge=trust_badge(results.trust, label, badge),
        sections=tuple(sections),
        origin=(("corrected model", results.model), ("time taken [s]", results.seconds)),
        angle_unit=results.angle_unit,
    )


def _on_the_corrected_model(results: DiagnoseFound) -> str:
    """Return how the corrected model is used; empty where there is none."""
    if not results.model:
        return ""
    name = Path(results.model).name
    if results.trust is not None and results.trust.level == "red":
        return f"The corrected model, {name}, must not be used."
    return (
        f"The corrected model is {name}: for any FMI 2.0 tool, variables as in the given model, "
        "corrected values as start values. Its model file is corrected.toml: a diagnosis with this file and "
        "without a search judges a new record."
    )


def _tests(results: DiagnoseFound) -> list[Section]:
    """Return how the models do on test data and on another record."""
    tests = [*results.test, *([results.validation] if results.validation else [])]
    return [*misfit_tables(results.test, results.validation, SIGNALS), *torque_tables(tests)]


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] + ("" if text.endswith(".") else ".")


def _missing_plots(effects: Sequence[EffectFound]) -> list[Section]:
    """Return for each effect the torque that is missing without it, and what its law accounts for."""
    made: list[Section] = []
    for effect in effects:
        curve = effect.missing_torque
        if curve is None:
            continue
        missing = Series("missing torque", curve.x, curve.missing)
        if curve.spread is not None:
            mean, spread = (np.array(values, dtype=float) for values in (curve.missing, curve.spread))
            missing = Series("missing torque, mean and spread", curve.x, mean, "points", mean - spread, mean + spread)
        law = Series("of it the effect", curve.x, curve.law)
        title = f"Missing torque: {place_words(effect.name, effect.site)}"
        made.append(Plot(title, curve.x_label, curve.y_label, (missing, law), note=MISSING))
    return made


def _residual_sections(remaining: RemainingFound) -> list[Section]:
    """Return what no effect explains, and which signals it follows."""
    facts = tuple(
        (f"torque at the {site}, rms, where the model was fitted [%]", share and 100.0 * math.sqrt(share))
        for site, share in remaining.torque.items()
    )
    made: list[Section] = [Facts("What remains unexplained", facts)] if facts else []
    if remaining.follows:
        note = "Curves over one signal, x. They are no effects and no part of the corrected model."
        made.append(fields_table("What the rest follows", remaining.follows, note))
    return made


def _law_sections(law: LearnedFound | None) -> list[Section]:
    """Return the law that was learned from what no effect explains: sentence and curve."""
    if law is None:
        return []
    curve = Series("torque that is left, with its 95 % band", law.knots, law.values, "line", *law.band)
    x_label = f"{law.argument} at the {law.site} [{law.argument_unit}]"
    return [
        Text("A law learned from what is left", (_sentence(law.words),)),
        Plot("The strongest curve of what is left", x_label, f"torque [{law.unit}]", (curve,)),
    ]


def _analysis(results: DiagnoseFound) -> list[Section]:
    made: list[Section] = [fields_table("What was analysed", results.analysis)] if results.analysis else []
    built = results.cosimulation
    if built.largest_difference_from_compiled is not None:
        difference = f"{built.largest_difference_from_compiled:.2g} {built.unit}".strip()
        made.append(Facts("The corrected FMU", (("largest difference from the compiled equations", difference),)))
    return made
