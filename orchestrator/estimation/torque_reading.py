"""Whether a torque with rows of its own is held from one to the next, or sampled from a signal that never rests."""

from orchestrator.estimation.likelihood import Fit, maximise
from orchestrator.estimation.problem import SAMPLED, GapProblem

HELD, SMOOTH = 0.0, 1.0


def settle_torque(fit: Fit) -> Fit:
    """Return the fit under the one reading of each record's torque that explains it, where only one does."""
    names = fit.likelihood.problem.names
    for place in [n for n, name in enumerate(names) if name.partition("@")[0] == SAMPLED and n in fit.free]:
        held, sampled = (_refit(fit, place, reading) for reading in (HELD, SMOOTH))
        better, other = sorted((held, sampled), key=lambda trial: trial.point.objective)
        if other.point.objective - better.point.objective > fit.likelihood.settings.fit.settled:
            fit = better
    return fit


def _refit(fit: Fit, place: int, reading: float) -> Fit:
    """Return the fit, its values moved, with a reading of the torque at ``place`` of the unknowns."""
    problem = fit.likelihood.problem.with_unknown(place, mean=reading, lower=reading, upper=reading)
    likelihood = fit.likelihood.with_options(problem=problem)
    start = fit.point.theta.copy()
    start[place] = reading
    return maximise(likelihood, start, [n for n in fit.free if n != place], tolerance=2e-3)


def torque_words(problem: GapProblem) -> str:
    """Return what a fit says of a torque with rows of its own; empty where it is held, or has none."""
    readings = [
        (unknown.lower, unknown.upper) for unknown in problem.unknowns if unknown.name.partition("@")[0] == SAMPLED
    ]
    if any(low < high for low, high in readings):
        return "the record does not tell whether `u` is held or was sampled: the values allow for both"
    if (SMOOTH, SMOOTH) in readings:
        return "`u` is read as a signal that was sampled: held from row to row it does not explain the motion"
    return ""
