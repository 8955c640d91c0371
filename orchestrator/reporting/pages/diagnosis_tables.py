"""Tables that pages of a diagnosis share, of a plant or of any FMU: how sure, misfit, parameters, what was tried."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from orchestrator.effects.words import place_words
from orchestrator.reporting.model import Badge, Cell, ReportTable, TableColumn
from orchestrator.reporting.pages.diagnosis_answer import SIGNALS
from orchestrator.shared.results.diagnose import EffectFound, ParameterFound, StepFound, TestFound

MODELS = {"nominal": "model as given", "parameters": "with re-fitted parameters", "final": "with the effects"}
VERDICTS: Mapping[str, tuple[Badge, str, str]] = {
    "none": ("good", "nothing is missing", "The model explains the record."),
    "parameters": ("good", "some values are off", "The model explains the record once its parameters are re-fitted."),
    "effects": ("neutral", "effects are missing", ""),
    "unknown": ("bad", "unexplained", "Something is missing in the model, and no effect of the library is likely."),
}
TAKES = "error on blocks left out that it removes [%]"
TEST = "Root mean square of free runs minus measured, on data that nothing was fitted to and nothing was chosen by."


def leave_out_empty(table: ReportTable) -> ReportTable:
    """Return a table without the columns in which no row says anything."""
    used = [n for n in range(len(table.columns)) if any(row[n] is not None for row in table.rows)]
    rows = tuple(tuple(row[n] for n in used) for row in table.rows)
    return replace(table, columns=tuple(table.columns[n] for n in used), rows=rows)


def evidence_table(effects: Sequence[EffectFound], of: str = "missing torque") -> list[ReportTable]:
    """Return how sure each effect is, and why; none without effects. ``of``: what an effect explains a share of."""
    if not effects:
        return []
    reasons = tuple(
        (
            place_words(e.name, e.site), e.grade, percent(e.gain), e.t, percent(e.explains.torque),
            percent(e.explains.motion), "yes" if e.in_model else "no",
            ", ".join(label_words(label) for label in e.family) or None, ", ".join(e.lowered_by) or None,
        )
        for e in effects
    )  # fmt: skip
    titles = (
        "effect", "grade", TAKES, "over its uncertainty", f"explains of the {of} [%]",
        "of the misfit on test data [%]", "in the corrected model", "not told from", "rules that lower the grade",
    )  # fmt: skip
    note = "The corrected model has the effects that are certain or likely, and those that were asked for."
    return [ReportTable("How sure", tuple(TableColumn(title, "", 3) for title in titles), reasons, note)]


def label_words(label: str) -> str:
    """Return an effect at its site, ``name@site``, in words."""
    name, _, site = label.partition("@")
    return place_words(name, site)


def misfit_table(title: str, test: TestFound) -> ReportTable:
    """Return the misfit of each signal on test data, from model to model."""
    columns = tuple(TableColumn(n) for n in ("signal", *MODELS.values(), "noise", "unit", "R² of the free runs"))
    rows = tuple(
        (SIGNALS.get(s, s), g.nominal, g.parameters, g.final, g.noise, g.unit, test.r_squared.get(s))
        for s, g in test.misfit.items()
    )
    worse = " The final model does worse than re-fitted parameters." if test.worse else ""
    return ReportTable(title, columns, rows, f"{TEST} {test.rows} rows.{worse}")


def parameter_table(parameters: Mapping[str, ParameterFound]) -> ReportTable:
    """Return the model's own parameters beside their nominal values."""
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


def candidate_table(steps: Sequence[StepFound]) -> list[ReportTable]:
    """Return what was tried in each step of the search."""
    rows: list[tuple[Cell, ...]] = []
    for number, step in enumerate(steps, start=1):
        base = ", ".join(label_words(label) for label in step.on_top_of) or "re-fitted parameters"
        rows += [
            (number, base, label_words(t.effect), percent(t.gain), t.t, "taken" if t.effect == step.taken else None)
            for t in step.tried
        ]
    if not rows:
        return []
    columns = ("step", "on top of", "tried", TAKES, "over its uncertainty", "in the model")
    return [ReportTable("What was tried", tuple(TableColumn(c, "", 3) for c in columns), tuple(rows), limit=200)]


def percent(share: float | None) -> float | None:
    """Return a share in percent; None where it is not known."""
    return None if share is None else 100.0 * share
