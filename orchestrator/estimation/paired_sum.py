"""The thesis's method on a measured record: the sum of differences to a twin without backlash.

The twin is the nominal plant fed with the record's torque. S = mean |theta_l(record) - theta_l(twin)|; the map from S
to alpha comes from the same twin with known gaps. It has no way to tell a gap from any other difference between the
machine and the twin, so on a real machine it is far off: it is here for comparison.
"""

import math

import numpy as np

from orchestrator.estimation.innovations import affine_model, simulate
from orchestrator.estimation.likelihood import measurement_noise
from orchestrator.estimation.protocol import Estimate, NotApplicableError
from orchestrator.model_file import Model
from orchestrator.record import Record
from pyfmu_sources.drivetrain_parameters import P_ALPHA

SIZES = (0.0, *(3e-4 * 1.25**n for n in range(34)))  # to half a radian


def estimate(record: Record, model: Model) -> Estimate:
    """Return the half-gap at which the twin with a gap differs from the twin without one as much as the record does.

    Raises:
        NotApplicableError: there is no load encoder.
    """
    if record.theta_l is None:
        raise NotApplicableError("this method needs the load's angle `theta_l`")
    x0 = np.array([record.theta_m[0], 0.0, record.theta_l[0], 0.0, 0.0])
    runs = []
    for alpha in SIZES:
        p = list(model.values)
        p[P_ALPHA] = alpha
        runs.append(simulate(affine_model(tuple(p)), record.u, record.step, x0)[:, 2])
    sums = np.array([float(np.mean(np.abs(run - runs[0]))) for run in runs])
    monotone = np.maximum.accumulate(sums)
    measured = float(np.mean(np.abs(record.theta_l - runs[0])))
    beyond = measured > monotone[-1]
    alpha = float(np.interp(measured, monotone, SIZES))
    slope = float(np.interp(measured, monotone, np.gradient(monotone, SIZES)))
    noise = measurement_noise(record, model, "theta_l") / math.sqrt(record.size)
    error = noise / slope if slope > 0.0 else math.inf
    message = "the twin differs from the machine by more than any gap explains" if beyond else ""
    diagnostics = {"sum": measured, "largest_sum": float(monotone[-1])}
    low, high = max(alpha - 1.96 * error, 0.0), alpha + 1.96 * error
    return Estimate("paired_sum", alpha, error, (low, high), not beyond, message, diagnostics)
