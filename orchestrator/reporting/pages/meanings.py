"""What the parameters of a known plant are, beside their symbols."""

from collections.abc import Mapping

from orchestrator.plants.known import plants
from orchestrator.shared.results import LiveFound
from orchestrator.shared.results.estimate import parameters_table
from orchestrator.shared.results.fields import ReportTable, TableColumn


def with_meanings(table: ReportTable, live: LiveFound | None) -> ReportTable:
    """Return a table of a plant's parameters with what each of them is; as it is where the plant is not known."""
    plant = plants().get(live.fmu) if live else None
    if plant is None:
        return table
    meanings = {entry.name: entry.description for entry in plant.table}
    return table.with_column(TableColumn("meaning"), [meanings.get(str(row[0])) for row in table.rows])


def fitted_parameters(
    parameters: Mapping[str, Mapping[str, float]] | None, live: LiveFound | None = None
) -> list[ReportTable]:
    """Return the table of what was fitted beside half-gaps, with meanings; none where nothing was."""
    if not parameters:
        return []
    return [with_meanings(parameters_table("Parameters fitted with the gap", parameters), live)]
