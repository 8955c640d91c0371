"""Joint maximum-likelihood fit of the gap with everything else that is uncertain: the default estimator.

The one-step prediction likelihood has many optima in alpha when the filter trusts the model too much. So the fit
starts where it trusts the model little (much torque noise): there every record has one broad optimum, found on a
grid of alpha. Then the torque noise is lowered step by step for as long as the likelihood rises, each optimum
starting the next fit, and at last freed. A model that is exact ends at the deterministic output-error fit; one that
is not ends at the noise level that its flaws deserve. Without a load encoder the load's state is known too badly for
a sharp flank, so there the first fits blur it.
"""

import math
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from orchestrator.errors import ConvergenceError
from orchestrator.estimation.description import describe, describe_unfinished
from orchestrator.estimation.effort import Effort, Report, Stop, StoppedError, never
from orchestrator.estimation.filter.innovations import count_traversals
from orchestrator.estimation.joint import by_record, make_likelihood
from orchestrator.estimation.likelihood import Fit, Likelihood, maximise
from orchestrator.estimation.problem import (
    DRY,
    LATE,
    LEAST_WITH_ONE_ENCODER,
    LOAD_TORQUE,
    SCALE,
    TORQUE_OFFSET,
    make_problem,
    scale_noise,
)
from orchestrator.estimation.protocol import Estimate
from orchestrator.estimation.settings import DEFAULT_SETTINGS, EstimationSettings
from orchestrator.estimation.torque_reading import settle_torque
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.arrays import Array

GRID = (0.0, *(3e-4 * 1.28**n for n in range(31)))  # to half a radian
# Torque noise [N.m.s^0.5] of motor and load, from the start of the continuation on.
BOTH_ENCODERS = tuple((w, w) for w in (1.0, 0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4, 1e-5, 1e-6, 1e-9))
BLURRED = ((0.1, 1.0), (0.08, 0.7), (0.06, 0.5), (0.045, 0.3), (0.03, 0.2), (0.02, 0.1), (0.01, 0.05))
MOTOR_ENCODER = (
    (0.1, 1.0), (0.03, 0.2), (0.01, 0.05), (0.01, 0.03), (3e-3, 1e-2), (1e-3, 3e-3), (3e-4, 2e-3),
    LEAST_WITH_ONE_ENCODER,
)  # fmt: skip
SHARP_STARTS = (2, 1, 0)  # places in MOTOR_ENCODER, tried in turn until the noise at the load gets down
# Shares of the work that usually lie before a stage.
BEFORE_FIT, BEFORE_FREE, BEFORE_WHOLE, BEFORE_INTERVAL = 0.1, 0.5, 0.2, 0.7


def _quiet(what: str, share: float) -> None:
    """Report nothing."""


def estimate(
    record: Record,
    model: Model,
    threads: int = 2,
    more: Sequence[Record] = (),
    time_limit: float = math.inf,
    report: Report = _quiet,
    settings: EstimationSettings = DEFAULT_SETTINGS,
    stop: Stop = never,
) -> Estimate:
    """Return the maximum-likelihood half-gap with its profile-likelihood interval.

    ``time_limit`` [s] gives a fit up; ``stop``, asked before each run of the filter, says why to end with what it has.
    """
    records = (record, *more)
    effort = Effort(time.monotonic() + time_limit, stop)
    likelihood = make_likelihood([make_problem(one, model) for one in records], threads, settings, effort)
    try:
        found = describe(_fit(records, model, threads, likelihood, report))
    except StoppedError as error:
        if effort.best is None:
            raise ConvergenceError(
                f"{record.source}: the fit must reach a first size, but was ended: {error}"
            ) from None
        found = describe_unfinished(_on_all_rows(effort.best, likelihood), str(error))
    return by_record(found, records) if more else found


def _fit(records: Sequence[Record], model: Model, threads: int, likelihood: Likelihood, report: Report) -> Fit:
    """Return the fit of all unknowns to all rows."""
    settings, fit = likelihood.settings, None
    if sum(one.size for one in records) > settings.fit.long_record:
        # What a long record says first of all, its beginning says too, in a fraction of the time.
        rows = settings.fit.short_record // len(records)
        shorts = [make_problem(one.part(0, min(one.size, rows)), model) for one in records]
        report("fitting the beginning", 0.0)
        fit = _refine(likelihood, make_likelihood(shorts, threads, settings, likelihood.effort), report)
    if fit is None:
        fit = fit_record(likelihood, report)
    fit = settle_torque(fit)
    report("finding the interval", BEFORE_INTERVAL)
    return fit


def _on_all_rows(fit: Fit, likelihood: Likelihood) -> Fit:
    """Return a fit, perhaps of the beginning, as one of all rows; nothing ends what is still to be run."""
    whole = likelihood.with_options(soft=fit.likelihood.soft, effort=Effort())
    return replace(fit, likelihood=whole, point=whole.at(fit.point.theta))


def _refine(likelihood: Likelihood, short: Likelihood, report: Report) -> Fit | None:
    """Return the fit that starts from that of the beginning; None where the beginning does not show the gap."""
    first = fit_record(short)
    short = first.likelihood
    if (
        count_traversals(short.run(first.point.theta, keep=True).contacts[:, 0])
        < likelihood.settings.fit.enough_traversals
    ):
        return None
    report("fitting the whole record", BEFORE_WHOLE)
    likelihood = likelihood.with_options(soft=short.soft, information=short.information)
    steps = 2 * likelihood.settings.fit.steps_per_level
    fit = _free_fit(maximise(likelihood, first.point.theta, likelihood.others, steps))
    if _deviance_of_row(fit) - _deviance_of_row(first) < likelihood.settings.fit.worse_at_length:
        return fit
    # Without torque noise, errors of the first part grow over all rows until no step leads back: noise holds the state.
    levels = _levels(likelihood, BOTH_ENCODERS if likelihood.problem.outputs.shape[1] == 2 else MOTOR_ENCODER)
    start = replace(first, likelihood=likelihood, point=likelihood.at(first.point.theta))
    return min(fit, _free_fit(_continue(_fit_at_level(start, levels[0], 1.0), levels[1:])), key=_objective)


def _deviance_of_row(fit: Fit) -> float:
    """Return the deviance of a row that misses no sample: a missing one says nothing."""
    outputs = fit.likelihood.problem.outputs
    return fit.point.deviance * outputs.shape[1] / np.count_nonzero(np.isfinite(outputs))


def fit_record(likelihood: Likelihood, report: Report = _quiet) -> Fit:
    """Return the fit of all unknowns, by grid and continuation in the torque noise."""
    problem = likelihood.problem
    report("trying sizes", 0.0)
    if problem.outputs.shape[1] == 2:
        levels = _levels(likelihood, BOTH_ENCODERS)
        firsts = _different(_first_fits(likelihood, np.log(levels[0])), likelihood.settings.fit.different)
        fits = []
        for n, first in enumerate(firsts):
            report("fitting all values", BEFORE_FIT + (BEFORE_FREE - BEFORE_FIT) * n / len(firsts))
            fits.append(_continue(first, levels[1:]))
        report("fitting the noise", BEFORE_FREE)
        return _free_fit(min(fits, key=_objective))
    return _free_fit(_fit_one_encoder(likelihood))


def _objective(fit: Fit) -> float:
    return fit.point.objective


def _continue(best: Fit, levels: Sequence[tuple[float, float]]) -> Fit:
    """Return the last fit that paid while the torque noise goes through ``levels``."""
    failures, least = 0, best.point.objective
    for level in levels:
        trial = _fit_at_level(best, level, 1.0)
        least = min(least, trial.point.objective)
        if trial.point.objective < least + best.likelihood.settings.fit.allowed_rise:
            best, failures = trial, 0
            continue
        failures += 1
        if failures == 2:
            break
    return best


def _fit_at_level(fit: Fit, level: tuple[float, float], tolerance: float) -> Fit:
    """Return the fit at a level of torque noise that starts from another."""
    likelihood, start = fit.likelihood, fit.point.theta.copy()
    start[likelihood.torque_places] = np.log(level)
    return maximise(likelihood, start, likelihood.others, likelihood.settings.fit.steps_per_level, tolerance)


def _fit_one_encoder(likelihood: Likelihood) -> Fit:
    """Return the best fit with little torque noise.

    The flanks are blurred at first and sharpened then. The second start of the grid is tried where the first one does
    not get down to little noise. Where no fit with sharp flanks comes up to a blurred one, that one stays, with the
    wide interval that it deserves.
    """
    found: list[Fit] = []
    blur = _levels(likelihood, BLURRED)
    for first in _first_fits(likelihood.with_options(soft=True), np.log(blur[0]))[:2]:
        blurred = _continue(first, blur[1:])
        found += [blurred, _sharpen(blurred)]
        if _is_calm(found[-1]):
            break
    return min(found, key=_objective)


def _sharpen(blurred: Fit) -> Fit:
    """Return the fit with sharp flanks that starts from one with ``blurred`` flanks.

    Where that is too far off for little torque noise, the filter loses the load's side; more noise holds it.
    """
    fits: list[Fit] = []
    levels = _levels(blurred.likelihood, MOTOR_ENCODER)
    blurred = replace(blurred, likelihood=blurred.likelihood.with_options(soft=False))
    for place in SHARP_STARTS:
        fits.append(_continue(_fit_at_level(blurred, levels[place], 0.5), levels[place + 1 :]))
        if _is_calm(fits[-1]):
            break
    return min(fits, key=_objective)


def _levels(likelihood: Likelihood, levels: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return levels of torque noise as the strength of the record's drive asks for."""
    return [scale_noise(level, likelihood.problem.units) for level in levels]


def _is_calm(fit: Fit) -> bool:
    """Tell whether a fit of one encoder gets down to as little torque noise at the load as a right one does."""
    most = fit.likelihood.problem.units[1] * fit.likelihood.settings.fit.calm_torque_noise
    return fit.likelihood.noise(fit.point.theta).torque[1] <= most


def _first_fits(likelihood: Likelihood, level: Array) -> list[Fit]:
    """Return fits at high torque noise (its logarithm ``level``), the best first.

    They start from the two best places of a grid of alpha and from the smallest size that is about as good: where the
    gap is traversed rarely, much noise hides that sizes beyond it are too large.
    """
    problem = likelihood.problem
    place = problem.index("alpha")
    points = []
    for alpha in GRID:
        theta = problem.start
        theta[likelihood.torque_places] = level
        theta[place] = alpha
        points.append(likelihood.at(theta))
    best = min(point.objective for point in points)
    if not math.isfinite(best):
        raise ConvergenceError("the likelihood must be finite somewhere, but no start led to one; check the units")
    starts = sorted(points, key=lambda point: point.objective)[:2]
    smallest = next(point for point in points if point.objective < best + likelihood.settings.fit.about_as_good)
    if all(smallest is not start for start in starts):
        starts.append(smallest)
    fits: list[Fit] = []
    # A first step of these too may leave the size behind for good.
    held = {SCALE, TORQUE_OFFSET, LATE, LOAD_TORQUE, *DRY}
    early = [n for n in likelihood.others if problem.names[n] not in held]
    for point in starts:
        fits.append(maximise(likelihood, point.theta, early, 3, tolerance=1.0))
        likelihood = fits[-1].likelihood
    return sorted(fits, key=_objective)


def _different(fits: list[Fit], ratio: float) -> list[Fit]:
    """Return the fits of which no better one has about the same size."""
    chosen: list[Fit] = []
    for fit in fits:
        sizes = [(max(fit.size, other.size), min(fit.size, other.size)) for other in chosen]
        if all(larger > ratio * smaller + GRID[1] for larger, smaller in sizes):
            chosen.append(fit)
    return chosen


def _free_fit(best: Fit) -> Fit:
    """Return the fit with the torque noise free, except where the record cannot tell it from none."""
    likelihood = best.likelihood
    _, information, likelihood = likelihood.derivatives(best.point, np.array(likelihood.torque_places))
    flat = likelihood.settings.fit.flat_information
    free = [n for n, value in zip(likelihood.torque_places, np.diag(information), strict=True) if value > flat]
    while True:
        best = maximise(likelihood, best.point.theta, sorted(likelihood.others + free), 40, tolerance=2e-3)
        likelihood = best.likelihood
        column = {int(n): k for k, n in enumerate(best.free)}
        told = [n for n in free if best.information[column[n], column[n]] > flat]
        if told == free:
            return best
        free = told
