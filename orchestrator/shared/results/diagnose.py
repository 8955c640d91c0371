"""What ``diagnose.json`` holds of a model of ours; section "JSON" of docs/diagnosis.md says what each word means."""

from typing import Any

import msgspec
from msgspec import UNSET, UnsetType

from orchestrator.shared.results import Found, Interval, LiveFound, Sizes, TrustFound


class ValueFound(msgspec.Struct, frozen=True):
    """A value with its standard error and 95 % interval, in ``unit``."""

    value: float | None
    standard_error: float | None = None
    interval: Interval | None = None
    unit: str | None = None


class ParameterFound(msgspec.Struct, frozen=True):
    """The same of a parameter of the model, beside its nominal value."""

    nominal: float | None = None
    value: float | None = None
    standard_error: float | None = None
    interval: Interval | None = None
    unit: str | None = None


class EffectFound(msgspec.Struct, frozen=True):
    """A named effect: where it acts, its values, its gain, the runner-up, and what it cannot be told from."""

    name: str
    site: str
    parameters: dict[str, ValueFound]
    score: float | None = None
    runner_up: str | None = None
    margin: float | None = None
    family: tuple[str, ...] = ()


class PlaceFound(msgspec.Struct, frozen=True):
    """A place of the misfit: signal, regime, interval in ``unit`` and the share of the misfit that sits there."""

    signal: str
    regime: str
    interval: Interval
    unit: str
    share_of_misfit: float


class StageFound(msgspec.Struct, frozen=True):
    """A model on the way to the final one, and its rms misfit."""

    model: str
    rms: float | None


class MisfitFound(msgspec.Struct, frozen=True):
    """Rms of simulated minus measured of one signal, of the first and the last model and of each between them."""

    before: float | None
    after: float | None
    noise: float | None
    unit: str
    stages: tuple[StageFound, ...] = ()


class ValidatedFound(msgspec.Struct, frozen=True):
    """The same on another record, with the R2 of one free run over all of it, by model, and a zero that has moved."""

    before: float | None
    after: float | None
    noise: float | None
    unit: str
    r_squared: dict[str, float | None] = {}
    moved_zero: float | None = 0.0


class EvidenceFound(msgspec.Struct, frozen=True):
    """What one of several records says of the common model."""

    source: str
    rows: int
    misfit: dict[str, MisfitFound]


class FloorFound(msgspec.Struct, frozen=True):
    """Records with the same input, and the rms by signal that they differ by."""

    sources: tuple[str, ...]
    floor: dict[str, float]


class LawRunFound(msgspec.Struct, frozen=True):
    """A free run of the corrected FMU with its law on: first row in the held-out part, and start values."""

    row: int
    starts: dict[str, float]


class LawExportFound(msgspec.Struct, frozen=True):
    """A learned law in the corrected FMU: the parameter that switches it, and what the FMU misses with it on.

    ``misfit`` is the rms by signal in ``unit`` over the held-out part.
    """

    parameter: str
    misfit: dict[str, float | None]
    unit: str
    largest_difference_from_predictor: float | None
    runs: tuple[LawRunFound, ...] = ()


class LearnedFound(msgspec.Struct, frozen=True):
    """A learned law: knots and values with the 95 % band (its low and its high ends), and what it is worth.

    ``exported`` says what the corrected FMU makes of it, where it was asked for.
    """

    site: str
    argument: str
    argument_unit: str
    unit: str
    words: str
    knots: tuple[float, ...]
    values: tuple[float | None, ...]
    band: tuple[tuple[float | None, ...], tuple[float | None, ...]]
    formula: str
    misfit: dict[str, MisfitFound]
    times_smaller: float | None
    exported: LawExportFound | None = None


class HorizonFound(msgspec.Struct, frozen=True):
    """A horizon, and for each ``model`` the rms error of each signal at it."""

    horizon: str
    errors: tuple[dict[str, str | float | None], ...]


class AnalysisFound(msgspec.Struct, frozen=True):
    """The record as it was analysed: rate [Hz], rows, rows of the file for each, notes."""

    rate: float
    rows: int
    rows_of_the_file: int
    notes: tuple[str, ...] = ()


class PredictableFound(msgspec.Struct, frozen=True):
    """What the rest follows: its gain in log-likelihood, and its share of the rest."""

    site: str
    kind: str
    gain: float | None
    share: float


class RemainderFound(msgspec.Struct, frozen=True):
    """What the best model leaves."""

    explained: float | None = None
    missing_log_likelihood: float | None = None
    growth: float | None = None
    tails: float | None = None
    predictable: tuple[PredictableFound, ...] = ()


class TriedFound(msgspec.Struct, frozen=True):
    """A candidate: its effect, and its gain in log-likelihood on the fitted and on the deciding part."""

    effect: str
    gain: float | None
    fitted: float | None = None
    decided: float | None = None
    process_noise: float | None = None


class StepFound(msgspec.Struct, frozen=True):
    """A step of the search: the effects before it, whether the best candidate was taken, and all of them."""

    on_top_of: tuple[str, ...]
    accepted: bool
    tried: tuple[TriedFound, ...]


class DifferenceFound(msgspec.Struct, frozen=True):
    """The corrected FMU against the compiled equations."""

    largest_difference_from_compiled: float | None = None
    unit: str = ""


class TermFound(msgspec.Struct, frozen=True):
    """What the final model leaves that follows position or direction; ``level`` is the gain at any period."""

    name: str
    period: float | None
    period_unit: str | None
    size: float
    unit: str
    gain: float
    level: float
    sure: bool


class DiagnoseFound(Found, frozen=True, kw_only=True):
    """``diagnose``: verdict, effects, misfit, and how they were found."""

    schema_version: int = 2
    verdict: str
    effects: tuple[EffectFound, ...] = ()
    play: Sizes | None = None
    nuisances: tuple[EffectFound, ...] = ()
    parameters: dict[str, ParameterFound] = msgspec.field(default_factory=dict)
    where: tuple[PlaceFound, ...] = ()
    misfit: dict[str, MisfitFound] = msgspec.field(default_factory=dict)
    records: tuple[EvidenceFound, ...] = ()
    repeats: FloorFound | None = None
    learned_law: LearnedFound | None = None
    horizons: tuple[HorizonFound, ...] = ()
    analysis: AnalysisFound | None = None
    trust: TrustFound | None = None
    model: str | None = None
    suspects: tuple[EffectFound, ...] = ()
    warnings: tuple[str, ...] = ()
    remainder: RemainderFound = RemainderFound()
    settings: dict[str, Any] = msgspec.field(default_factory=dict)
    candidates: tuple[StepFound, ...] = ()
    cosimulation: DifferenceFound = DifferenceFound()
    validation: dict[str, ValidatedFound] | UnsetType = UNSET
    torque_error: dict[str, dict[str, float | None]] | UnsetType = UNSET
    also_seen: tuple[TermFound, ...] = ()
    live: LiveFound | None = None
    told: tuple[str, ...] = ()
    seconds: float | None = None
