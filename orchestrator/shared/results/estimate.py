"""What ``estimate.json`` holds: half-gaps by method, the answer, and a proposed experiment."""

from typing import Any

import msgspec

from orchestrator.shared.results import GapFound, Interval, LiveFound, Sizes, TrustFound, first_version
from orchestrator.shared.results.diagnose import DiagnoseFound


class MethodFound(msgspec.Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A half-gap with all that is said about it [rad], or why the method does not apply.

    ``cramer_rao`` is the bound on the standard error, ``diagnostics`` are numbers and short texts of the method.
    """

    not_applicable: str | None = None
    alpha: float | None = None
    standard_error: float | None = None
    cramer_rao: float | None = None
    interval: Interval | None = None
    level: float | None = None
    unit: str | None = None
    visible: bool | None = None
    message: str | None = None
    trust: TrustFound | None = None
    seconds: float | None = None
    diagnostics: dict[str, Any] | None = None


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
    """A proposed torque: the bound [rad] it sets, its peak [N.m] and the motor's largest speed [rad/s]."""

    name: str
    bound: float
    peak_torque: float
    peak_motor_speed: float


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
