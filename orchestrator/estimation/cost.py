"""How much processor time a fit will take, before it starts."""

import time
from collections.abc import Sequence

import numpy as np

from orchestrator.estimation.likelihood import Likelihood
from orchestrator.estimation.problem import make_problem
from orchestrator.estimation.settings import DEFAULT_SETTINGS, EstimationSettings
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record

# Of the filter over a record: most fits take 800 to 2400, and a quarter more for all that is between them.
RUNS = 3000.0
RUNS_OF_LONG = 0.5  # share of them over the whole of a record whose beginning was fitted first
BESIDES = 5.0  # s, for a start, figures and files
PROBED_ROWS = 1000
PROBED_SIZES = (3e-4, 1.3e-3, 6e-3, 0.025, 0.11)  # half-gaps [rad]: contacts are what a run takes its time for


def fit_seconds(records: Sequence[Record], model: Model, settings: EstimationSettings = DEFAULT_SETTINGS) -> float:
    """Return about how much processor time [s] ``maximum_likelihood`` will take, from some runs over some rows."""
    probe = records[0].part(0, min(records[0].size, PROBED_ROWS))
    problem = make_problem(probe, model)
    likelihood, theta = Likelihood(problem), problem.start
    gap = problem.index("alpha")
    with np.errstate(all="ignore"):
        likelihood.run(theta)  # compiles
        begun = time.process_time()
        for theta[gap] in PROBED_SIZES:
            likelihood.run(theta)
    per_row = (time.process_time() - begun) / (len(PROBED_SIZES) * probe.size)
    rows = float(sum(record.size for record in records))
    if rows > settings.fit.long_record:
        rows = settings.fit.short_record + RUNS_OF_LONG * rows
    return BESIDES + per_row * rows * RUNS
