"""The online estimator in a running position loop of the independent simulator."""

import numpy as np

from orchestrator.estimation.methods.ekf import trace
from orchestrator.records.model_file import default_model
from orchestrator.records.record import record_from_columns
from tests.support.independent_plant import make_record

RATE = 1000.0
SETTLING = 2.0  # s allowed from the first moment at which the gap has been traversed


def run_case(seed: int, alpha: float, duration: float = 4.0) -> dict:
    """Return estimate and truth of one loop, ``SETTLING`` seconds after the loop starts.

    Every linear parameter is off by up to 5 %, the contact is Hunt-Crossley, the encoders are noisy and rounded. Where
    the gap is first traversed later than one second into the loop, the clock starts one second before that.
    """
    columns, truth = make_record({"alpha": alpha}, seed, duration, RATE, excitation="closed_loop", substeps=20)
    record = record_from_columns(columns, "loop")
    run = trace(record, default_model())
    twist = truth["states"][:, 0] / truth["linear"]["i"] - truth["states"][:, 2]
    flank = np.where(twist > alpha, 1, np.where(twist < -alpha, -1, 0))
    touched = np.flatnonzero(flank)
    turns = touched[1:][np.diff(flank[touched]) != 0]
    first = float(record.time[turns[0]]) if turns.size else duration
    if first > duration - 1.0:
        return {"method": "online", "alpha": alpha, "failed": "the gap is not traversed"}
    row = min(round((max(first - 1.0, 0.0) + SETTLING) * RATE), record.size - 1)
    estimate, deviation = float(run.alpha[row]), float(run.deviation[row])
    low, high = estimate - 1.96 * deviation, estimate + 1.96 * deviation
    within = np.abs(run.alpha / alpha - 1.0) <= 0.05
    outside = np.flatnonzero(~within)
    return {
        "method": "online",
        "alpha": alpha,
        "estimate": estimate,
        "standard_error": deviation,
        "low": low,
        "high": high,
        "covered": bool(low <= alpha <= high),
        "nees": ((estimate - alpha) / deviation) ** 2,
        "first_traversal": first,
        "settled": float(record.time[outside[-1]]) if outside.size else 0.0,
        "seconds": 0.0,
        "message": "",
    }
