"""One method applied to records: what each of :data:`METHODS` takes of them, and which options its function has."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.estimation import cramer_rao
from orchestrator.estimation.protocol import FITTED, WITHOUT_TORQUE, Estimate, NotApplicableError, estimator
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record

SKIPS_MISSING = (FITTED, "ekf", WITHOUT_TORQUE)
OPTIONS = {FITTED: ("more", "time_limit", "report", "settings", "stop"), WITHOUT_TORQUE: ("settings",)}
"""Arguments of a method's function beside record and model; ``more``: further records, fitted with the first."""
UNSEEN = 1.0  # rad, bound from which on a record says nothing


def default_method(records: Sequence[Record]) -> str:
    """Return the method for records when none is asked for."""
    return FITTED if all(record.has_torque for record in records) else WITHOUT_TORQUE


def apply_method(name: str, records: Sequence[Record], model: Model, options: Mapping[str, Any]) -> Estimate:
    """Return the estimate of one method, which takes its own of the ``options``, and may not apply to such records."""
    record, *more = records
    taken = OPTIONS.get(name, ())
    if name != WITHOUT_TORQUE and not all(one.has_torque for one in records):
        raise NotApplicableError("needs the torque `u`, which the record does not have")
    if more and "more" not in taken:
        raise NotApplicableError(f"takes one record; several are fitted together by {FITTED}")
    if record.n_missing and name not in SKIPS_MISSING:
        raise NotApplicableError(f"takes records without missing samples, but {record.n_missing} rows have some")
    given = {**options, "more": more}
    return estimator(name)(record, model, **{option: given[option] for option in taken})


def error_bound(record: Record, model: Model, estimates: Sequence[Estimate]) -> float:
    """Return the record's Cramer-Rao bound [rad]: at the fit of the likelihood, or else at the newest estimate."""
    for estimate in estimates:
        if "cramer_rao" in estimate.diagnostics:
            return float(estimate.diagnostics["cramer_rao"])
    if not (record.has_torque and estimates[-1].visible):
        return math.inf
    bound = cramer_rao.error_bound_at(record, model, estimates[-1].alpha)
    return bound if bound < UNSEEN else math.inf
