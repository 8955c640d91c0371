"""What a final model leaves, and which signals that follows: curves between knots, judged on blocks left out.

A torque that depends on one signal is a sum of straight lines between knots. The values at the knots enter the balances
linearly: they are result beside the model's own values by one set of normal equations, and judged by the score of every
effect. The strongest of these dependences is the law that is learned where no effect of the bank explains the record.
"""

import itertools
from collections.abc import Sequence

import numpy as np

from orchestrator.diagnosis.inference.fitting import (
    compare_residuals,
    jackknife_covariance,
    leave_blocks_out,
)
from orchestrator.diagnosis.inference.problem import FitProblem
from orchestrator.diagnosis.model.interface import LawArgument
from orchestrator.diagnosis.selection.outcome import Dependence, SearchResult
from orchestrator.diagnosis.settings import SelectionSettings
from orchestrator.shared.arrays import Array

KNOTS = 11
SURE = 2.5  # paired errors by which a gain is no chance
EDGE = 0.005  # share of the rows beyond the first and the last knot
RIDGE = 1e-9  # of the trace: knots that no row reaches stay where their neighbours are


def find_dependences(
    result: SearchResult, arguments: Sequence[LawArgument], settings: SelectionSettings
) -> tuple[Dependence, ...]:
    """Return what the final model leaves and which signals it follows, strongest first."""
    tried = [_fit_curve(result, argument) for argument in arguments]
    kept = [
        one for one in tried
        if one is not None and one.comparison.t >= SURE and one.comparison.gain >= settings.least_gain
    ]  # fmt: skip
    return tuple(sorted(kept, key=lambda curve: -curve.comparison.gain))


def knots_of(values: Array) -> Array | None:
    """Return rising knots (k,) half-way between even steps and even shares of values (n,); None: all are one."""
    shares = np.quantile(values, np.linspace(EDGE, 1.0 - EDGE, KNOTS))
    knots = 0.5 * (shares + np.linspace(shares[0], shares[-1], KNOTS))
    return knots if np.all(np.diff(knots) > 1e-9 * max(float(np.ptp(knots)), 1e-300)) else None


def hats(knots: Array, values: Array) -> Array:
    """Return (n, k) the share of each knot (k,) in a curve at some values (n,); the last straight lines go on."""
    place = np.clip(np.searchsorted(knots, values), 1, knots.size - 1)
    share = (values - knots[place - 1]) / (knots[place] - knots[place - 1])
    result = np.zeros((values.size, knots.size))
    rows = np.arange(values.size)
    result[rows, place - 1] = 1.0 - share
    result[rows, place] = share
    return result


def _fit_curve(result: SearchResult, argument: LawArgument) -> Dependence | None:
    problem, final = result.problem, result.final
    knots = knots_of(np.concatenate(argument.values))
    if knots is None:
        return None
    columns = _whiten_hats(problem, argument, knots)
    own = [n for n, one in enumerate(final.coordinates) if isinstance(one, int) and not argument.drives]
    whole = np.column_stack([final.jacobian[:, own], columns])
    prior, slopes = (part[own] for part in problem.prior(final.point, final.coordinates))
    normal = whole.T @ whole
    penalty = np.diag(np.concatenate([slopes**2, np.full(knots.size, RIDGE * np.trace(normal) / len(normal))]))
    gradient = whole.T @ final.residual + np.concatenate([slopes * prior, np.zeros(knots.size)])
    inverse = np.linalg.pinv(normal + penalty, hermitian=True)
    step = -inverse @ gradient
    after, shifts = leave_blocks_out(final.residual, whole, normal + penalty, gradient, problem.blocks)
    count = len(own)
    before, _ = leave_blocks_out(
        final.residual, whole[:, :count], (normal + penalty)[:count, :count], gradient[:count], problem.blocks
    )
    values = step[count:]
    deviations = np.sqrt(np.maximum(np.diag(inverse), np.diag(jackknife_covariance(shifts)))[count:])
    left = final.residual + whole @ step
    share = 1.0 - float(left @ left) / float(final.residual @ final.residual)
    return Dependence(
        argument.name, argument.site, argument.unit, argument.torque_unit, tuple(knots.tolist()),
        tuple(values.tolist()), tuple(deviations.tolist()), compare_residuals(before, after, problem.blocks),
        max(share, 0.0), formula_of(knots, values, deviations),
    )  # fmt: skip


def _whiten_hats(problem: FitProblem, argument: LawArgument, knots: Array) -> Array:
    """Return (rows, k) the whitened residuals of a unit torque against the motion at each knot."""
    columns = []
    for k in range(knots.size):
        parts = [
            whitening.apply(respond(hats(knots, values)[:, k]))
            for whitening, values, respond in zip(problem.whitenings, argument.values, argument.respond, strict=True)
        ]
        columns.append(np.concatenate(parts))
    return np.column_stack(columns)


def simple_terms(x: Array) -> dict[str, Array]:
    """Return the simple terms (n,) of a formula at the arguments ``x`` (n,), by their names: "s" would be a second."""
    return {
        "1": np.ones_like(x), "x": x, "sign(x)": np.sign(x), "|x|": np.abs(x), "x |x|": x * np.abs(x), "x^2": x**2,
        "x^3": x**3, "sin(x)": np.sin(x), "cos(x)": np.cos(x),
    }  # fmt: skip


def formula_of(knots: Array, values: Array, errors: Array, most: float = 1.5) -> str:
    """Return the shortest sum of at most two simple terms that runs within the errors (k,) of a curve."""
    terms = simple_terms(knots)
    weight = 1.0 / np.maximum(errors, 1e-3 * float(np.max(np.abs(values))))
    for count in (1, 2):
        fits = []
        for chosen in itertools.combinations(terms, count):
            columns = np.column_stack([terms[name] for name in chosen])
            size, *_ = np.linalg.lstsq(columns * weight[:, None], values * weight, rcond=None)
            left = float(np.mean(((values - columns @ size) * weight) ** 2))
            fits.append((left, chosen, size))
        left, chosen, size = min(fits, key=lambda entry: entry[0])
        if left < most:
            shown = zip(size, chosen, strict=True)
            return " ".join(f"{value:+.4g}" + (f" {name}" if name != "1" else "") for value, name in shown).lstrip("+")
    return ""
