"""What ``inspect.json`` holds: channels, excitation, and the gaps and effects that a record would show."""

import msgspec

from orchestrator.shared.results import ResultData
from orchestrator.shared.results.estimate import ExcitationFound, MethodFound, RecordFound


class ChannelFound(msgspec.Struct, frozen=True):
    """A column: range, noise and rounding in ``unit``; the share at the ends of its range, missing samples."""

    name: str
    unit: str
    least: float | None
    most: float | None
    count: float | None
    noise: float | None
    saturated: float
    missing: int


class BandFound(msgspec.Struct, frozen=True):
    """The share of the torque's power between two frequencies [Hz], and the coherence of the motor with it."""

    low: float
    high: float
    share: float
    coherence: float | None


class ReversalsFound(msgspec.Struct, frozen=True):
    """Sign changes; None for a torque that the log does not have."""

    torque: int | None
    motor_speed: int


class LagFound(msgspec.Struct, frozen=True):
    """By how much the load's angle lags the motor's."""

    value: float
    standard_error: float
    unit: str = "s"


class GapShown(msgspec.Struct, frozen=True):
    """A half-gap and the bound on its standard error [rad], and whether the record would show it."""

    half_gap: float
    bound: float | None
    seen: bool


class EffectShown(msgspec.Struct, frozen=True):
    """The smallest size of an effect that the record would show."""

    name: str
    smallest: float | None
    unit: str


class InspectFound(ResultData, frozen=True, kw_only=True):
    """``inspect``: the record, what it would show, what was assumed, and the verdict in sentences."""

    record: RecordFound
    channels: tuple[ChannelFound, ...]
    excitation: tuple[BandFound, ...]
    reversals: ReversalsFound
    delay: LagFound | None
    smallest_gap: float | None
    gaps: tuple[GapShown, ...]
    effects: tuple[EffectShown, ...]
    better_experiments: tuple[ExcitationFound, ...]
    assumed: tuple[str, ...]
    verdict: tuple[str, ...]
    two_angles: MethodFound | None = None
