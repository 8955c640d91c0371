"""A fit and the whitening that it asks for, in turn until neither changes the other."""

from collections.abc import Sequence
from dataclasses import replace

from orchestrator.diagnosis.inference.fitting import FittedModel, fit_model, weigh_prior
from orchestrator.diagnosis.inference.problem import FitProblem
from orchestrator.diagnosis.model.interface import ModelPoint
from orchestrator.diagnosis.selection.outcome import SearchResult

SETTLINGS = 5  # of fit and whitening at most
SETTLED = 0.02  # share of the score by which one changes it that is the last


def fit_base(problem: FitProblem) -> tuple[FittedModel, FitProblem]:
    """Return the model with re-fitted parameters, and the problem whitened by what it leaves."""
    starts = [problem.start] if problem.first is None else [problem.first, problem.start]
    fitted = min((fit_model(problem, start) for start in starts), key=lambda fit: fit.cost)
    for number in range(SETTLINGS):
        score = fitted.score
        problem, fitted = settle(problem, fitted)
        if number and abs(fitted.score - score) < SETTLED * score:
            break
    return fitted, problem


def settle(problem: FitProblem, fitted: FittedModel) -> tuple[FitProblem, FittedModel]:
    """Return the problem with the whitening and the prior weight that a model asks for, and the model fitted there."""
    problem = weigh_prior(problem.reweight(fitted.point), fitted)
    return problem, fit_model(problem, fitted.point)


def settle_anew(problem: FitProblem, fitted: FittedModel) -> tuple[FitProblem, FittedModel]:
    """Return what :func:`settle` returns, from the model file's values too where these lead to less.

    What the model lacked before may have led its values to where no fit comes back from.
    """
    again = fit_model(problem, ModelPoint(problem.start.parameters, fitted.point.effects))
    return settle(problem, again if again.cost < fitted.cost else fitted)


def leave_out(result: SearchResult, labels: Sequence[str]) -> SearchResult:
    """Return the result with a final model that lacks some effects, the rest fitted anew."""
    if not labels:
        return result
    fitted = fit_model(result.problem, result.final.point.without_effects(labels))
    problem, final = settle(result.problem, fitted)
    return replace(result, problem=problem, final=final)
