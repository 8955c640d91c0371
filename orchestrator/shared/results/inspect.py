"""What ``inspect.json`` holds: channels, excitation, and the gaps and effects that a record would show."""

from typing import Annotated

import msgspec

from orchestrator.shared.results import ResultData
from orchestrator.shared.results.estimate import ExcitationFound, MethodFound, RecordFound
from orchestrator.shared.results.fields import Display, ReportTable, fields_table


class ChannelFound(msgspec.Struct, frozen=True):
    """What a column is like, in its unit.

    ``noise`` is the standard deviation of what changes from sample to sample without motion, ``count`` the step that
    values are rounded to (0: none), ``saturated`` the share at the very ends of the range, in runs of three or more.
    """

    name: Annotated[str, Display("channel")]
    unit: Annotated[str, Display("unit")]
    least: Annotated[float | None, Display("least", digits=5)]
    most: Annotated[float | None, Display("most", digits=5)]
    count: Annotated[float | None, Display("rounded to")]
    noise: Annotated[float | None, Display("noise", digits=2)]
    saturated: Annotated[float, Display("at a limit", "%", 2, factor=100.0)]
    missing: Annotated[int, Display("missing")]


class BandFound(msgspec.Struct, frozen=True):
    """Part of the torque's power between two frequencies, and the mean coherence of the motor's angle with it."""

    low: Annotated[float, Display("from", "Hz")]
    high: Annotated[float, Display("to", "Hz")]
    share: Annotated[float, Display("share of the torque's power", "%", 3, factor=100.0)]
    coherence: Annotated[float | None, Display("coherence of the motor", digits=2)]


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
    """A half-gap, the bound on its standard error, and whether the record would show it."""

    half_gap: Annotated[float, Display("half-gap", "rad")]
    bound: Annotated[float | None, Display("bound", "rad", 3)]
    seen: Annotated[bool, Display("detectable")]


class EffectShown(msgspec.Struct, frozen=True):
    """The smallest size of an effect that the record would show."""

    name: Annotated[str, Display("effect")]
    smallest: Annotated[float | None, Display("detectable from", digits=2)]
    unit: Annotated[str, Display("unit")]


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


def inspect_tables(results: InspectFound) -> list[ReportTable]:
    """Return the tables of an inspection, the channels first; none that is empty but that."""
    coherence = "Coherence of the motor's motion with the torque in the band."
    bound = "Bound: the least standard error of any estimator. Seen: it is below a quarter of the half-gap."
    tables = [
        fields_table("Channels", results.channels, of=ChannelFound),
        fields_table("Excitation", results.excitation, coherence, of=BandFound),
        fields_table("Detectable half-gaps", results.gaps, bound, of=GapShown),
        fields_table("Detectable effects", results.effects, of=EffectShown),
    ]
    return [shown for n, shown in enumerate(tables) if n == 0 or shown.rows]
