"""What an FMU offers, for a program to show: variables with units, starts and limits. Nothing of it is loaded."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import msgspec

from orchestrator.fmi.model_description import read_description
from orchestrator.master.protocol import ModelInterface, Unit, Value


class VariableShown(msgspec.Struct, frozen=True):
    """A variable; ``quantity`` is the same text for units that measure the same, empty where none is known."""

    name: str
    causality: str
    type: str
    unit: str
    quantity: str
    variability: str
    start: Value | None
    minimum: float | None
    maximum: float | None
    items: tuple[str, ...]
    description: str


class FmuPreview(msgspec.Struct, frozen=True):
    """An FMU's interface; ``left_out`` says what of it cannot be used here."""

    file: str
    version: str
    kind: str
    events: bool
    left_out: str
    variables: tuple[VariableShown, ...]


def preview_fmu(path: Path) -> FmuPreview:
    """Return the interface of an FMU, from its model description alone.

    Raises:
        FmuError: the archive or the description cannot be used.
    """
    described = read_description(path)
    model = described.model
    kind = "co-simulation" if described.exchange is None else "model exchange"
    shown = shown_variables(model)
    return FmuPreview(path.name, described.version, kind, model.has_events, described.left_out, shown)


def shown_variables(
    model: ModelInterface, prefix: str = "", starts: Mapping[str, Value] = MappingProxyType({})
) -> tuple[VariableShown, ...]:
    """Return the variables of a model, ``prefix`` before each name; ``starts`` set others."""
    return tuple(
        VariableShown(
            prefix + one.name, one.causality, one.type, one.unit or "", _quantity(model.units.get(one.unit or "")),
            one.variability, starts.get(one.name, one.start), one.minimum, one.maximum,
            tuple(name for name, _ in one.items), one.description,
        )
        for one in model.variables.values()
    )  # fmt: skip


def _quantity(unit: Unit | None) -> str:
    """Return what a unit measures, as exponents of the base units."""
    if unit is None:
        return ""
    return unit.name if unit.exponents is None else " ".join(map(str, unit.exponents))
