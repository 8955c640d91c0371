"""What one method says of a record, and the rows and entries that show it."""

import math
from dataclasses import dataclass

from orchestrator.estimation.protocol import LEVEL, Estimate
from orchestrator.records.record import Record
from orchestrator.shared.results.estimate import MethodFound, RecordFound
from orchestrator.shared.trust import Trust

HEAD = ("method", "half-gap [rad]", "trust", "95 % interval", "standard error", "Cramer-Rao")


@dataclass(frozen=True)
class MethodResult:
    """What one method says.

    Attributes:
        estimate: the estimate, or None where the method does not apply.
        bound: the record's Cramer-Rao bound on the standard error [rad].
        seconds: wall time [s].
        reason: why the method does not apply, or empty.
        trust: how far the estimate can be trusted, or None where there is none.
    """

    method: str
    estimate: Estimate | None
    bound: float
    seconds: float
    reason: str = ""
    trust: Trust | None = None


def describe_record(record: Record) -> RecordFound:
    """Return rows, step, source of a record, and what was detected and assumed when it was read."""
    return RecordFound(
        record.size, record.step, record.source, record.n_missing, (*record.doubts, *record.notes), record.angle_unit
    )


def method_row(result: MethodResult) -> list[str]:
    """Return the row of a method that applies, under ``HEAD``."""
    estimate = result.estimate
    assert estimate is not None
    low, high = estimate.interval
    name = estimate.method.replace("_", " ")
    if not estimate.visible:
        return [name, "not seen", _word(result), f"below {high:.6g}" if math.isfinite(high) else "", "", ""]
    errors = [f"{estimate.standard_error:.2g}", f"{result.bound:.2g}" if math.isfinite(result.bound) else ""]
    return [name, f"{estimate.alpha:.6g}", _word(result), f"{low:.6g} to {high:.6g}", *errors]


def _word(result: MethodResult) -> str:
    return "" if result.trust is None else result.trust.level.word


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
