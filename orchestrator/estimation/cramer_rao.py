"""The Cramer-Rao bound of a record: how well any unbiased estimator could measure the gap from it."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from orchestrator.estimation.information import inverse
from orchestrator.estimation.joint import make_likelihood
from orchestrator.estimation.problem import ALPHA, OFFSET, STATE_NAMES, GapProblem, make_problem
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.arrays import Array

MODEST_TORQUE_NOISE = 1e-2  # N.m.s^0.5, where no fit has told
NOISE_PREFIXES = ("log_noise_", "log_torque_")


def error_bound(
    problem: GapProblem | Sequence[GapProblem],
    values: Mapping[str, float],
    noise: tuple[float, ...],
    torque: float = 1e-8,
    threads: int = 1,
) -> float:
    """Return the bound [rad] on alpha at known true ``values`` of the unknowns, for a deterministic plant.

    ``noise``: true standard deviation [rad] of each encoder, rounding included.
    """
    likelihood = make_likelihood([problem] if isinstance(problem, GapProblem) else problem, threads)
    problem = likelihood.problem
    theta = problem.start
    for name, value in values.items():
        if name in problem.names:
            theta[problem.index(name)] = value
    for n, name in enumerate(problem.names):
        if name.startswith("log_torque_"):
            theta[n] = math.log(torque)
        elif name.startswith("log_noise_"):
            theta[n] = math.log(noise[0] if name.endswith("theta_m") else noise[1])
    free = np.array([n for n, name in enumerate(problem.names) if not name.startswith(NOISE_PREFIXES)])
    point = likelihood.at(theta)
    for _ in range(4):  # differences that match the standard errors which they imply
        _, information, likelihood = likelihood.derivatives(point, free)
    column = list(free).index(problem.index(ALPHA))
    return math.sqrt(inverse(information)[column, column])


def truth_values(linear: Mapping[str, float], alpha: float, *states: Array) -> dict[str, float]:
    """Return true values by the names of the unknowns: linear parameters, half-gap [rad] and initial states (5,)."""
    values = {**linear, ALPHA: alpha, OFFSET: 0.0}
    for number, state in enumerate(states, start=1):
        names = STATE_NAMES if number == 1 else [f"{name}@{number}" for name in STATE_NAMES]
        values |= dict(zip(names, map(float, state), strict=True))
    return values


def error_bound_at(record: Record, model: Model, alpha: float) -> float:
    """Return the bound [rad] for a half-gap [rad] on a record, for the nominal plant and modest torque noise."""
    problem = make_problem(record, model)
    noise = tuple(math.exp(u.mean) for u in problem.unknowns if u.name.startswith("log_noise_"))
    return error_bound(problem, {ALPHA: alpha}, noise, MODEST_TORQUE_NOISE)
