"""The gap from the angles of motor and load alone, without a torque or a plant.

While teeth touch, the load's angle follows the motor's over the gear ratio, half a gap behind or ahead; see
``orchestrator.estimation.flanks`` and ``docs/estimation.md``. The interval is a jackknife over blocks of the record,
and allows for the shape of the noise, which is not normal.
"""

import math
from typing import Any

import numpy as np

from orchestrator.estimation.filter.innovations import count_traversals
from orchestrator.estimation.flanks.fit import ALPHA, FlankProblem, best_fit, jackknife
from orchestrator.estimation.flanks.points import points_of
from orchestrator.estimation.protocol import LEVEL, Estimate, NotApplicableError
from orchestrator.estimation.settings import DEFAULT_SETTINGS, EstimationSettings
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record

LEAST_POINTS = 50
RETURNED = 2  # traversals: a flank that is left and met again is no slip
WOUND_UP = "without a torque, what the shaft winds up when its torque changes sign cannot be told from a gap"


def estimate(record: Record, model: Model, settings: EstimationSettings = DEFAULT_SETTINGS) -> Estimate:
    """Return half the distance between the two flanks in the load's angle against the motor's."""
    limits = settings.flanks
    if record.theta_l is None:
        raise NotApplicableError("the load's angle `theta_l` must be in the record")
    points = points_of(record, limits.latest, limits.most_points)
    if points.time.size < LEAST_POINTS:
        raise NotApplicableError(
            f"the load's angle must change in at least {LEAST_POINTS} rows, but does in {points.time.size}"
        )
    problem = FlankProblem(points, limits)
    fit = best_fit(problem)
    noise = math.sqrt(fit.variance)
    flanks = np.argmax(fit.share, axis=1) - 1
    traversals = count_traversals(flanks)
    separate = fit.alpha / noise
    touching = float(1.0 - fit.share[:, 1].mean())
    count = max(points.count, points.motor.count / abs(fit.ratio))
    apart = separate >= limits.separate and fit.alpha >= limits.least_counts * count
    two = apart and touching >= limits.least_touching
    diagnostics: dict[str, Any] = {
        "traversals": traversals,
        "level": LEVEL,
        "noise": noise,
        "half_gap_in_noise": separate,
        "touching": touching,
        "count": count,
        "points": int(points.time.size),
        "converged": fit.converged,
    }
    curves = {"time": points.time, "twist": problem.twist(fit), "flank": flanks}
    if not two or traversals < RETURNED:
        return _unseen(diagnostics, curves, traversals if two else 0)
    (of_alpha, of_late, of_ratio), quantile = jackknife(problem, fit)
    shape = limits.shape * noise
    error = math.hypot(max(of_alpha, math.sqrt(fit.covariance[ALPHA, ALPHA])), shape)
    reach = quantile * error
    diagnostics |= {
        "load_late": {"value": fit.late, "standard_error": float(of_late), "unit": "s"},
        "parameters": {
            "i": {"value": fit.ratio, "standard_error": float(of_ratio), "nominal": model.parameters["i"].value}
        },
    }
    message = (
        f"the load's channel is {1e3 * abs(fit.late):.3g} ms {'late' if fit.late >= 0.0 else 'early'} (standard error "
        f"{1e3 * of_late:.2g} ms), "
        f"the gear ratio {fit.ratio:.6g}; {WOUND_UP}"
    )
    return Estimate(
        "two_encoders", fit.alpha, error, (max(fit.alpha - reach, 0.0), fit.alpha + reach), fit.alpha > reach, message,
        diagnostics, curves,
    )  # fmt: skip


def _unseen(diagnostics: dict[str, Any], curves: dict[str, Any], traversals: int) -> Estimate:
    """Return the estimate of a record that does not show two flanks."""
    message = (
        "the gap cannot be seen: the load's angle keeps one distance from the motor's, so either one flank is loaded "
        "throughout or the gap is lost in the noise; let the load's torque change its direction several times"
        if traversals == 0
        else f"the gap cannot be seen: the flank changes {traversals} time(s) only, which a slip would do too; let the "
        "load's torque change its direction several times"
    )
    return Estimate("two_encoders", math.nan, math.inf, (0.0, math.inf), False, message, diagnostics, curves)
