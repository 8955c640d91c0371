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
from orchestrator.diagnosis.fit.reference import Reference, Start
from orchestrator.errors import ConvergenceError
from orchestrator.estimation.joint import JointLikelihood
from orchestrator.estimation.likelihood import GapFit, Likelihood
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


def gap_of_the_estimator(
    likelihood: RecordLikelihood, model: Model, part: slice, deadline: float
) -> Reference | None:  # fmt: skip
    """Return the model with the gap that the estimator finds in a part of a record, and where the record begins.

    Args:
        likelihood: of a record of the motor's encoder alone.
        model: what the record is compared with.
        part: the samples that may be fitted.
        deadline: by the monotonic clock [s].

    Returns:
        The model; without a start where the part is not the record's beginning. None: it found none, or not in time, or
        the plant is not its own.
    """
    if likelihood.plant is not PLANT:
        return None
    signals, begins = likelihood.signals, part.start <= likelihood.settings.likelihood.head
    problems = [
        make_problem(
            Record(signals.h * np.arange(rows.stop - rows.start), signals.u[rows], signals.y[rows, 0].copy()), model
        )
        for rows in signals.stretches(slice(0, part.stop) if begins else part)
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
    return Reference(p, _starts(fit, len(problems)) if begins else ())


def _starts(fit: GapFit, records: int) -> tuple[Start, ...]:
    """Return where each record begins, by a fit of the estimator."""
    names, found = fit.likelihood.problem.names, []
    free = fit.free.tolist()
    for number in range(1, records + 1):
        own = [name if number == 1 else f"{name}@{number}" for name in (PLANT.starts[s] for s in PLANT.states)]
        places = [names.index(name) for name in own]
        rows = [free.index(place) for place in places]
        found.append(Start(fit.point.theta[places], fit.covariance[np.ix_(rows, rows)]))
    return tuple(found)
