"""Joint maximum-likelihood fit of the gap with everything else that is uncertain: the default estimator.

The one-step prediction likelihood has many optima in alpha when the filter trusts the model too much. So the fit
starts where it trusts the model little (much torque noise): there every record has one broad optimum, found on a
grid of alpha. Then the torque noise is lowered step by step for as long as the likelihood rises, each optimum
starting the next fit, and at last freed. A model that is exact ends at the deterministic output-error fit; one that
is not ends at the noise level that its flaws deserve. Without a load encoder the load's state is known too badly for
a sharp flank, so there the first fits blur it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import chi2

from orchestrator.errors import ConvergenceError
from orchestrator.estimation.cramer_rao import bound_of_fit
from orchestrator.estimation.innovations import Array
from orchestrator.estimation.likelihood import (
    IMPULSE,
    LEAST_TORQUE_NOISE,
    LEAST_WHERE_INEXACT,
    Fit,
    Likelihood,
    Point,
    Problem,
    make_problem,
    maximise,
    with_least_torque_noise,
)
from orchestrator.estimation.protocol import LEVEL, Estimate
from orchestrator.model_file import Model
from orchestrator.record import Record
from pyfmu_sources.drivetrain_parameters import P_I

GRID = (0.0, *(3e-4 * 1.28**n for n in range(31)))  # to half a radian
# Torque noise [N.m.s^0.5] of motor and load, from the start of the continuation on.
BOTH_ENCODERS = tuple((w, w) for w in (1.0, 0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4, 1e-5, 1e-6, 1e-9))
BLURRED = ((0.1, 1.0), (0.08, 0.7), (0.06, 0.5), (0.045, 0.3), (0.03, 0.2), (0.02, 0.1), (0.01, 0.05))
MOTOR_ENCODER = (
    (0.1, 1.0),
    (0.03, 0.2),
    (0.01, 0.05),
    (0.01, 0.03),
    (3e-3, 1e-2),
    (1e-3, 3e-3),
    (3e-4, 2e-3),
    LEAST_WHERE_INEXACT,
)
SHARP_STARTS = (2, 1, 0)  # places in MOTOR_ENCODER, tried in turn until the noise at the load gets down to this much:
CALM_TORQUE_NOISE = 0.011
# A lower torque noise is preferred unless the objective rises by this much above the least: the 5 % limit of the
# likelihood ratio for a noise level at its bound, zero.
ALLOWED_RISE = 2.7
STEPS_PER_LEVEL = 10
CLEAR_IMPULSE = 3.0  # standard errors
ABOUT_AS_GOOD = 15.0  # in the objective
DIFFERENT = 1.5  # ratio of two sizes
MISFIT_WIDENING = 1.3
# What a model that is right but for its parameters' values and its contact law never reaches: torque noise as a share
# of the drive's torque, and autocorrelation of the one-step errors.
NOTABLE_TORQUE_NOISE = 1e-3  # s^0.5
NOTABLE_AUTOCORRELATION = 0.15
LEAST_TRAVEL_M, LEAST_TRAVEL_L = 100.0, 30.0  # in standard deviations of the encoder's noise
FLAT_INFORMATION = 0.3


def estimate(record: Record, model: Model, threads: int = 2) -> Estimate:
    """Return the maximum-likelihood half-gap with its profile-likelihood interval.

    Raises:
        ConvergenceError: no start led to a finite likelihood.
    """
    likelihood = Likelihood(make_problem(record, model), threads)
    fit = fit_record(likelihood)
    return describe(likelihood, fit)


def fit_record(likelihood: Likelihood) -> Fit:
    """Return the fit of all unknowns, by grid and continuation in the torque noise."""
    problem = likelihood.problem
    torque, others = _split(likelihood)
    if problem.outputs.shape[1] == 2:
        firsts = _different(_first_fits(likelihood, torque, others, np.log(BOTH_ENCODERS[0])), problem.index("alpha"))
        fits = [_continue(likelihood, first, BOTH_ENCODERS[1:]) for first in firsts]
        best = _free_fit(likelihood, min(fits, key=lambda fit: fit.point.objective), torque, others)
        if not _has_other_contact(problem, best):
            return best
        likelihood.problem = with_least_torque_noise(problem, LEAST_WHERE_INEXACT)
        start = best.point.theta.copy()
        start[torque] = np.maximum(start[torque], np.log(LEAST_WHERE_INEXACT))
        best = maximise(likelihood, start, others, 2 * STEPS_PER_LEVEL, tolerance=0.01)
    else:
        best = _fit_one_encoder(likelihood, torque, others)
    return _free_fit(likelihood, best, torque, others)


def _has_other_contact(problem: Problem, fit: Fit) -> bool:
    """Return whether the machine's contact law is clearly another than the model's."""
    place = problem.index(IMPULSE)
    column = list(fit.free).index(place)
    deviation = math.sqrt(max(float(fit.covariance[column, column]), 0.0))
    return abs(float(fit.point.theta[place])) > CLEAR_IMPULSE * deviation


def _continue(likelihood: Likelihood, best: Fit, levels: Sequence[tuple[float, float]]) -> Fit:
    """Return the last fit that paid while the torque noise goes through ``levels``."""
    torque, others = _split(likelihood)
    failures, least = 0, best.point.objective
    for level in levels:
        start = best.point.theta.copy()
        start[torque] = np.log(level)
        known = likelihood.information.copy()
        trial = maximise(likelihood, start, others, STEPS_PER_LEVEL, tolerance=1.0)
        least = min(least, trial.point.objective)
        if trial.point.objective < least + ALLOWED_RISE:
            best, failures = trial, 0
            continue
        likelihood.information = known
        failures += 1
        if failures == 2:
            break
    return best


def _fit_one_encoder(likelihood: Likelihood, torque: list[int], others: list[int]) -> Fit:
    """Return the best fit with little torque noise, and leave ``likelihood`` with its flanks as that fit took them.

    The flanks are blurred at first and sharpened then. The second start of the grid is tried where the first one does
    not get down to little noise. Where no fit with sharp flanks comes up to a blurred one, that one stays, with the
    wide interval that it deserves.
    """
    found: list[tuple[Fit, bool, Array]] = []
    likelihood.soft = True
    for first in _first_fits(likelihood, torque, others, np.log(BLURRED[0]))[:2]:
        likelihood.soft = True
        likelihood.information[np.ix_(first.free, first.free)] = first.information
        blurred = _continue(likelihood, first, BLURRED[1:])
        found.append((blurred, True, likelihood.information.copy()))
        likelihood.soft = False
        sharp = _sharpen(likelihood, blurred, torque, others)
        found.append((sharp, False, likelihood.information.copy()))
        if likelihood.noise(sharp.point.theta).torque[1] <= CALM_TORQUE_NOISE:
            break
    best, likelihood.soft, likelihood.information = min(found, key=lambda entry: entry[0].point.objective)
    return best


def _sharpen(likelihood: Likelihood, blurred: Fit, torque: list[int], others: list[int]) -> Fit:
    """Return the fit with sharp flanks that starts from one with ``blurred`` flanks.

    Where that is too far off for little torque noise, the filter loses the load's side; more noise holds it.
    """
    known = likelihood.information.copy()
    fits: list[Fit] = []
    for place in SHARP_STARTS:
        likelihood.information = known.copy()
        start = blurred.point.theta.copy()
        start[torque] = np.log(MOTOR_ENCODER[place])
        first = maximise(likelihood, start, others, STEPS_PER_LEVEL, tolerance=0.5)
        fits.append(_continue(likelihood, first, MOTOR_ENCODER[place + 1 :]))
        if likelihood.noise(fits[-1].point.theta).torque[1] <= CALM_TORQUE_NOISE:
            break
    return min(fits, key=lambda fit: fit.point.objective)


def _split(likelihood: Likelihood) -> tuple[list[int], list[int]]:
    """Return the places of the torque noise in the vector of unknowns, and all others."""
    names = likelihood.problem.names
    torque = [n for n, name in enumerate(names) if name.startswith("log_torque_")]
    return torque, [n for n in range(len(names)) if n not in torque]


def _first_fits(likelihood: Likelihood, torque: list[int], others: list[int], level: Array) -> list[Fit]:
    """Return fits at high torque noise (its logarithm ``level``), the best first.

    They start from the two best places of a grid of alpha and from the smallest size that is about as good: where the
    gap is traversed rarely, much noise hides that sizes beyond it are too large.
    """
    problem = likelihood.problem
    place = problem.index("alpha")
    points = []
    for alpha in GRID:
        theta = problem.start
        theta[torque] = level
        theta[place] = alpha
        points.append(likelihood.at(theta))
    best = min(point.objective for point in points)
    if not math.isfinite(best):
        raise ConvergenceError("the likelihood must be finite somewhere, but no start led to one; check the units")
    starts = sorted(points, key=lambda point: point.objective)[:2]
    smallest = next(point for point in points if point.objective < best + ABOUT_AS_GOOD)
    if all(smallest is not start for start in starts):
        starts.append(smallest)
    fits = [maximise(likelihood, point.theta, others, 3, tolerance=1.0) for point in starts]
    return sorted(fits, key=lambda fit: fit.point.objective)


def _different(fits: list[Fit], place: int) -> list[Fit]:
    """Return the fits of which no better one has about the same size; ``place`` is that of alpha."""
    chosen: list[Fit] = []
    for fit in fits:
        size = float(fit.point.theta[place])
        known = [float(other.point.theta[place]) for other in chosen]
        if all(max(size, other) > DIFFERENT * min(size, other) + GRID[1] for other in known):
            chosen.append(fit)
    return chosen


def _free_fit(likelihood: Likelihood, best: Fit, torque: list[int], others: list[int]) -> Fit:
    """Return the fit with the torque noise free, except where the record cannot tell it from none."""
    _, information = likelihood.derivatives(best.point, np.array(torque))
    free = [n for n, value in zip(torque, np.diag(information), strict=True) if value > FLAT_INFORMATION]
    while True:
        best = maximise(likelihood, best.point.theta, sorted(others + free), 40, tolerance=2e-3)
        column = {int(n): k for k, n in enumerate(best.free)}
        told = [n for n in free if best.information[column[n], column[n]] > FLAT_INFORMATION]
        if told == free:
            return best
        free = told


@dataclass(frozen=True)
class Profile:
    """Profile likelihood: for each alpha, twice the drop of the log posterior maximised over all else."""

    alpha: Array
    drop: Array

    def interval(self, best: float, limit: float) -> tuple[float, float]:
        """Return where ``drop`` crosses ``limit`` on both sides of ``best`` (linear in its square root)."""
        signed = np.sign(self.alpha - best) * np.sqrt(np.maximum(self.drop, 0.0))
        edge = math.sqrt(limit)
        low = float(np.interp(-edge, signed, self.alpha)) if signed[0] < -edge else float(self.alpha[0])
        high = float(np.interp(edge, signed, self.alpha)) if signed[-1] > edge else math.inf
        return low, high


def profile(likelihood: Likelihood, fit: Fit, level: float = LEVEL) -> Profile:
    """Return the profile likelihood of alpha, out to beyond the interval on both sides (or to alpha = 0)."""
    place = likelihood.problem.index("alpha")
    column = list(fit.free).index(place)
    deviation = math.sqrt(fit.covariance[column, column])
    slope = fit.covariance[:, column] / fit.covariance[column, column]
    best = float(fit.point.theta[place])
    edge = MISFIT_WIDENING * math.sqrt(float(chi2.ppf(level, 1)))
    entries = [(best, 0.0)]
    for side in (-1.0, 1.0):
        reach = 0.5 * edge * deviation
        for _ in range(14):
            alpha = max(best + side * reach, 0.0)
            drop = _constrained(likelihood, fit, place, alpha, slope).objective - fit.point.objective
            entries.append((alpha, drop))
            if drop > edge**2 or alpha == 0.0:
                break
            if drop > 0.05:
                reach *= min(max(1.06 * edge / math.sqrt(drop), 1.2), 2.5)
            else:
                reach *= 2.5
    entries = sorted(set(entries))
    return Profile(np.array([e[0] for e in entries]), np.array([e[1] for e in entries]))


def _constrained(likelihood: Likelihood, fit: Fit, place: int, alpha: float, slope: Array) -> Point:
    """Return the best point found with alpha held: the linear prediction, then some scoring steps."""
    unknowns = likelihood.problem.unknowns
    theta = fit.point.theta.copy()
    theta[fit.free] += slope * (alpha - fit.point.theta[place])
    theta[place] = alpha
    theta = np.clip(theta, [u.lower for u in unknowns], [u.upper for u in unknowns])
    others = [n for n in fit.free if n != place]
    return maximise(likelihood, theta, others, 5, tolerance=0.05).point


def describe(likelihood: Likelihood, fit: Fit) -> Estimate:
    """Return the estimate of a fit: interval, visibility, and what else the fit says."""
    problem = likelihood.problem
    place = problem.index("alpha")
    column = list(fit.free).index(place)
    alpha = float(fit.point.theta[place])
    error = math.sqrt(fit.covariance[column, column])
    curve = profile(likelihood, fit)
    # Torque noise above the least means that the model is not exact; what it lacks is not white, as the likelihood
    # takes it to be, so the interval is widened.
    inexact = max(likelihood.noise(fit.point.theta).torque) > 10.0 * LEAST_TORQUE_NOISE
    limit = float(chi2.ppf(LEVEL, 1)) * (MISFIT_WIDENING**2 if inexact else 1.0)
    low, high = curve.interval(alpha, limit)
    # A profile point that is not quite the maximum makes the interval too short, never too long.
    half = math.sqrt(limit) * error
    low, high = min(low, max(alpha - half, 0.0)), max(high, alpha + half)
    kept = likelihood.run(fit.point.theta, keep=True)
    flanks = kept.contacts[kept.contacts != 0]
    traversals = int(np.count_nonzero(np.diff(flanks))) if alpha > 0.0 else 0
    white = kept.errors / np.sqrt(kept.variances)
    diagnostics = {
        "converged": fit.converged,
        "iterations": fit.iterations,
        "traversals": traversals,
        "profile_limit": limit,
        "cramer_rao": bound_of_fit(likelihood, fit),
        "deviance": fit.point.deviance,
        "parameters": _parameters(likelihood, fit),
        "innovation_autocorrelation": [float(_autocorrelation(white[:, n])) for n in range(white.shape[1])],
        "torque_noise": list(likelihood.noise(fit.point.theta).torque),
        "measurement_noise": list(likelihood.noise(fit.point.theta).measured[: white.shape[1]]),
    }
    visible, message = _verdict(alpha, low, high, traversals)
    still = _standing_still(problem.outputs, likelihood.noise(fit.point.theta).measured)
    if still:
        visible, message, error, low, high = False, still, math.inf, 0.0, math.inf
    drive = float(np.sqrt(np.mean(kept.states[:, 4] ** 2)))
    lacking = _lacking(diagnostics, drive, likelihood.parameters(fit.point.theta)[P_I], problem.record.size)
    message = "; ".join(text for text in (message, lacking) if text)
    curves = {"states": kept.states, "contacts": kept.contacts, "errors": kept.errors, "profile": curve}
    curves["offset"] = _value(likelihood, fit, "effects.sensor_offset.load.offset")
    curves["model"] = likelihood.parameters(fit.point.theta)
    return Estimate("maximum_likelihood", alpha, error, (low, high), visible, message, diagnostics, curves)


def _value(likelihood: Likelihood, fit: Fit, name: str) -> float:
    names = likelihood.problem.names
    return float(fit.point.theta[names.index(name)]) if name in names else 0.0


def _verdict(alpha: float, low: float, high: float, traversals: int) -> tuple[bool, str]:
    """Return whether the gap is seen, and the sentence that says so."""
    visible = low > 0.0 and traversals > 0
    if alpha > 0.0 and traversals == 0:
        return visible, (
            "the gap cannot be seen: the record never traverses it (one flank is loaded throughout); "
            "an excitation that reverses the shaft torque would show it (--design)"
        )
    if visible:
        return True, ""
    if math.isfinite(high):
        return False, (
            f"no gap is seen: with 95 % confidence the half-gap is below {high:.3g} rad; "
            "--design proposes a record that would show a smaller one"
        )
    return False, "the gap cannot be seen: every size fits the record; --design proposes an excitation"


def _standing_still(outputs: Array, noise: tuple[float, float]) -> str:
    """Return the sentence that says which side does not move beyond its noise, or nothing."""
    for n, (name, least) in enumerate((("motor", LEAST_TRAVEL_M), ("load", LEAST_TRAVEL_L))[: outputs.shape[1]]):
        travel = float(np.ptp(outputs[:, n])) / noise[n]
        if travel < least:
            return (
                f"the gap cannot be seen: the {name} moves by only {travel:.2g} standard deviations of its encoder's "
                f"noise, and must by {least:g}; --design proposes an excitation"
            )
    return ""


def _lacking(diagnostics: dict[str, Any], drive: float, ratio: float, rows: int) -> str:
    """Return the warning that the model lacks something, or nothing.

    Args:
        diagnostics: of the fit.
        drive: effective value of the motor's torque [N.m].
        ratio: gear ratio.
        rows: of the record.
    """
    worst = max(abs(value) for value in diagnostics["innovation_autocorrelation"])
    motor, load = diagnostics["torque_noise"]
    if max(motor, load / ratio) < NOTABLE_TORQUE_NOISE * drive and worst < max(
        NOTABLE_AUTOCORRELATION, 4.0 / math.sqrt(rows)
    ):
        return ""
    return (
        f"the model does not explain the record (torque noise {motor:.2g} and {load:.2g} N.m.s^0.5 at motor and load, "
        f"autocorrelation {worst:.2f} of the one-step errors): the gap may be biased; `diagnose` names what is missing"
    )


def _autocorrelation(white: Array) -> float:
    """Return the autocorrelation at lag one."""
    centred = white - white.mean()
    return float(np.sum(centred[1:] * centred[:-1]) / max(float(np.sum(centred**2)), 1e-300))


def _parameters(likelihood: Likelihood, fit: Fit) -> dict[str, dict[str, float]]:
    """Return value, standard error and nominal of each fitted unknown."""
    errors = np.sqrt(np.maximum(np.diag(fit.covariance), 0.0))
    table = {}
    for n, error in zip(fit.free, errors, strict=True):
        unknown = likelihood.problem.unknowns[n]
        entry = {"value": float(fit.point.theta[n]), "standard_error": float(error), "nominal": unknown.mean}
        table[unknown.name] = entry
    return table
