"""Where the gap of a train is, from one record: the entry of this room."""

import math
import time

from orchestrator.errors import RecordError
from orchestrator.estimation.description import stillness_note
from orchestrator.estimation.effort import Effort, Stop, never
from orchestrator.estimation.problem import measurement_noise
from orchestrator.estimation.settings import DEFAULT_SETTINGS, EstimationSettings
from orchestrator.estimation.stages.fit import Report, fit_stages
from orchestrator.estimation.stages.likelihood import StagesLikelihood
from orchestrator.estimation.stages.location import Location, locate
from orchestrator.estimation.stages.problem import ENCODERS, make_problem
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record


def locate_gap(
    record: Record,
    model: Model,
    settings: EstimationSettings = DEFAULT_SETTINGS,
    time_limit: float = math.inf,
    report: Report = lambda what, share: None,
    stop: Stop = never,
) -> Location:
    """Return where the gap of a train of two stages is.

    Args:
        record: with torque and the angles of motor and load.
        model: of a ``TwoStageTrain``.
        time_limit: [s], after which the fit is given up.
        report: called with what is done, and the share of the work that lies behind.
        stop: returns why the work is to end; it is asked before each run of the filter.

    Raises:
        RecordError: motor or load hardly moves.
        ConvergenceError: no fit is found, or not within the time limit.
    """
    problem = make_problem(record, model)
    motor, load = (measurement_noise(record, model, name) for name in ENCODERS)
    still = stillness_note(problem.outputs, (motor, load), settings.verdict)
    if still:
        raise RecordError(f"{record.source}: {still.split(';')[0]}: log a motion that reverses")
    effort = Effort(time.monotonic() + time_limit, stop)
    likelihood = StagesLikelihood(problem, 1, settings, effort)
    return locate(fit_stages(likelihood, settings.stages, report), settings.stages)
