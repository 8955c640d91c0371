"""One likelihood of several records of a machine: the parameters, the gap and the noise are common to all.

Each record has an initial state of its own, and an angle between its encoders' zeros, which may have been set anew.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from orchestrator.estimation.effort import Effort
from orchestrator.estimation.filter.innovations import Innovations, count_traversals
from orchestrator.estimation.likelihood import Likelihood
from orchestrator.estimation.problem import OFFSET, SAMPLED, SMOOTH, STATE_NAMES, GapProblem
from orchestrator.estimation.protocol import Estimate
from orchestrator.estimation.settings import DEFAULT_SETTINGS, EstimationSettings
from orchestrator.records.record import Record
from orchestrator.shared.arrays import Array

OWN = (*STATE_NAMES, OFFSET, SAMPLED, SMOOTH)  # the unknowns that each record has for itself


def _joint_problem(problems: Sequence[GapProblem]) -> GapProblem:
    """Return the problem of several records; its record is the first, its outputs are all, each about its mean.

    Unknowns of the later records carry their number: ``theta_m_start@2``. A noise level's prior is that of the records'
    mean.
    """
    first = problems[0]
    unknowns = []
    for n, unknown in enumerate(first.unknowns):
        if unknown.name.startswith("log_noise_"):
            mean = float(np.mean([problem.unknowns[n].mean for problem in problems]))
            moved = mean - unknown.mean
            unknowns.append(replace(unknown, mean=mean, lower=unknown.lower + moved, upper=unknown.upper + moved))
        else:
            unknowns.append(unknown)
    for number, problem in enumerate(problems[1:], start=2):
        unknowns += [replace(u, name=f"{u.name}@{number}") for u in problem.unknowns if u.name in OWN]
    outputs = np.vstack([problem.outputs - np.nanmean(problem.outputs, axis=0) for problem in problems])
    return replace(first, unknowns=tuple(unknowns), outputs=outputs)


class JointLikelihood(Likelihood):
    """The likelihood of several records: their innovations one after the other."""

    def __init__(
        self,
        problems: Sequence[GapProblem],
        threads: int = 1,
        settings: EstimationSettings = DEFAULT_SETTINGS,
        effort: Effort | None = None,
    ) -> None:
        super().__init__(_joint_problem(problems), threads, settings, effort)
        names = self.problem.names
        self._parts = [Likelihood(problem) for problem in problems]
        self._own = [
            np.array(
                [names.index(f"{u.name}@{number}" if number > 1 and u.name in OWN else u.name) for u in p.unknowns]
            )
            for number, p in enumerate(problems, start=1)
        ]

    def run(self, theta: Array, keep: bool = False) -> Innovations:
        """Return the innovations of all records at ``theta``."""
        self.effort.check()
        runs = []
        for part, places in zip(self._parts, self._own, strict=True):
            runs.append(part.with_options(soft=self.soft).run(theta[places], keep))
        return Innovations(
            np.concatenate([run.errors for run in runs]),
            np.concatenate([run.variances for run in runs]),
            np.concatenate([run.states for run in runs]),
            np.concatenate([run.contacts for run in runs]),
        )


def make_likelihood(
    problems: Sequence[GapProblem],
    threads: int = 1,
    settings: EstimationSettings = DEFAULT_SETTINGS,
    effort: Effort | None = None,
) -> Likelihood:
    """Return the likelihood of one record, or the joint one of several."""
    if len(problems) > 1:
        return JointLikelihood(problems, threads, settings, effort)
    return Likelihood(problems[0], threads, settings, effort)


def by_record(estimate: Estimate, records: Sequence[Record]) -> Estimate:
    """Return a joint estimate with what each record says, and with the curves of the first one."""
    edges = np.cumsum([0, *(record.size for record in records)])
    curves, evidence = dict(estimate.curves), []
    for record, start, stop in zip(records, edges[:-1], edges[1:], strict=True):
        evidence.append(_evidence(record, estimate, int(start), int(stop)))
    for name in ("states", "contacts", "errors"):
        curves[name] = estimate.curves[name][: edges[1]]
    diagnostics = dict(estimate.diagnostics) | {"records": evidence}
    return replace(estimate, curves=curves, diagnostics=diagnostics)


def _evidence(record: Record, estimate: Estimate, start: int, stop: int) -> dict[str, object]:
    """Return how often a record traverses the gap, and how well the common values explain it."""
    errors = estimate.curves["errors"][start:stop]
    noise = estimate.diagnostics["measurement_noise"]
    return {
        "source": record.source,
        "rows": record.size,
        "missing": record.n_missing,
        "traversals": count_traversals(estimate.curves["contacts"][start:stop]),
        "one_step_error_in_noise": [float(np.sqrt(np.mean(errors[:, k] ** 2))) / noise[k] for k in range(len(noise))],
    }
