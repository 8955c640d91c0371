"""A gap before a body that has no encoder: where its fit starts, and the motion along which gains are taken.

Its likelihood has many optima, and screening, which is linear, finds a wrong one. The estimator of the gap
(:mod:`orchestrator.estimation.methods.maximum_likelihood`) finds its way down from much torque noise; the predictor
takes over its result, and takes its gains along the motion that belongs to it.
"""

import math

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.errors import ConvergenceError
from orchestrator.estimation.joint import JointLikelihood
from orchestrator.estimation.likelihood import Likelihood
from orchestrator.estimation.methods.maximum_likelihood import fit_record
from orchestrator.estimation.problem import IMPULSE, make_problem
from orchestrator.plants.known.drivetrain import PLANT
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.cores import usable_cores
from orchestrator.shared.inference.colour import colour_of

Array = NDArray[np.float64]

SHORTEST_ONSET = 1e-6  # rad: a contact whose damping sets in within less is as good as sharp


def at_the_floor(likelihood: RecordLikelihood, model: Fit, part: slice) -> bool:
    """Tell whether a model leaves nothing but measurement noise on a part of a record.

    Args:
        likelihood: of the record.
        model: the fit.
        part: the samples.

    Returns:
        True when it leaves nothing else.
    """
    lowest, white = likelihood.settings.levels[-1], colour_of(model.z, part, 0)
    floor = float(np.sum(np.log(np.diagonal(likelihood.gains(lowest).roots[part], axis1=1, axis2=2))))
    lacking = floor - likelihood.log_likelihood(model.z, model.q, part, white, model.p)
    return lacking < likelihood.settings.verdict.least_missing * (part.stop - part.start)


def gap_of_the_estimator(likelihood: RecordLikelihood, model: Model, part: slice, deadline: float) -> Array | None:
    """Return the parameters of the model with the gap that the estimator finds in a part of a record.

    Args:
        likelihood: of a record of the motor's encoder alone.
        model: what the record is compared with.
        part: the samples that may be fitted.
        deadline: by the monotonic clock [s].

    Returns:
        Parameters in the predictor's order; None: it found none, or not in time, or the plant is not its own.
    """
    if likelihood.plant is not PLANT:
        return None
    signals = likelihood.signals
    problems = [
        make_problem(
            Record(signals.h * np.arange(rows.stop - rows.start), signals.u[rows], signals.y[rows, 0].copy()), model
        )
        for rows in signals.stretches(part)
    ]
    threads = usable_cores()
    estimated = (
        Likelihood(problems[0], threads, deadline=deadline)
        if len(problems) == 1
        else JointLikelihood(problems, threads, deadline=deadline)
    )
    try:
        fit = fit_record(estimated)
    except (ConvergenceError, FloatingPointError, np.linalg.LinAlgError):
        return None
    p = likelihood.plant.extended(estimated.parameters(fit.point.theta))
    if not likelihood.is_hidden(p):
        return None
    place = likelihood.plant.index("contact.onset")
    lacking = float(fit.point.theta[estimated.problem.index(IMPULSE)]) / likelihood.plant.value(p, "c")
    p[place] = math.log(max(lacking, SHORTEST_ONSET))
    return p
