"""How long a fit will take, before it starts."""

import time
from collections.abc import Sequence

from orchestrator.estimation.likelihood import Likelihood
from orchestrator.estimation.problem import make_problem
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record

RUNS = 800.0  # of the filter, that a fit of twenty unknowns with its interval takes
PROBED_ROWS = 1000


def estimate_seconds(records: Sequence[Record], model: Model, threads: int = 2) -> float:
    """Return about how long ``maximum_likelihood`` will take [s], from the time of one run over some rows."""
    probe = records[0].part(0, min(records[0].size, PROBED_ROWS))
    problem = make_problem(probe, model)
    likelihood, start = Likelihood(problem), problem.start
    likelihood.run(start)  # compiles
    begun = time.perf_counter()
    for _ in range(3):
        likelihood.run(start)
    per_row = (time.perf_counter() - begun) / (3.0 * probe.size)
    return per_row * sum(record.size for record in records) * RUNS / threads
