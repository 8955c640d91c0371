"""Write ``docs/effects.md``: every effect that a diagnosis searches for, from the banks.

python -m tools.effects_page
"""

from collections.abc import Iterable, Sequence
from pathlib import Path

from orchestrator.effects.effect import AXIS, DRIVETRAIN, Effect
from orchestrator.effects.of_fmus import BANK
from orchestrator.effects.of_plants import PLANT_BANK
from orchestrator.plants.known import plants
from tools import refuse_arguments

PAGE = Path(__file__).resolve().parents[1] / "docs" / "effects.md"
HEAD = """# Effects

`diagnose` searches these effects. Each is a row of a bank in `orchestrator/effects/`; [extending](extending.md) shows
how to add one. The [method](method.md) page explains the search. `python -m tools.effects_page` writes this page.

## Effects of plants

`D` means that `Drivetrain` offers the effect at this site, `A` that the single axis (`ServoAxis`) does. Model files use
the names of [the FMUs' interfaces](../fmus/README.md).

| effect | sites | parameters | in the motion |
|---|---|---|---|
"""
LOG = """
Properties of the log are fitted too, and are not effects of the machine:

| property | parameters |
|---|---|
"""
FMUS = """
## Effects around any FMU

For [any FMU](any-fmu.md), `effort`, `flow` and `signal` in a unit stand for the units at the place; at a shaft, for
example, N.m and rad.

| effect | place | parameters |
|---|---|---|
"""
PLACES = {
    "input": "in series at an input",
    "output": "in series at an output",
    "port": "feedback at a port",
    "parameter": "in a parameter",
    "cut": "in a connection between two FMUs",
}


def page() -> str:
    """Return the page."""
    physics = [row for row in PLANT_BANK if not row.measurement]
    names = dict.fromkeys(row.name for row in physics)
    of_plants = [_row_of_plants([row for row in physics if row.name == name]) for name in names]
    of_log = [(f"`{row.name}`", _listed(_units(row))) for row in PLANT_BANK if row.measurement]
    of_fmus = [(f"`{row.name}`", PLACES[row.site], _listed(row.parameters.items())) for row in BANK.values()]
    return HEAD + _table(of_plants) + LOG + _table(of_log) + FMUS + _table(of_fmus)


def _row_of_plants(rows: Sequence[Effect]) -> tuple[str, ...]:
    letters = {DRIVETRAIN: "D", AXIS: "A"}
    sites = [f"{row.site} ({', '.join(letters[plant] for plant in row.plants)})" for row in rows]
    return f"`{rows[0].name}`", ", ".join(sites), _listed(_units(rows[0])), rows[0].motion


def _units(row: Effect) -> list[tuple[str, str]]:
    plant = plants()[DRIVETRAIN]
    return [(short, plant.entry(plant.index(name)).unit) for short, name in row.parameters.items()]


def _listed(parameters: Iterable[tuple[str, str]]) -> str:
    return ", ".join(f"`{name}` [{unit}]" if unit else f"`{name}`" for name, unit in parameters)


def _table(rows: Iterable[tuple[str, ...]]) -> str:
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


if __name__ == "__main__":
    refuse_arguments(__doc__)
    PAGE.write_text(page(), encoding="utf-8")
