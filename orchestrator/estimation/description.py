"""What a maximum of the likelihood says: interval, whether a gap is seen, whether the model explains the record."""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from orchestrator.estimation.filter.innovations import count_traversals
from orchestrator.estimation.information import inverse
from orchestrator.estimation.likelihood import Fit
from orchestrator.estimation.problem import DRY, LEAST_TORQUE_NOISE, OFFSET
from orchestrator.estimation.profile import Profile, profile
from orchestrator.estimation.protocol import Estimate
from orchestrator.estimation.settings import GapVerdictSettings
from orchestrator.estimation.torque_reading import torque_words
from orchestrator.shared.arrays import Array
from orchestrator.shared.inference.normal import NORMAL_95


def describe(fit: Fit) -> Estimate:
    """Return the estimate of a fit: interval, visibility, and what else the fit says."""
    wider = _widening(fit)
    fit, curve = profile(fit, NORMAL_95**2 * wider)
    low, high = curve.interval(fit.size, NORMAL_95**2 * wider)
    # A profile point that is not quite the maximum makes the interval too short, never too long.
    half = NORMAL_95 * math.sqrt(wider) * fit.size_deviation
    return _describe(fit, curve, wider, (max(min(low, fit.size - half), 0.0), max(high, fit.size + half)))


def _widening(fit: Fit) -> float:
    """Return the variance of the half-gap over that of white one-step errors: the level of its profile is so much more.

    Kent (Biometrika 69(1), 1982): twice the drop of the log likelihood is chi-squared times that ratio.
    """
    return max(_misfit_variance(fit), block_variance(fit, fit.slope(), fit.likelihood.settings.verdict.blocks))


def describe_unfinished(fit: Fit, why: str) -> Estimate:
    """Return the estimate of a fit that was ended before it was done, its interval by the curvature alone."""
    alpha, error = fit.size, fit.size_deviation
    wider = fit.likelihood.settings.verdict.misfit_widening**2
    half = NORMAL_95 * math.sqrt(wider) * error
    places = np.maximum(alpha + 1.5 * half * np.linspace(-1.0, 1.0, 9), 0.0)
    curve = Profile(places, ((places - alpha) / error) ** 2)
    found = _describe(fit, curve, wider, (max(alpha - half, 0.0), alpha + half))
    said = f"the fit was ended before it was done ({why}), and this is the best that it had reached"
    diagnostics = dict(found.diagnostics) | {"converged": False, "stopped": said}
    return replace(found, message="; ".join(text for text in (said, found.message) if text), diagnostics=diagnostics)


def _misfit_variance(fit: Fit) -> float:
    """Return by what torque noise multiplies the variance: the model is not exact, and what it lacks is not white."""
    problem = fit.likelihood.problem
    noise = zip(fit.likelihood.noise(fit.point.theta).torque, problem.units, strict=True)
    inexact = any(w > 10.0 * LEAST_TORQUE_NOISE * unit for w, unit in noise)
    return fit.likelihood.settings.verdict.misfit_widening**2 if inexact else 1.0


def _describe(fit: Fit, curve: Profile, wider: float, interval: tuple[float, float]) -> Estimate:
    """Return the estimate of a fit with this interval [rad], whose variance is ``wider`` times that of white errors."""
    likelihood = fit.likelihood
    problem, settings = likelihood.problem, likelihood.settings.verdict
    alpha, error = fit.size, math.sqrt(wider) * fit.size_deviation
    low, high = interval
    kept, levels = likelihood.run(fit.point.theta, keep=True), likelihood.noise(fit.point.theta)
    contacts = kept.contacts[:, 0]
    traversals = count_traversals(contacts) if alpha > 0.0 else 0
    white = kept.errors / np.sqrt(kept.variances)
    diagnostics = {
        "converged": fit.converged,
        "iterations": fit.iterations,
        "traversals": traversals,
        "profile_limit": NORMAL_95**2 * wider,
        "cramer_rao": fit.size_deviation,
        "deviance": fit.point.deviance,
        "parameters": fit.parameters(),
        "innovation_autocorrelation": [float(autocorrelation(white[:, n])) for n in range(white.shape[1])],
        "torque_noise": list(levels.torque),
        "measurement_noise": list(levels.measured[: white.shape[1]]),
    }
    visible, message = _verdict(alpha, low, high, traversals)
    still = stillness_note(problem.outputs, levels.measured, settings)
    message = still or message
    if "cannot be seen" in message:  # then no number is an answer
        visible, alpha, error, low, high = False, math.nan, math.inf, 0.0, math.inf
    drive = float(np.sqrt(np.mean(kept.states[:, 4] ** 2)))
    p = likelihood.parameters(fit.point.theta)
    lacking = _model_warning(diagnostics, drive, p["i"], problem.record.size, settings)
    diagnostics["lacking"] = lacking
    crawl = friction_note(fit, (high - low) / (2.0 * alpha)) if visible else ""
    message = "; ".join(text for text in (message, lacking, torque_words(problem), crawl) if text)
    curves = {"states": kept.states, "contacts": contacts, "errors": kept.errors, "profile": curve}
    curves["offset"] = p[OFFSET]
    curves["model"] = tuple(problem.base[name] if name == OFFSET else p[name] for name in problem.base)
    curves["covariance"] = wider * fit.covariance  # of diagnostics["parameters"], in their order
    return Estimate("maximum_likelihood", alpha, error, (low, high), visible, message, diagnostics, curves)


def block_variance(fit: Fit, slope: Array, blocks: int) -> float:
    """Return the variance of a value that blocks of the record show, over that of white one-step errors.

    ``slope`` (k,) is the derivative of the value by the free unknowns. The result is one where it is no more than
    chance makes it. Godambe's information from blocks (White 1982; Kuensch 1989): rounding, errors of the model and of
    the log's times make errors that hang together within a block, which the Fisher information does not know. Student's
    distribution makes up for the number of blocks.
    """
    from scipy.special import gammaincinv, stdtrit

    scores = fit.likelihood.scores(fit.point, fit.free)
    sums = np.array([block.sum(axis=0) for block in np.array_split(scores, blocks)])
    sums -= sums.mean(axis=0)
    lower, upper = fit.likelihood.problem.bounds(fit.free)
    values = fit.point.theta[fit.free]
    # What is held at its bound moves with nothing.
    inside = np.flatnonzero(((lower < values) & (values < upper)) | (slope != 0.0))
    slope = slope[inside]
    weights = inverse(fit.information[np.ix_(inside, inside)]) @ slope
    variance = float(np.sum((sums[:, inside] @ weights) ** 2)) * blocks / (blocks - 1.0)
    ratio = variance / max(float(slope @ weights), 1e-300)
    if not ratio > 2.0 * float(gammaincinv(0.5 * (blocks - 1), 0.975)) / (blocks - 1.0):
        return 1.0
    return ratio * (float(stdtrit(blocks - 1, 0.975)) / NORMAL_95) ** 2


def _verdict(alpha: float, low: float, high: float, traversals: int) -> tuple[bool, str]:
    """Return whether the gap is seen, and the sentence that says so."""
    visible = low > 0.0 and traversals > 0
    if alpha > 0.0 and traversals == 0:
        return visible, (
            "the gap cannot be seen: the record never traverses it (one flank is loaded throughout); "
            "an excitation that reverses the shaft torque would show it (`design` proposes one)"
        )
    if visible:
        return True, ""
    if math.isfinite(high):
        return False, (
            f"no gap is seen: with 95 % confidence the half-gap is below {high:.3g} rad; "
            "`design` proposes a record that would show a smaller one"
        )
    return False, "the gap cannot be seen: every size fits the record; `design` proposes an excitation"


def stillness_note(outputs: Array, noise: tuple[float, ...], settings: GapVerdictSettings) -> str:
    """Return the sentence that says which side does not move beyond its noise, or nothing."""
    sides = (("motor", settings.least_travel_motor), ("load", settings.least_travel_load))
    for n, (name, least) in enumerate(sides[: outputs.shape[1]]):
        travel = float(np.nanmax(outputs[:, n]) - np.nanmin(outputs[:, n])) / noise[n]
        if travel < least:
            return (
                f"the gap cannot be seen: the {name} moves by only {travel:.2g} standard deviations of its encoder's "
                f"noise, and must by {least:g}; `design` proposes an excitation"
            )
    return ""


def friction_note(fit: Fit, reach: float) -> str:
    """Return the advice where much of the half-gap's variance is dry friction's; ``reach``: half interval over gap."""
    settings, names = fit.likelihood.settings.verdict, fit.likelihood.problem.names
    rest = [n for n, place in enumerate(fit.free) if names[place] not in DRY]
    column = rest.index(fit.column)
    share = 1.0 - float(inverse(fit.information[np.ix_(rest, rest)])[column, column]) / fit.size_deviation**2
    if share < settings.open_friction or reach < settings.worth_a_record:
        return ""
    return (
        f"{100.0 * share:.0f} % of the half-gap's variance comes from dry friction, which the record hardly "
        "distinguishes from the gap: also log a slow motion in both directions, and fit both records together"
    )


def _model_warning(
    diagnostics: dict[str, Any], drive: float, ratio: float, rows: int, settings: GapVerdictSettings
) -> str:
    """Return the warning that the model lacks something, or nothing; ``drive``: rms of the motor's torque [N.m]."""
    worst = max(abs(value) for value in diagnostics["innovation_autocorrelation"])
    motor, load = diagnostics["torque_noise"]
    if max(motor, load / ratio) < settings.notable_torque_noise * drive and worst < max(
        settings.notable_autocorrelation, settings.chance_autocorrelation / math.sqrt(rows)
    ):
        return ""
    return (
        f"the model does not explain the record (torque noise {motor:.2g} and {load:.2g} N.m.s^0.5 at motor and load, "
        f"autocorrelation {worst:.2f} of the one-step errors): the gap may be biased; `diagnose` names what is missing"
    )


def autocorrelation(white: Array) -> float:
    """Return the autocorrelation at lag one."""
    centred = white - white.mean()
    return float(np.sum(centred[1:] * centred[:-1]) / max(float(np.sum(centred**2)), 1e-300))
