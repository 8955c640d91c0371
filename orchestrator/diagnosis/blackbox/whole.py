"""What a model leaves over all of a record, and whether that is a disturbance or has some shape."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.estimates import alike
from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.lawful import dependence_of
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.rest import Rest, Whole, rest_of
from orchestrator.diagnosis.blackbox.search import BoxSearch
from orchestrator.diagnosis.blackbox.settings import RestSettings
from orchestrator.diagnosis.blackbox.verdict import predicted, stand_in

Array = NDArray[np.float64]


def on_all_rows(search: BoxSearch, best: BoxFit, settings: RestSettings) -> Whole:
    """Return a model over all of the record, and what it leaves there.

    Args:
        search: that found it.
        best: its fit.
        settings: when what is left is noise, or a disturbance.

    Returns:
        The model, fitted to all rows that were looked at; the same again where it was asked for before.
    """
    fitter = search.fitter
    if search.whole is None or search.whole.best is not best:
        last = _last(search, best)
        found = _over_all(fitter, last, settings)
        if not found[1].nothing_missing:
            at = len(last.model.p)
            for effect in last.model.effects:
                if effect.kind.finer is not None:
                    found = max(found, of_alike(fitter, last, at, settings), key=lambda f: f[0].fitted)
                at += len(effect.kind.parameters)
        search.whole = Whole(best, *found)
    return search.whole


def _over_all(fitter: Fitter, last: BoxFit, settings: RestSettings) -> tuple[BoxFit, Rest]:
    """Return a fit whose run, Jacobian and likelihood are those over all rows, and what it leaves there."""
    problem = fitter.problem
    y = problem.simulate([last.model])[0]
    y = problem.must_simulate(problem.nominal) if y is None else y
    J = fitter.jacobian(last.model, y)
    rows = slice(0, problem.n)
    fitted = fitter.likelihood(fitter.whitened(y, last.level), last.level, rows)
    last = replace(last, y=y, fitted=fitted, J=last.J if J is None else J)
    return last, rest_of(fitter, last, rows, settings)


def of_alike(fitter: Fitter, last: BoxFit, at: int, settings: RestSettings) -> tuple[BoxFit, Rest]:
    """Return the likeliest over all rows of those fits that do as well on the rows that were looked at.

    A value that acts in steps is told by them up to a tooth of its likelihood: which sample further on falls on which
    side of a threshold is open, and nothing that the model lacks.

    Args:
        fitter: gives the filters and the FMU.
        last: a fit to the rows that were looked at.
        at: place of the value among all.
        settings: when what is left is noise, or a disturbance.

    Returns:
        The fit, its likelihood that over all rows, and what it leaves there.
    """
    rows, k = slice(0, fitter.problem.n), last.level
    models = [last.model.moved(vector) for vector in alike(fitter, last, fitter.parts.looked_at, at, finely=True)]
    runs = fitter.problem.simulate(models)
    reached = [-np.inf if y is None else fitter.likelihood(fitter.whitened(y, k), k, rows) for y in runs]
    return _over_all(fitter, replace(last, model=models[int(np.argmax(reached))]), settings)


def _last(search: BoxSearch, fit: BoxFit) -> BoxFit:
    """Return a fit over all rows that were looked at."""
    fitter, seen = search.fitter, search.fitter.parts.looked_at
    found = fitter.fit(fit.model, fit.level, None, seen, iterations=4)
    at = len(fit.model.p)
    for effect in fit.model.effects:  # the rows that decided tell more of a value that acts in steps
        found = fitter.combed(found, at, seen) if found is not None and effect.kind.finer is not None else found
        at += len(effect.kind.parameters)
    return found or fit


def on_finer_steps(search: BoxSearch, whole: Whole) -> Whole:
    """Return a model fitted at finer communication steps, where those of the search shift its values.

    Steps that cost little misfit may shift a well known value by several of its standard errors. The problem keeps the
    steps that were found; one that has a grid of its own (finer steps fit worse) keeps what it had.

    Args:
        search: that found it.
        whole: the model, by which nothing is missing.

    Returns:
        The model; what it leaves is as it was.
    """
    problem, fitter, settings = search.fitter.problem, search.fitter, search.fitter.settings.fit
    for _ in range(settings.halvings):
        last, steps = whole.last, problem.m
        y = replace(problem, m=2 * steps).simulate([last.model])[0]
        if search.late or y is None or np.max(np.abs(_shift(fitter, last, y)), initial=0.0) < settings.shifted:
            break
        problem.m = 2 * steps
        finer, _ = _over_all(fitter, _last(search, last), search.fitter.settings.rest)
        if finer.fitted < last.fitted - settings.alike:
            problem.m = steps
            break
        whole = replace(whole, last=finer)
    return whole


def _shift(fitter: Fitter, fit: BoxFit, y: Array) -> Array:
    """Return by how many standard errors the values of a fit would move where its run were ``y``."""
    seen, level = fitter.parts.looked_at, fitter.ladder[fit.level]
    covariance = fitter.covariance(fit, seen)
    change = level.whiten(((y - fit.y) / fitter.problem.noise)[:, :, None])[seen].ravel()
    moved = covariance @ (level.whiten(fit.J)[seen].reshape(len(change), -1).T @ change)
    return np.asarray(moved / np.sqrt(np.maximum(np.diag(covariance), 1e-300)))


def doubted(search: BoxSearch, whole: Whole, settings: RestSettings) -> Rest:
    """Return what is left of a model over all of the record: no disturbance where it has some shape.

    Nor where it is large beside effects that are named, or one of them takes little of it away.

    Args:
        search: that found it.
        whole: the model.
        settings: when what is left is a disturbance.

    Returns:
        What is left.
    """
    fitter, best, fit, rest = search.fitter, whole.best, whole.last, whole.rest
    if not rest.disturbed:
        return rest
    if best.model.effects and rest.share > settings.most_with_effects:
        return replace(
            rest, disturbed=False, reasons=(f"{100.0 * rest.share:.2g} % of the drive is left at the ports",)
        )
    # The error of a solver follows from the drive; effects leave it where it was.
    asked = not best.model.effects or rest.share > settings.solver
    if asked and predicted(fitter, fit, settings) > settings.driven:
        return replace(rest, disturbed=False, reasons=("what is left follows from the drive",))
    if (law := dependence_of(fitter, fit, settings)) is not None:
        return replace(rest, disturbed=False, reasons=(law.statement,))
    if label := stand_in(search, best, settings):
        return replace(rest, disturbed=False, reasons=(f"`{label}` takes away little of what is left at the ports",))
    return rest
