"""The fits of one record of a train: a gap in stage 1 alone, in stage 2 alone, in both, and wherever it is.

While an intermediate shaft floats between two gaps, small errors of the model send it elsewhere: the likelihood has
many optima in the share of the gap that stage 2 has. It is smooth where the filter trusts the model of motor and load
little, and that of the intermediate shaft, on which nothing unknown acts, much. So fits begin there, from a grid of
sizes and then of shares, and the torque noise falls for as long as the likelihood rises. The free fit starts from the
best of all, so that no model that it holds is better than it.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from orchestrator.errors import ConvergenceError
from orchestrator.estimation.description import block_variance
from orchestrator.estimation.effort import Report
from orchestrator.estimation.information import inverse
from orchestrator.estimation.likelihood import Fit, Likelihood, Point, maximise
from orchestrator.estimation.settings import StageSettings
from orchestrator.estimation.stages.problem import BODIES, GAPS, SHARE, TOTAL, TWIST
from orchestrator.shared.arrays import Array

GRID = tuple(1e-3 * 1.4**n for n in range(18))  # rad, to a third of a radian
SHARES = (0.15, 0.3, 0.45, 0.6, 0.75, 0.9)
COARSE, MIDDLE, FINE = 0.3, (0.1, 0.03), 0.01  # torque noise at the motor [N.m.s^0.5] of a drive of ``USUAL`` N.m
USUAL = 20.0
QUIET = 0.2  # torque noise of the intermediate shaft over that of the motor, for its inertia
PLACES = (-1.0, 0.0, 1.0)  # of the intermediate shaft within the first gap at the first row, in half-gaps
SHARES_BETWEEN = 13  # that a rough fit of both tries
SHARES_NEARBY, NEARBY = 24, 6.0  # that a fit tries about its own, to so many standard deviations of it
NOISE_STEPS = (-3.0, -1.0, 1.0)  # of a logarithm


@dataclass(frozen=True)
class StageFits:
    """The best fit under each answer; ``free`` is at least as good as all others."""

    first: Fit
    second: Fit
    both: Fit
    free: Fit
    shared: tuple[Fit, ...]  # every optimum with a gap in both stages that was found


def fit_stages(likelihood: Likelihood, settings: StageSettings, report: Report) -> StageFits:
    """Return the fits of a record; ``report`` is called with what is done, and the share of the work behind."""
    report("trying sizes", 0.0)
    coarse = _fit_size(likelihood)
    report("fitting a gap in both stages", 0.15)
    place, shared = likelihood.problem.index(SHARE), settings.shared
    floating = likelihood.with_options(problem=likelihood.problem.with_unknown(place, lower=shared, upper=1.0 - shared))
    first, second, *_ = sorted(_try_shares(coarse.likelihood, coarse.point.theta, SHARES), key=_objective)
    both = _fit_both(floating, first.theta, (*MIDDLE, FINE))
    found = [both]
    others = [(first.theta, (FINE,)), (second.theta, (*MIDDLE, FINE))]
    singles = []
    for share, done in ((0.0, 0.5), (1.0, 0.7)):
        report(f"fitting a gap in stage {1 + round(share)} alone", done)
        starts = [coarse.point.theta, with_noise(likelihood, both.point.theta, MIDDLE[-1])]
        tried = [p for theta in starts for p in _try_shares(coarse.likelihood, theta, [share])]
        singles.append(_finish(coarse.likelihood, min(tried, key=_objective), _all_but(likelihood, SHARE)))
    report("fitting the share of each stage", 0.8)
    if 0.5 * (both.point.objective - _better(*singles).point.objective) < settings.hopeless:
        found.append(_fit_both(floating, _renew(both), (FINE,)))
        both = _better(*found)
    free = _free(likelihood, both, *singles)
    for _ in range(settings.starts):
        if not settings.shared < _share(free) < 1.0 - settings.shared:
            break
        nearby = look_nearby(free)
        if nearby.objective < free.point.objective:
            found.append(maximise(free.likelihood, nearby.theta, list(free.free), 15, 0.1))
        elif not others or _scatter(free) < settings.restless:
            break
        else:
            found.append(_free(likelihood, _fit_both(floating, *others.pop(0))))
        free = _better(free, found[-1])
    for n, share in enumerate((0.0, 1.0)):  # what the free fit has learnt, the nearest single one should know
        if abs(_share(free) - share) < settings.shared:
            singles[n] = _better(singles[n], _fit_at(free, share))
    if min(fit.point.objective for fit in (both, *singles)) < free.point.objective:
        free = _free(likelihood, both, *singles)
    if settings.shared <= _share(free) <= 1.0 - settings.shared:
        both = _better(both, free)
        found.append(free)
        # An excluded single gap must have had the same chances.
        singles = [
            _begin_anew(one, free, share, settings.hopeless) for one, share in zip(singles, (0.0, 1.0), strict=True)
        ]
    return StageFits(singles[0], singles[1], both, free, tuple(found))


def _begin_anew(single: Fit, free: Fit, share: float, hopeless: float) -> Fit:
    """Return the fit of a single gap, begun anew from the free fit unless it is hopelessly far behind that."""
    if 0.5 * (single.point.objective - free.point.objective) >= hopeless:
        return single
    start = _try_shares(free.likelihood, with_noise(free.likelihood, free.point.theta, FINE), [share])[0]
    return _better(single, _finish(free.likelihood, start, _all_but(free.likelihood, SHARE)))


def _better(*fits: Fit) -> Fit:
    return min(fits, key=lambda fit: fit.point.objective)


def _free(likelihood: Likelihood, *fits: Fit) -> Fit:
    """Return the fit with the share free that starts from the best."""
    best = _better(*fits)
    return maximise(
        best.likelihood.with_options(problem=likelihood.problem), best.point.theta, _all_but(likelihood), 15, 0.1
    )


def _scatter(fit: Fit) -> float:
    """Return by what blocks of the record differ on the share, over what noise does; much, and a fit is no optimum."""
    return block_variance(fit, fit.slope(SHARE), fit.likelihood.settings.verdict.blocks)


def _renew(fit: Fit) -> Array:
    """Return the best vector at another share, with some torque noise: where a fit begins anew."""
    theta = with_noise(fit.likelihood, fit.point.theta, FINE)
    return min(_try_shares(fit.likelihood, theta, SHARES), key=_objective).theta


def with_noise(likelihood: Likelihood, theta: Array, level: float) -> Array:
    """Return a vector with the torque noise at a level, that of the intermediate shaft far below the others."""
    problem, theta = likelihood.problem, theta.copy()
    quiet = QUIET * problem.base["J_s"] / problem.base["J_m"]
    for body, unit in zip(BODIES, problem.units, strict=True):
        value = level * unit / USUAL * (quiet if body == "middle" else 1.0)
        unknown = problem.unknowns[problem.index(f"log_torque_{body}")]
        theta[problem.index(unknown.name)] = min(max(math.log(value), unknown.lower), unknown.upper)
    return theta


def _objective(point: Point) -> float:
    return point.objective


def _share(fit: Fit) -> float:
    return float(fit.point.theta[fit.likelihood.problem.index(SHARE)])


def _all_but(likelihood: Likelihood, *names: str) -> list[int]:
    """Return the places of all unknowns but those of these names; "torque" stands for all torque noise."""
    noise = [f"log_torque_{body}" for body in BODIES] if "torque" in names else []
    return [n for n, name in enumerate(likelihood.problem.names) if name not in (*names, *noise)]


def _fit_size(likelihood: Likelihood) -> Fit:
    """Return a rough fit with a gap in stage 1 alone, which has about the size of any."""
    problem = likelihood.problem
    start = with_noise(likelihood, problem.start, COARSE)
    start[problem.index(SHARE)] = 0.0
    points = []
    for size in GRID:
        start[problem.index(TOTAL)] = size
        points.append(likelihood.at(start.copy()))
    best = min(points, key=_objective)
    if not math.isfinite(best.objective):
        raise ConvergenceError("the likelihood must be finite somewhere, but no start led to one; check the units")
    free = _all_but(likelihood, "torque", SHARE, "J_s")  # which much noise drives to its bound, where it would stay
    fit = maximise(likelihood, best.theta, free, 10, tolerance=2.0)
    for level in MIDDLE:
        lower = maximise(fit.likelihood, with_noise(likelihood, fit.point.theta, level), free, 6, tolerance=2.0)
        if lower.point.objective > fit.point.objective:
            break
        fit = lower
    return fit


def _try_shares(likelihood: Likelihood, theta: Array, shares: Iterable[float]) -> list[Point]:
    """Return the likelihood at each share, the intermediate shaft at its best place in the first gap."""
    problem = likelihood.problem
    share_at, twist_at = problem.index(SHARE), problem.index(TWIST)
    found = []
    for share in shares:
        moved = theta.copy()
        moved[share_at] = share
        half = likelihood.parameters(moved)[GAPS[0]]
        points = [likelihood.at(moved)]
        for place in PLACES:
            other = moved.copy()
            other[twist_at] = place * half
            points.append(likelihood.at(other))
        found.append(min(points, key=_objective))
    return found


def _fit_both(likelihood: Likelihood, start: Array, levels: Sequence[float]) -> Fit:
    """Return the fit of a gap in both stages; the torque noise goes down levels for as long as that pays."""
    best = None
    theta = np.clip(start, *likelihood.problem.bounds(range(start.size)))
    for level in levels:
        rough = maximise(
            likelihood, with_noise(likelihood, theta, level), _all_but(likelihood, "torque"), 4, tolerance=1.0
        )
        moved = min(_follow_share(rough), key=_objective)
        if best is not None and moved.objective > best.objective:
            break
        best, theta, likelihood = moved, moved.theta, rough.likelihood
    assert best is not None
    return _finish(likelihood, best, _all_but(likelihood))


def _follow_share(fit: Fit) -> list[Point]:
    """Return the likelihood of a fit and along the share, once with all else as it is and once moved with it."""
    place = fit.likelihood.problem.index(SHARE)
    low, high = (float(bound[0]) for bound in fit.likelihood.problem.bounds([place]))
    shares = np.linspace(low, high, SHARES_BETWEEN)
    alone = []
    for share in shares:
        theta = fit.point.theta.copy()
        theta[place] = share
        alone.append(fit.likelihood.at(theta))
    return [fit.point, *alone, *move_share(fit, shares - fit.point.theta[place])]


def look_nearby(fit: Fit) -> Point:
    """Return the best point at shares near that of a fit."""
    column = list(fit.free).index(fit.likelihood.problem.index(SHARE))
    away = np.linspace(-NEARBY, NEARBY, SHARES_NEARBY) * math.sqrt(fit.covariance[column, column])
    return min(move_share(fit, away), key=_objective)


def move_share(fit: Fit, away: Iterable[float]) -> list[Point]:
    """Return the likelihood at other shares, all unknowns that are at no bound moved as the information of a fit says.

    A bound is where the record shows next to nothing of an unknown, so that the information would move it anywhere.
    """
    place = fit.likelihood.problem.index(SHARE)
    values, (low, high) = fit.point.theta[fit.free], fit.likelihood.problem.bounds(fit.free)
    inside = np.flatnonzero(((low < values) & (values < high)) | (fit.free == place))
    covariance = inverse(fit.information[np.ix_(inside, inside)])
    column = list(fit.free[inside]).index(place)
    slope = covariance[:, column] / covariance[column, column]
    found = []
    for step in away:
        moved = fit.point.theta.copy()
        moved[fit.free[inside]] = np.clip(values[inside] + slope * step, low[inside], high[inside])
        found.append(fit.likelihood.at(moved))
    return found


def _fit_at(fit: Fit, share: float) -> Fit:
    """Return the fit with this share that starts from another."""
    likelihood = fit.likelihood
    start = _try_shares(likelihood, fit.point.theta, [share])[0]
    return maximise(likelihood, start.theta, _all_but(likelihood, SHARE), 6, tolerance=0.1)


def _finish(likelihood: Likelihood, start: Point, free: Sequence[int]) -> Fit:
    """Return the fit of ``free`` and of the torque noise, which falls as the fit gets better."""
    torque = [likelihood.problem.index(f"log_torque_{body}") for body in BODIES]
    others = [n for n in free if n not in torque]
    settled = _settle_noise(likelihood, start, torque)
    fit = maximise(likelihood, settled.theta, others, 4, tolerance=0.5)
    settled = _settle_noise(fit.likelihood, fit.point, torque)
    return maximise(fit.likelihood, settled.theta, free, 16, tolerance=0.1)


def _settle_noise(likelihood: Likelihood, point: Point, torque: Sequence[int]) -> Point:
    """Return the best point reached by steps of one level of torque noise at a time."""
    unknowns = likelihood.problem.unknowns
    for _ in range(2):
        before = point
        for n in torque:
            for step in NOISE_STEPS:
                theta = point.theta.copy()
                theta[n] = float(np.clip(theta[n] + step, unknowns[n].lower, unknowns[n].upper))
                moved = likelihood.at(theta)
                if moved.objective < point.objective:
                    point = moved
                    break
        if point is before:
            break
    return point
