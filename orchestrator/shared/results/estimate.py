"""What ``estimate.json`` holds: half-gaps by method, the answer, and a proposed experiment."""

from collections.abc import Mapping
from typing import Annotated, Any

import msgspec

from orchestrator.shared.results import GapFound, Interval, LiveFound, Sizes, TrustFound, first_version
from orchestrator.shared.results.diagnose import DiagnoseFound
from orchestrator.shared.results.fields import Display, ReportTable, TableColumn, fields_table


class MethodFound(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A half-gap with all that is said about it, or why the method does not apply.

    ``cramer_rao`` is the bound on the standard error, ``diagnostics`` are numbers and short texts of the method.
    """

    not_applicable: str | None = None
    alpha: Annotated[float | None, Display("half-gap", "rad", 6)] = None
    visible: Annotated[bool | None, Display("seen")] = None
    trust: Annotated[TrustFound | None, Display("trust")] = None
    interval: Annotated[Interval | None, Display("95 % from", "rad", 6, to="to")] = None
    standard_error: Annotated[float | None, Display("standard error", "rad", 2)] = None
    cramer_rao: Annotated[float | None, Display("Cramer-Rao bound", "rad", 2)] = None
    level: float | None = None
    unit: str | None = None
    message: str | None = None
    seconds: float | None = None
    diagnostics: dict[str, Any] | None = None


def methods_table(title: str, methods: Mapping[str, MethodFound]) -> ReportTable:
    """Return the table of the methods that apply."""
    note = "Cramer-Rao bound: the least standard error that the record allows."
    applied = {name.replace("_", " "): _as_seen(e) for name, e in methods.items() if e.not_applicable is None}
    return fields_table(title, applied, note, "method", MethodFound)


def _as_seen(method: MethodFound) -> MethodFound:
    """Return a method without the sizes that it has of a gap that is not seen, but for how large it may be."""
    if method.visible is not False:
        return method
    most = None if method.interval is None else (None, method.interval[1])
    return msgspec.structs.replace(method, alpha=None, interval=most, standard_error=None, cramer_rao=None)


def parameters_table(title: str, parameters: Mapping[str, Mapping[str, float]]) -> ReportTable:
    """Return the table of what was fitted beside half-gaps."""
    columns = tuple(TableColumn(name, "", 6) for name in ("parameter", "nominal", "fitted", "standard error"))
    keys = ("nominal", "value", "standard_error")
    rows = tuple((name, *map(one.get, keys)) for name, one in parameters.items())
    return ReportTable(title, columns, rows)


class RecordFound(msgspec.Struct, frozen=True):
    """A record: rows, sample time [s], source, rows with missing samples, what was assumed, and the file's angles."""

    rows: int
    step: float
    source: str
    missing: int = 0
    notes: tuple[str, ...] = ()
    angle_unit: str = "rad"


class RepeatsFound(msgspec.Struct, frozen=True):
    """What records with the same torque differ by: rms by encoder, in ``unit``."""

    sources: tuple[str, ...]
    floor: dict[str, float]
    unit: str = "rad"


class ExcitationFound(msgspec.Struct, frozen=True):
    """A proposed torque, and the bound that it sets on the standard error of the half-gap; None: it is not seen."""

    name: Annotated[str, Display("excitation")]
    bound: Annotated[float | None, Display("bound on the half-gap", "rad", 3)]
    peak_torque: Annotated[float, Display("peak torque", "N.m")]
    peak_motor_speed: Annotated[float, Display("peak motor speed", "rad/s")]


class LocationFound(msgspec.Struct, frozen=True, kw_only=True):
    """Where the gap of a train of two stages is.

    ``answers`` are what the record leaves possible, of "1", "2" and "both"; none where it shows no gap. ``stages`` are
    half-gaps at each gear's output, ``behind`` is the log-likelihood by which each answer falls behind the best.
    """

    answers: tuple[str, ...]
    answer: str
    total: GapFound
    stages: dict[str, GapFound]
    behind: dict[str, float]
    traversals: int
    autocorrelation: tuple[float, float]
    parameters: dict[str, dict[str, float]] = {}
    unit: str = "rad"


ANSWERS = {"1": "stage 1 alone", "2": "stage 2 alone", "both": "both stages"}


def location_tables(location: LocationFound) -> tuple[ReportTable, ReportTable]:
    """Return the half-gaps of a train, and by how much each answer falls behind."""
    gaps = {f"stage {name}, at its gear's output": gap for name, gap in location.stages.items()}
    gaps["both, seen from the load"] = location.total
    note = "Where several answers are left, the 95 % interval holds the half-gaps of all."
    columns = (TableColumn("answer"), TableColumn("log-likelihood behind the best"), TableColumn("left"))
    rows = tuple((ANSWERS[name], round(far, 1), name in location.answers) for name, far in location.behind.items())
    behind = "How far the best fit with the gap in that place falls behind the best of all; far behind means excluded."
    return fields_table("Half-gaps", gaps, note, "gap"), ReportTable("Where the gap can be", columns, rows, behind)


class EstimateFound(MethodFound, frozen=True, kw_only=True, omit_defaults=True):
    """``estimate``: the half-gap of the first method that applies, and of each; with a design the excitations."""

    schema_version: int = msgspec.field(default_factory=first_version)
    record: RecordFound | None = None
    estimates: dict[str, MethodFound] = {}
    more_records: tuple[RecordFound, ...] | None = None
    repeats: RepeatsFound | None = None
    location: LocationFound | None = None
    method: str | None = None
    play: Sizes | None = None
    live: LiveFound | None = None
    diagnosis: DiagnoseFound | None = None
    undiagnosed: str | None = None
    settings: dict[str, Any] = {}
    design: tuple[ExcitationFound, ...] | None = None
