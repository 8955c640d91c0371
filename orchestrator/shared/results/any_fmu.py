"""What ``diagnose.json`` and ``calibrate.json`` hold of any FMU; docs/any-fmu.md says what each word means."""

from typing import Any, Literal

import msgspec

from orchestrator.shared.results import Found, TrustFound
from orchestrator.shared.results.diagnose import EffectFound, ParameterFound


class OutputFound(msgspec.Struct, frozen=True):
    """Rms of simulated minus measured of one output over its noise, of each model; ``noise`` in ``unit``."""

    nominal: float | None
    refitted: float | None
    corrected: float | None
    noise: float | None
    unit: str = ""


class BoxTriedFound(msgspec.Struct, frozen=True):
    """A candidate: its effect, values, gain in log-likelihood, that on the deciding part, and fitted numbers."""

    effect: str
    gain: float | None
    values: tuple[float | None, ...] = ()
    decided: float | None = None
    parameters: int | None = None


class BoxStepFound(msgspec.Struct, frozen=True):
    """A step of the search: the effects before it, whether one was taken, and all that were tried, the best first."""

    on_top_of: tuple[str, ...]
    accepted: bool
    tried: tuple[BoxTriedFound, ...]


class LeftFound(msgspec.Struct, frozen=True):
    """What the final model leaves: noise alone or not, a disturbance's share of the drive, why, power by part."""

    explained: bool
    disturbance: float | None = None
    reasons: tuple[str, ...] = ()
    power: tuple[tuple[float | None, ...], ...] = ()


class PartFound(msgspec.Struct, frozen=True):
    """An FMU of the corrected system: its effect, or "connection", and its values."""

    name: str
    effect: str
    values: dict[str, float | int | bool] = {}


class DeliveredFound(msgspec.Struct, frozen=True):
    """A corrected system: its file, its parts, how far its run is from the fit, and why it could not be run."""

    file: str
    parts: tuple[PartFound, ...] = ()
    difference_over_noise: float | None = None
    note: str = ""


class BoxDiagnosisFound(Found, frozen=True, kw_only=True):
    """``diagnose`` of any FMU: verdict, effects, misfit, what was delivered, and how it was found."""

    kind: Literal["fmu"] = "fmu"
    verdict: str
    statement: str = ""
    trust: TrustFound | None = None
    effects: tuple[EffectFound, ...] = ()
    suspects: tuple[str, ...] = ()
    parameters: dict[str, ParameterFound] = msgspec.field(default_factory=dict)
    misfit: dict[str, OutputFound] = msgspec.field(default_factory=dict)
    validation: dict[str, OutputFound] = msgspec.field(default_factory=dict)
    remainder: LeftFound | None = None
    where: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    settings: dict[str, Any] = msgspec.field(default_factory=dict)
    candidates: tuple[BoxStepFound, ...] = ()
    model: str | None = None
    delivery: tuple[DeliveredFound, ...] = ()
    step_cost: float | None = None
    walls: str = ""
    runs: int | None = None
    seconds: float | None = None


class LearnedParameterFound(ParameterFound, frozen=True):
    """A calibrated parameter; ``learned`` is the share of its stated uncertainty that the record removes."""

    learned: float | None = None


class CalibratedOutputFound(msgspec.Struct, frozen=True):
    """Rms of simulated minus measured of one output over its noise, before and after; ``noise`` in ``unit``."""

    nominal: float | None
    calibrated: float | None
    noise: float | None
    unit: str = ""


class BoxCalibrationFound(Found, frozen=True, kw_only=True):
    """``calibrate``: parameters, what the record does not tell apart, and the misfit."""

    explained: bool
    trust: TrustFound | None = None
    parameters: dict[str, LearnedParameterFound] = msgspec.field(default_factory=dict)
    not_told_apart: tuple[tuple[str, str], ...] = ()
    misfit: dict[str, CalibratedOutputFound] = msgspec.field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    settings: dict[str, Any] = msgspec.field(default_factory=dict)
    seconds: float | None = None
    walls: str = ""
