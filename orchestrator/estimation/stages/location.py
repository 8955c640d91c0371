"""What the fits of a train say: in which stage the gap is, and how large it can be in each.

An answer is "1", "2" or "both". It is excluded where its best fit falls behind the free one by more than a decisive
log-likelihood. Both stages always fit at least as well as one alone; so "both" is judged by the best fit in which each
stage has a notable share of the gap. What is left is the answer, a set where the record does not tell.
"""

import math
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.estimation.description import autocorrelation, block_variance, stillness_note
from orchestrator.estimation.effort import Effort, Report, Stop, never
from orchestrator.estimation.filter.innovations import count_traversals
from orchestrator.estimation.likelihood import Fit, Likelihood
from orchestrator.estimation.problem import measurement_noise
from orchestrator.estimation.settings import DEFAULT_SETTINGS, EstimationSettings, StageSettings
from orchestrator.estimation.stages.fit import GRID, StageFits, fit_stages
from orchestrator.estimation.stages.problem import ENCODERS, GAPS, OFFSET, SHARE, TOTAL, make_problem
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.arrays import Array
from orchestrator.shared.inference.normal import NORMAL_95, interval_95

FIRST, SECOND, BOTH = "1", "2", "both"
Interval = tuple[float, float]


@dataclass(frozen=True)
class StageGap:
    """A half-gap [rad] with its 95 % interval; NaN where the record tells no more than the interval."""

    alpha: float
    interval: Interval


@dataclass(frozen=True)
class Location:
    """Where the gap of a train is."""

    answers: tuple[str, ...]  # what the record leaves possible, of "1", "2" and "both"; none where it shows no gap
    total: StageGap  # both half-gaps, seen from the load
    stages: tuple[StageGap, StageGap]  # half-gap of each stage, at its gear's output
    behind: dict[str, float]  # by how much log-likelihood the best fit of each answer falls behind the best of all
    converged: bool  # whether the free fit did
    # whether the torque noise of the free fit is as little as that of a right model, and its size one that is looked
    # for
    explained: bool
    traversals: int  # changes of flank of either stage
    autocorrelation: tuple[float, float]  # of the one-step errors of motor and load encoder
    parameters: dict[str, dict[str, float]]  # value, standard error and nominal of each fitted unknown
    curves: dict[str, Array] = field(repr=False)  # arrays for the plots, by name

    @property
    def answer(self) -> str:
        """The answers in words: "stage 1", "both stages", "stage 1 or both stages", "nowhere seen"."""
        words = [BOTH + " stages" if answer == BOTH else f"stage {answer}" for answer in self.answers]
        return ", ".join([*words[:-2], " or ".join(words[-2:])]) if words else "nowhere seen"


def locate_gap(
    record: Record,
    model: Model,
    settings: EstimationSettings = DEFAULT_SETTINGS,
    time_limit: float = math.inf,
    report: Report = lambda what, share: None,
    stop: Stop = never,
) -> Location:
    """Return where the gap of a ``TwoStageTrain`` is, by a record with torque and both angles.

    ``time_limit``: [s], after which the fit is given up; ``report`` and ``stop`` as of ``maximum_likelihood``.

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
    likelihood = Likelihood(problem, 1, settings, effort)
    return locate(fit_stages(likelihood, settings.stages, report), settings.stages)


def locate(fits: StageFits, settings: StageSettings) -> Location:
    """Return what the fits of a record say."""
    behind = {
        name: 0.5 * (fit.point.objective - fits.free.point.objective)
        for name, fit in ((FIRST, fits.first), (SECOND, fits.second), (BOTH, fits.both))
    }
    share = fits.free.likelihood.parameters(fits.free.point.theta)[SHARE]
    explained = _torque_noise(fits.free) <= settings.unexplained and fits.free.size <= GRID[-1]
    answers = _possible_answers(behind, share, settings)
    if not explained:  # how far such fits are apart says nothing
        answers = [FIRST, SECOND, BOTH]
    scatter = _scatter(fits.free, [fits.free.slope()], settings.most_scatter)
    factors = {FIRST: settings.misfit_widening, SECOND: settings.misfit_widening, BOTH: settings.widening_of_both}
    wider = {name: max(factor**2, scatter) for name, factor in factors.items()}
    if BOTH in answers:
        wider[BOTH] = max(wider[BOTH], _scatter(fits.both, _gradients(fits.both)[1], settings.most_scatter))
    ways = {FIRST: fits.first, SECOND: fits.second, BOTH: fits.both}
    within = settings.shared <= share <= 1.0 - settings.shared
    if BOTH in answers and (within or behind[BOTH] > settings.decisive):
        ways[BOTH] = fits.free
    sizes = [_sizes(ways[answer], wider[answer]) for answer in answers if answer != BOTH]
    if BOTH in answers:
        sizes.append(_sizes_of_all(ways[BOTH], fits.shared, wider[BOTH]))
    nearest = min(answers, key=lambda answer: ways[answer].point.objective)
    best, total = ways[nearest], _total(ways[nearest], wider[nearest])
    stages = [_join([each[n] for each in sizes]) for n in range(2)]
    if len(answers) == 1 and answers[0] != BOTH:
        absent = 1 if answers[0] == FIRST else 0
        stages[absent] = StageGap(0.0, (0.0, _sizes(fits.free, wider[answers[0]])[absent].interval[1]))
    kept = best.likelihood.run(best.point.theta, keep=True)
    traversals = sum(count_traversals(flanks) for flanks in kept.contacts.T)
    if not _total(best, settings.misfit_widening**2).interval[0] > 0.0 or traversals == 0:
        answers = []
    white = kept.errors / np.sqrt(kept.variances)
    return Location(
        tuple(answers),
        total,
        (stages[0], stages[1]),
        behind,
        fits.free.converged,
        explained,
        traversals,
        (autocorrelation(white[:, 0]), autocorrelation(white[:, 1])),
        best.parameters(),
        _curves(best, kept.states, kept.contacts, kept.errors),
    )


def _possible_answers(behind: dict[str, float], share: float, settings: StageSettings) -> list[str]:
    """Return the answers that are left, by how far each falls behind and by the share of stage 2 in the free fit."""
    answers = [name for name in (FIRST, SECOND, BOTH) if behind[name] <= settings.decisive]
    if {FIRST, SECOND} <= set(answers):  # what lies between two that are possible is no less so
        return [FIRST, SECOND, BOTH]
    if {FIRST, SECOND} & set(answers):
        return answers
    # A share that nobody would mend is none: a contact that differs from the model's makes one of a thousandth.
    nearest, other = (FIRST, share) if share < 0.5 else (SECOND, 1.0 - share)
    if other < settings.negligible:
        return [nearest, *answers]
    return [BOTH]


def _torque_noise(fit: Fit) -> float:
    """Return the torque noise of motor or load, whichever is more, over the drive's torque there [s^0.5]."""
    motor, _, load = np.divide(fit.likelihood.noise(fit.point.theta).torque, fit.likelihood.problem.units)
    return float(max(motor, load))


def _scatter(fit: Fit, slopes: Iterable[Array], most: float) -> float:
    """Return by what the variance of values among blocks of the record exceeds that of white errors, at most."""
    blocks = fit.likelihood.settings.verdict.blocks
    return min(max(block_variance(fit, slope, blocks) for slope in slopes), most)


def _gradients(fit: Fit) -> tuple[Array, Array]:
    """Return both half-gaps (2,) [rad] and their derivatives by the free unknowns (2, k)."""
    likelihood, theta = fit.likelihood, fit.point.theta
    problem = likelihood.problem
    total, share = theta[problem.index(TOTAL)], theta[problem.index(SHARE)]
    p = likelihood.parameters(theta)
    ratio = p["i_2"]
    by = {
        TOTAL: ((1.0 - share) * ratio, share),
        SHARE: (-total * ratio, total),
        "i_2": (total * (1.0 - share), 0.0),
    }
    names = [problem.names[n] for n in fit.free]
    slopes = np.array([by.get(name, (0.0, 0.0)) for name in names]).T
    return np.array([p[name] for name in GAPS]), slopes


def _sizes(fit: Fit, wider: float) -> tuple[StageGap, StageGap]:
    """Return the half-gap of each stage by one fit."""
    values, slopes = _gradients(fit)
    reach = NORMAL_95 * np.sqrt(wider * np.einsum("ij,jk,ik->i", slopes, fit.covariance, slopes))
    most = _total(fit, wider).interval[1] * np.array([fit.likelihood.parameters(fit.point.theta)["i_2"], 1.0])
    first, second = (
        StageGap(float(value), (max(float(value - half), 0.0), min(float(value + half), float(end))))
        for value, half, end in zip(values, reach, most, strict=True)
    )
    return first, second


def _sizes_of_all(best: Fit, optima: Sequence[Fit], wider: float) -> tuple[StageGap, StageGap]:
    """Return the half-gap of each stage by the best fit; the intervals hold those of all that are about as good."""
    limit = best.point.objective + NORMAL_95**2 * wider
    alike = [_sizes(fit, wider) for fit in optima if fit.point.objective <= limit]
    first, second = (
        replace(own, interval=_join([own, *(each[n] for each in alike)]).interval)
        for n, own in enumerate(_sizes(best, wider))
    )
    return first, second


def _total(fit: Fit, wider: float) -> StageGap:
    return StageGap(fit.size, interval_95(fit.size, math.sqrt(wider) * fit.size_deviation, 0.0))


def _join(gaps: list[StageGap]) -> StageGap:
    """Return a half-gap that is one of several."""
    if len(gaps) == 1:
        return gaps[0]
    return StageGap(math.nan, (min(gap.interval[0] for gap in gaps), max(gap.interval[1] for gap in gaps)))


def _curves(fit: Fit, states: Array, contacts: NDArray[np.int64], errors: Array) -> dict[str, Array]:
    """Return twists [rad] and flanks (-1, 0, 1) of both stages, and one-step errors [rad], each (n,)."""
    p = fit.likelihood.parameters(fit.point.theta)
    record = fit.likelihood.problem.record
    curves: dict[str, Any] = {
        "time": record.time,
        "u": record.u,
        "theta_m": record.theta_m,
        "theta_l": fit.likelihood.problem.outputs[:, 1],
        "theta_m_fitted": states[:, 0],
        "theta_l_fitted": states[:, 4] + p[OFFSET],
        "twist_1": states[:, 0] / p["i_1"] - states[:, 2],
        "twist_2": states[:, 2] / p["i_2"] - states[:, 4],
        "contact_1": contacts[:, 0].astype(float),
        "contact_2": contacts[:, 1].astype(float),
        "one_step_error_m": errors[:, 0],
        "one_step_error_l": errors[:, 1],
    }
    return curves
