"""What one method says of a record, and the entries that show it."""

import math
from dataclasses import dataclass

from orchestrator.estimation.protocol import LEVEL, Estimate
from orchestrator.records.record import Record
from orchestrator.shared.results.estimate import MethodFound, RecordFound
from orchestrator.shared.trust import Trust


@dataclass(frozen=True)
class MethodResult:
    """What one method says."""

    method: str
    estimate: Estimate | None  # the estimate, or None where the method does not apply
    bound: float  # the record's Cramer-Rao bound on the standard error [rad]
    seconds: float  # wall time [s]
    reason: str = ""  # why the method does not apply, or empty
    trust: Trust | None = None  # how far the estimate can be trusted, or None where there is none


def describe_record(record: Record) -> RecordFound:
    """Return rows, step, source of a record, and what was detected and assumed when it was read."""
    return RecordFound(
        record.size, record.step, record.source, record.n_missing, (*record.doubts, *record.notes), record.angle_unit
    )


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def method_entry(result: MethodResult) -> MethodFound:
    """Return what ``estimate.json`` says of a method."""
    estimate = result.estimate
    if estimate is None:
        return MethodFound(not_applicable=result.reason)
    return MethodFound(
        alpha=_number(estimate.alpha),
        standard_error=_number(estimate.standard_error),
        cramer_rao=_number(result.bound),
        interval=estimate.interval,
        level=LEVEL,
        unit="rad",
        visible=estimate.visible,
        message=estimate.message,
        trust=None if result.trust is None else result.trust.to_result(),
        seconds=result.seconds,
        diagnostics=dict(estimate.diagnostics),
    )
