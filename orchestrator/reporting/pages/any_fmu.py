"""The page of a diagnosis of any FMU: what is missing around it, how far the misfit shrinks, what is left."""

from collections.abc import Iterator

from orchestrator.reporting.model import Facts, Plot, Report, Section, Span, Text
from orchestrator.reporting.pages.diagnosis_answer import (
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
from orchestrator.reporting.pages.record import signal_plots
from orchestrator.reporting.source import ResultDocument
from orchestrator.reporting.trust import trust_badge, trust_section
from orchestrator.shared.arrays import Array
from orchestrator.shared.results import read
from orchestrator.shared.results.any_fmu import FmuDiagnosisFound, FmuRemainingFound
from orchestrator.shared.results.diagnose import misfit_tables
from orchestrator.shared.results.fields import Cell, fields_table


def build(source: ResultDocument) -> Report:
    """Return the page."""
    found = read(source.results, FmuDiagnosisFound)
    badge, label = VERDICTS.get(found.verdict, ("neutral", found.verdict))
    table = source.signals("diagnose.csv")
    made = (("walls", found.walls), ("runs of the FMU", found.runs), ("time taken [s]", found.seconds))
    reasons = () if found.trust is None else found.trust.reasons
    notes = tuple(text for text in found.notes if text not in reasons)
    folds: dict[str, list[Section]] = {
        "Take note": [Text("Notes", notes)] if notes else [],
        "In words": in_words([text for text in found.summary if text not in reasons]),
        "Evidence for each effect": [
            one.without_empty_columns() for one in evidence_table(found.effects, "outputs' misfit")
        ],
        "Test data": [*misfit_tables(found.test, found.validation), *_output_plots(found, table)],
        "What remains unexplained": _residual_sections(found.remaining),
        "Values and search": [
            *([parameter_table(found.parameters)] if found.parameters else []),
            *candidate_table(found.candidates),
        ],
    }
    return Report(
        title="Diagnosis of an FMU",
        summary=headline(found.summary),
        badge=trust_badge(found.trust, label, badge),
        sections=(
            *answer_table(found.effects, found.test),
            *trust_section(found.trust),
            *worth_on_test_data(found.test, _test_part(found, table), ("nominal", "corrected")),
            *next_steps(found.summary),
            *([fields_table("Corrected system", found.delivery)] if found.delivery else []),
            *folds_of(folds),
        ),
        origin=made,
    )


def _test_part(results: FmuDiagnosisFound, table: dict[str, Array]) -> dict[str, Array]:
    """Return the rows of a record that are test data, all where no part of it is."""
    if results.test_start is None or "time" not in table:
        return table
    rows = table["time"] >= results.test_start
    return {name: values[rows] for name, values in table.items()}


def _output_plots(results: FmuDiagnosisFound, table: dict[str, Array]) -> Iterator[Plot]:
    """Yield each output, measured and simulated, and what each simulation misses of it; shaded: test data."""
    units = {name: (name, misfit.unit) for test in results.test for name, misfit in test.misfit.items()}
    start, time = results.test_start, table.get("time")
    test = () if start is None or time is None or not len(time) else (Span(start, float(time[-1]), "test data"),)
    return signal_plots(table, signals=units, shaded=test)


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
    return [Facts("What remains unexplained", tuple(facts))] if facts else []
