"""Sizes of effects and parameters with their errors, from a fitted model.

Standard errors are the larger of what white residuals say and what blocks differ by (delete-one-block jackknife);
intervals are those of Student's distribution with as many degrees of freedom as there are blocks, less one.
"""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from orchestrator.diagnosis.inference.fitting import FittedModel
from orchestrator.diagnosis.inference.problem import FitProblem
from orchestrator.diagnosis.result import ParameterEstimate, ValueEstimate

Array = NDArray[np.float64]


def parameter_estimates(problem: FitProblem, fitted: FittedModel, level: float) -> dict[str, ParameterEstimate]:
    """Return the estimates of the model's own parameters."""
    covariance, width = value_covariance(fitted), interval_width(problem, level)
    found = {}
    for n, entry in enumerate(problem.shared):
        value = fitted.point.parameters[n]
        error = abs(entry.nominal) * float(np.sqrt(covariance[n, n]))
        interval = (value - width * error, value + width * error)
        found[entry.name] = ParameterEstimate(value, error, interval, entry.unit, entry.nominal)
    return found


def effect_estimates(
    problem: FitProblem, fitted: FittedModel, label: str, names: Callable[[tuple[float, ...]], Mapping[str, float]],
    units: Mapping[str, str], level: float,
) -> dict[str, ValueEstimate]:  # fmt: skip
    """Return the estimates of an effect's parameters.

    Args:
        names: values of the effect -> parameters by short name.
    """
    values, effect = fitted.point.effects[label], problem.effects[label]
    covariance, width = value_covariance(fitted), interval_width(problem, level)
    centre = names(values)
    slopes = np.zeros((len(centre), len(fitted.coordinates)))
    for n, coordinate in enumerate(fitted.coordinates):
        if isinstance(coordinate, int) or coordinate[0] != label:
            continue
        place = coordinate[1]
        step = 1e-4 * effect.scales[place]
        moved = names((*values[:place], values[place] + step, *values[place + 1 :]))
        slopes[:, n] = [(_wrapped(name, moved[name] - centre[name])) / 1e-4 for name in centre]
    found = {}
    variances = np.einsum("pc,cd,pd->p", slopes, covariance, slopes)
    for error, (name, value) in zip(np.sqrt(np.maximum(variances, 0.0)).tolist(), centre.items(), strict=True):
        found[name] = ValueEstimate(value, error, (value - width * error, value + width * error), units[name])
    return found


def block_values(
    problem: FitProblem, fitted: FittedModel, label: str, names: Callable[[tuple[float, ...]], Mapping[str, float]]
) -> dict[str, tuple[float, ...]]:
    """Return the value of each parameter of an effect as each block by itself would move it (jackknife pseudo-values).

    Args:
        names: values of the effect -> parameters by short name.

    Returns:
        Short name -> (blocks,).
    """
    effect, count = problem.effects[label], len(fitted.block_shifts)
    places = [(n, one[1]) for n, one in enumerate(fitted.coordinates) if not isinstance(one, int) and one[0] == label]
    rows = []
    for shift in fitted.block_shifts:
        values = list(fitted.point.effects[label])
        for n, place in places:
            values[place] -= (count - 1) * shift[n] * effect.scales[place]
        rows.append(names(tuple(values)))
    return {name: tuple(row[name] for row in rows) for name in rows[0]}


def value_covariance(fitted: FittedModel) -> Array:
    """Return the covariance (coordinates, coordinates) of fitted values.

    Returns:
        That of white residuals, with each standard error at least what blocks differ by.
    """
    white, blocks = fitted.covariance, fitted.jackknife
    wider = np.sqrt(np.maximum(np.diag(blocks) / np.maximum(np.diag(white), 1e-300), 1.0))
    return np.asarray(white * np.outer(wider, wider))


def interval_width(problem: FitProblem, level: float) -> float:
    """Return half the width of an interval in standard errors."""
    return float(student.ppf(0.5 + 0.5 * level, problem.block_count - 1))


def _wrapped(name: str, difference: float) -> float:
    return float((difference + np.pi) % (2.0 * np.pi) - np.pi) if name == "phase" else difference
