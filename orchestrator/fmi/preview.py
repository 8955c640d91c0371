"""What an FMU offers, for a program to show: variables with units, starts and limits. Nothing of it is loaded."""

import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import msgspec
from lxml import etree

from orchestrator.fmi.model_description import read_description
from orchestrator.master.protocol import ModelInterface, Unit, Value
from orchestrator.shared.isolation.archives import open_archive


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
    """An FMU's interface.

    Attributes:
        description: of the model, in its author's words; empty: it has none.
        tool: that made it, as it says; empty: it does not.
        platforms: that it has binaries for, and "sources" where it has such.
        stop, step: of its default experiment [s]; None: it names none.
        left_out: what of it cannot be used here.
    """

    file: str
    name: str
    description: str
    tool: str
    platforms: tuple[str, ...]
    stop: float | None
    step: float | None
    version: str
    kind: str
    events: bool
    left_out: str
    variables: tuple[VariableShown, ...]


def preview_fmu(path: Path) -> FmuPreview:
    """Return the interface of an FMU, from its model description alone."""
    described = read_description(path)
    model = described.model
    kind = "co-simulation" if described.exchange is None else "model exchange"
    shown = shown_variables(model)
    return FmuPreview(
        path.name, model.name, *_head(path), described.version, kind, model.has_events, described.left_out, shown
    )


def _head(path: Path) -> tuple[str, str, tuple[str, ...], float | None, float | None]:
    """Return description, tool, platforms, and stop time and step of the default experiment."""
    with open_archive(path) as (archive, members):
        content = archive.read("modelDescription.xml")
        folders = {tuple(name.split("/")[:2]) for name in members}
    platforms = sorted(part[1] for part in folders if part[0] == "binaries" and len(part) > 1 and part[1])
    sources = ["sources"] if any(part[0] == "sources" for part in folders) else []
    root = etree.fromstring(content, etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False))
    experiment = root.find("DefaultExperiment")
    times = [_time(None if experiment is None else experiment.get(name)) for name in ("stopTime", "stepSize")]
    return root.get("description", ""), root.get("generationTool", ""), (*platforms, *sources), times[0], times[1]


def _time(text: str | None) -> float | None:
    """Return a time that can be stepped by, None where there is none."""
    try:
        value = float(text or "")
    except ValueError:
        return None
    return value if 0.0 < value < math.inf else None


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
