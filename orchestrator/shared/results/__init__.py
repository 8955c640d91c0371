"""What result files hold, as types: the API fills them, commands write them, pages read them.

A field that a file lacks has its default, so that pages of older files can be made; a field that pages do not know is
passed over. ``schema_version`` goes up when a field changes its meaning or goes.
"""

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeVar

import msgspec

from orchestrator.shared.results.fields import Display

F = TypeVar("F", bound=msgspec.Struct)


Interval = tuple[float | None, float | None]
Sizes = dict[str, dict[str, dict[str, float | None]]]
"""A backlash: half-gap and total play, at the load and at the motor, by unit."""


def first_version() -> int:
    """Return the first version of a result; a default that is made is never left out of a file."""
    return 1


class ResultData(msgspec.Struct, frozen=True, kw_only=True):
    """Base: what one command found."""

    schema_version: int = msgspec.field(default_factory=first_version)


class TrustFound(msgspec.Struct, frozen=True):
    """How far a result can be trusted: "green", "amber" or "red", and why it is not green."""

    level: str
    reasons: tuple[str, ...] = ()

    def __str__(self) -> str:
        return self.level


class GapFound(msgspec.Struct, frozen=True):
    """A half-gap with its 95 % interval; None where it is not finite."""

    alpha: Annotated[float | None, Display("half-gap", "rad", 6)]
    lower: Annotated[float | None, Display("95 % from", "rad", 6)]
    upper: Annotated[float | None, Display("to", "rad", 6)]


class BuildFound(ResultData, frozen=True, kw_only=True):
    """``build``: path by name, and what this machine cannot give an FMU."""

    fmus: dict[str, str]
    remark: str | None = None


class PairFound(ResultData, frozen=True, kw_only=True):
    """``simulate``: both loops. ``alpha`` and ``S`` in rad; ``experiment`` as the class of that name."""

    alpha: float
    S: float | None
    estimate: GapFound | None = None
    no_estimate: str = ""
    crossings: int | None = None
    play: dict[str, Sizes | None] = {}
    experiment: dict[str, Any] = {}


class LiveFound(msgspec.Struct, frozen=True):
    """What it takes to simulate a plant beside its record.

    ``values`` are those of ``fmu`` that differ from its defaults. From each row of the record in ``rows`` on it starts
    anew, from the ``starts`` of the same place. ``step`` in seconds.
    """

    fmu: str
    step: float
    values: dict[str, float] = {}
    rows: list[int] = []
    starts: list[dict[str, float]] = []


class WallsFound(msgspec.Struct, frozen=True):
    """The walls around a run: whose FMUs are not ours, what holds them, and what the system could not enforce."""

    foreign_fmus: tuple[str, ...] = ()
    own_process: bool = False
    landlock: int | None = None
    seccomp: bool | None = None
    not_enforced: str = ""


class SignalFound(msgspec.Struct, frozen=True):
    """A recorded signal: values of it in ``unit``, with its root mean square; files of before had them as texts."""

    signal: str
    unit: str = ""
    first: float | str | None = None
    last: float | str | None = None
    smallest: float | str | None = None
    largest: float | str | None = None
    rms: float | None = None


class RemarkFound(msgspec.Struct, frozen=True):
    """What is to be known of a run that went on: whose it is, the first text, and how often it came."""

    instance: str
    text: str
    count: int = 1


class EventsFound(msgspec.Struct, frozen=True):
    """Events of slaves: their times [s], instants and ticks of clocks, and by how much late ones were late [s]."""

    times: list[float] = []
    instants: int = 0
    ticks: int = 0
    late: list[float] = []


class SignalsFound(ResultData, frozen=True, kw_only=True):
    """``simulate`` of a scenario and ``ssp run``: recorded signals, steps, events, remarks, and the walls around it."""

    signals: list[SignalFound] = []
    steps: int | None = None
    events: EventsFound | None = None
    remarks: list[RemarkFound] = []
    isolation: WallsFound | None = None


class ColumnFound(msgspec.Struct, frozen=True):
    """A column of results in ``sweep.csv``."""

    name: str
    unit: str


class ErrorsFound(msgspec.Struct, frozen=True):
    """Errors of the estimates at one noise level; ``coverage`` is the share of intervals that hold the actual size."""

    noise: Annotated[float, Display("noise", "rad")]
    count: Annotated[int, Display("cases")]
    mean_percent: Annotated[float | None, Display("mean error", "%")]
    worst_percent: Annotated[float | None, Display("worst error", "%")]
    mse: Annotated[float | None, Display("mean squared error (MSE)", "rad²")]
    coverage: Annotated[float | None, Display("intervals that hold the size", "%", factor=100.0)]


class CalibrationFound(msgspec.Struct, frozen=True):
    """Where a calibration comes from; sizes and width in rad, ``settings`` by name."""

    digest: str = ""
    runs: int | None = None
    seed_branch: int | None = None
    smallest: float | None = None
    largest: float | None = None
    level: float | None = None
    width: float | None = None
    version: str | None = None
    settings: dict[str, Any] = {}


class SweptScenario(msgspec.Struct, frozen=True):
    """The scenario of a sweep: its name, recorded signals and end [s]."""

    name: str
    record: list[str] = []
    stop: float | None = None


class SweepFound(ResultData, frozen=True, kw_only=True):
    """``sweep``: counts and columns always; of the pair the errors and their origin, of a scenario its name.

    ``remarked``: cases with a text in the column ``remarks``; ``first_remark`` is the first of them.
    """

    cases: int
    failed: int
    remarked: int = 0
    first_remark: str = ""
    columns: list[ColumnFound] = []
    statistics: list[ErrorsFound] = []
    trust: TrustFound | None = None
    experiment: dict[str, Any] | None = None
    calibrations: dict[str, CalibrationFound] = {}
    fmus: dict[str, str] | None = None
    fmu_kind: str | None = None
    scenario: SweptScenario | None = None
    play: dict[str, Sizes] = {}
    isolation: WallsFound | None = None


class FindingFound(msgspec.Struct, frozen=True):
    """A violated rule: where, what was expected and found, and what to do; an unknown line is 0."""

    severity: Literal["error", "warning", "info"]
    rule: str
    path: str = ""
    message: str = ""
    advice: str = ""
    fingerprint: str = ""
    known: bool = False
    line: int = 0
    column: int = 0


class RuleFound(msgspec.Struct, frozen=True):
    """What became of a rule on an FMU, with the reason where it was not run."""

    rule: str
    outcome: Literal["passed", "failed", "not run"]
    reason: str = ""


class CheckedFmu(msgspec.Struct, frozen=True):
    """An FMU that was checked: counts by severity, facts by name, and why nothing was executed."""

    fmu: str
    ok: bool
    executed: bool = False
    counts: dict[str, int] = {}
    facts: dict[str, str | int | list[str]] = {}
    findings: list[FindingFound] = []
    not_executed: str = ""
    rules: list[RuleFound] = []


class CheckFound(ResultData, frozen=True, kw_only=True):
    """``check``: whether no FMU has an error, counts by severity, and each FMU."""

    ok: bool
    counts: dict[str, int] = {}
    fmus: list[CheckedFmu] = []


def as_plain(data: Any) -> Any:
    """Turn results into what JSON knows. Return nested dictionaries, lists, numbers and texts."""
    if isinstance(data, Mapping):
        return data
    return msgspec.to_builtins(data, enc_hook=lambda value: value.tolist() if hasattr(value, "tolist") else str(value))


def read(results: Any, kind: type[F]) -> F:
    """Read results from a file's content."""
    try:
        return msgspec.convert(results, kind)
    except msgspec.ValidationError as error:
        raise ValueError(str(error)) from None
