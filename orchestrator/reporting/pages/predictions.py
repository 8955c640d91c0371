"""What the models of a diagnosis predict: horizons, free runs over another record, the torque of the inverse model."""

from collections.abc import Mapping, Sequence

from orchestrator.reporting.model import Facts, ReportTable, Section, TableColumn
from orchestrator.reporting.source import words
from orchestrator.shared.results.diagnose import AnalysisFound, HorizonFound, MisfitFound, ValidatedFound

SIGNALS = {"theta_m": "motor angle", "theta_l": "load angle"}
COMPARED = {"before": "as given", "parameters": "re-fitted", "after": "with effects"}
HORIZON_MODELS = {"parameters": "re-fitted", "final": "corrected"}


def free_runs(validation: Mapping[str, ValidatedFound]) -> list[Section]:
    """Return how much of the other record one free run over all of it explains.

    Args:
        validation: the misfit on another record.

    Returns:
        The table, if there is one.
    """
    rows = tuple(
        (SIGNALS.get(signal, signal), *(g.r_squared.get(n) for n in COMPARED))
        for signal, g in validation.items()
        if g.r_squared
    )
    columns = tuple(TableColumn(n, "", 6) for n in ("signal", *COMPARED.values()))
    moved = [f"{g.moved_zero:.4g} {g.unit}" for g in validation.values() if g.moved_zero]
    note = f"The other record counts from another zero, which lies {moved[0]} off." if moved else ""
    return [ReportTable("R² of one free run over all of the other record", columns, rows, note)] if rows else []


def horizons(found: Sequence[HorizonFound], misfit: Mapping[str, MisfitFound]) -> list[Section]:
    """Return how far predictions go wrong from so long before, of the re-fitted and of the corrected model.

    Args:
        found: the errors at each horizon.
        misfit: of each signal, with its unit.

    Returns:
        The table, if there is one.
    """
    signals = [signal for signal, g in misfit.items() if g.noise is not None]
    rows = tuple(
        (horizon.horizon, _model(error["model"]), *(error.get(s) for s in signals))
        for horizon in found
        for error in horizon.errors
    )
    columns = tuple(TableColumn(SIGNALS.get(s, s), misfit[s].unit, 4) for s in signals)
    note = "Rms error of a prediction from so long before, on the part of the record that no fit has seen."
    titles = (TableColumn("ahead"), TableColumn("model"))
    return [ReportTable("Predictions", (*titles, *columns), rows, note)] if rows else []


def torque_errors(errors: Mapping[str, Mapping[str, float | None]]) -> list[Section]:
    """Return the relative error of the torque that the inverse model computes from the motion.

    Args:
        errors: by record.

    Returns:
        The table, if there is one.
    """
    rows = tuple((words(record), *(_percent(e.get(n)) for n in COMPARED)) for record, e in errors.items())
    columns = tuple(TableColumn(n) for n in ("on", *(f"{name} [%]" for name in COMPARED.values())))
    return [ReportTable("Relative torque error of the inverse model", columns, rows)] if rows else []


def analysed(analysis: AnalysisFound | None) -> list[Section]:
    """Return at which rate the record was analysed.

    Args:
        analysis: rate and rows.

    Returns:
        The facts, if there are any.
    """
    if analysis is None:
        return []
    facts = {"rate [Hz]": analysis.rate, "rows": analysis.rows, "rows of the file for each": analysis.rows_of_the_file}
    return [Facts("What was analysed", tuple(facts.items()))]


def _model(name: str | float | None) -> str:
    return HORIZON_MODELS.get(str(name), str(name))


def _percent(share: float | None) -> float | None:
    return None if share is None else 100.0 * share
