"""Tables that pages of a diagnosis share, of a plant or of any FMU: how sure, misfit, parameters, what was tried."""

from collections.abc import Mapping, Sequence

from orchestrator.effects.words import place_words
from orchestrator.reporting.model import Badge
from orchestrator.shared.results.diagnose import TAKES, EffectFound, ParameterFound, StepFound, percent
from orchestrator.shared.results.fields import Cell, ReportTable, TableColumn, fields_table

VERDICTS: Mapping[str, tuple[Badge, str]] = {
    "none": ("good", "nothing is missing"),
    "parameters": ("good", "some values are off"),
    "effects": ("neutral", "effects are missing"),
    "unknown": ("bad", "unexplained"),
}


def evidence_table(effects: Sequence[EffectFound], of: str = "missing torque") -> list[ReportTable]:
    """Return how sure each effect is, and why; none without effects. ``of``: what an effect explains a share of."""
    if not effects:
        return []
    reasons = tuple(
        (
            place_words(e.name, e.site), e.grade, percent(e.gain), e.t, percent(e.explains.torque),
            percent(e.explains.motion), "yes" if e.in_model else "no", ", ".join(e.lowered_by) or None,
        )
        for e in effects
    )  # fmt: skip
    titles = (
        "effect", "grade", f"{TAKES} [%]", "over its uncertainty", f"explains of the {of} [%]",
        "of the misfit on test data [%]", "in the corrected model", "rules that lower the grade",
    )  # fmt: skip
    note = "The corrected model has the effects that are certain or likely, and those that you chose."
    return [ReportTable("How sure", tuple(TableColumn(title, "", 3) for title in titles), reasons, note)]


def label_words(label: str) -> str:
    """Return an effect at its site, ``name@site``, in words."""
    name, _, site = label.partition("@")
    return place_words(name, site)


def parameter_table(parameters: Mapping[str, ParameterFound]) -> ReportTable:
    """Return the model's own parameters beside their nominal values."""
    changes = [_change(p) for p in parameters.values()]
    return fields_table("Parameters", parameters, names="parameter", of=ParameterFound).with_column(
        TableColumn("change", "%", 3), changes
    )


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
    columns = ("step", "on top of", "tried", f"{TAKES} [%]", "over its uncertainty", "in the model")
    return [ReportTable("What was tried", tuple(TableColumn(c, "", 3) for c in columns), tuple(rows), limit=200)]
