"""What is found, in numbers: values with intervals and units, misfits, and those on a second record."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.blackbox.bank import CUT, PORT, BoxEffect
from orchestrator.diagnosis.blackbox.clock import compared_later
from orchestrator.diagnosis.blackbox.fitting import Fitter
from orchestrator.diagnosis.blackbox.likelihood import BoxFit
from orchestrator.diagnosis.blackbox.model import BoxModel, Data
from orchestrator.diagnosis.blackbox.parts import Rows
from orchestrator.diagnosis.blackbox.problem import BoxProblem
from orchestrator.errors import FmuError
from orchestrator.shared.inference.long_run import long_run_covariance
from orchestrator.shared.inference.normal import NORMAL_95, interval_95

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ValueEstimate:
    """A value with its standard error and 95 % interval."""

    name: str
    value: float
    standard_error: float
    interval: tuple[float, float]
    unit: str
    nominal: float | None = None


@dataclass(frozen=True)
class FoundEffect:
    """An effect that is missing: name, where it is attached, its values, and what cannot be told from it."""

    effect: BoxEffect
    estimates: tuple[ValueEstimate, ...]
    gain: float
    family: tuple[str, ...]

    @property
    def name(self) -> str:
        """Name of the effect, as in the bank."""
        return self.effect.kind.name


@dataclass(frozen=True)
class OutputMisfit:
    """Rms of simulated minus measured on held-out data, over the noise, of one output."""

    output: str
    noise: float
    nominal: float
    refitted: float
    corrected: float
    unit: str


def misfits(problem: BoxProblem, stages: Sequence[Array], rows: Rows) -> tuple[OutputMisfit, ...]:
    """Return rms over noise of nominal, re-fitted and corrected model over ``rows`` that no fit has seen.

    Args:
        problem: the FMU and the record.
        stages: (n, outputs) free run of the nominal, the re-fitted and the corrected model.
        rows: the held-out samples.

    Returns:
        A misfit per output.
    """
    rms = [np.sqrt(np.mean(problem.residual(y)[rows] ** 2, axis=0)) for y in stages]
    return tuple(
        OutputMisfit(
            name,
            float(problem.noise[k]),
            float(rms[0][k]),
            float(rms[1][k]),
            float(rms[2][k]),
            problem.units.get(name, ""),
        )
        for k, name in enumerate(problem.outputs)
    )


def errors_of(fitter: Fitter, fit: BoxFit, rows: Rows, noisy: bool = True) -> Array:
    """Return the standard errors of all values.

    What acts in steps (a quantum) has a likelihood with many teeth, of which derivatives see one: its interval holds
    every value nearby that does as well once the others have followed, and theirs hold where they went.

    Args:
        fitter: gives the filters and the FMU.
        fit: whose Jacobian is known over ``rows``.
        rows: samples that were fitted.
        noisy: what is left is the noise that it was taken for; else they hold what else it is, too.

    Returns:
        Shape (values,).
    """
    covariance = fitter.covariance(fit, rows)
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    if not noisy:
        # The scores' own long-run covariance (White, Econometrica 50(1), 1982).
        white = fitter.ladder[fit.level].whiten(fit.J)  # of the rows looked at, where the FMU failed beyond them
        scores = np.einsum("no,nov->nv", fitter.whitened(fit.y, fit.level)[: len(white)], white)
        sandwich = covariance @ long_run_covariance(scores[rows]) @ covariance
        errors = np.maximum(errors, np.sqrt(np.maximum(np.diag(sandwich), 0.0)))
    at = len(fit.model.p)
    for effect, values in zip(fit.model.effects, fit.model.values, strict=True):
        if effect.kind.finer is not None:
            reached = np.abs(alike(fitter, fit, rows, at) - fit.model.vector)
            errors = np.hypot(errors, np.max(reached, axis=0) / NORMAL_95)
        at += len(values)
    return errors


def alike(fitter: Fitter, fit: BoxFit, rows: Rows, at: int, finely: bool = False) -> Array:
    """Return values near those of a fit that do as well, once the others have followed one that acts in steps.

    Args:
        fitter: gives the filters and the FMU.
        fit: whose Jacobian is known over ``rows``.
        rows: samples that were fitted.
        at: place among all values of the one that acts in steps.
        finely: look once more between the farthest that do as well.

    Returns:
        Shape (found, values); the first are those of the fit.
    """
    own, z = fitter.settings.fit, fit.model.vector
    shares = np.geomspace(own.alike_from, own.alike_to, own.alike_tried)
    found = _followed(fitter, fit, rows, at, z[at] * (1.0 + np.concatenate([-shares, shares])))
    if finely:
        between = np.linspace(found[:, at].min(), found[:, at].max(), 2 * own.alike_tried)
        found = np.concatenate([found, _followed(fitter, fit, rows, at, between)])
    return found


def _followed(fitter: Fitter, fit: BoxFit, rows: Rows, at: int, tried: Array) -> Array:
    """Return the values of a fit, and those with others in place ``at`` that do as well, one a row."""
    z, others = fit.model.vector, np.arange(len(fit.model.vector)) != at
    J, found = fit.J[: len(fit.y)][:, :, others], [z]
    least = fitter.likelihood(fitter.whitened(fit.y, fit.level), fit.level, rows) + fitter.prior(fit.model)
    vectors = np.repeat(z[None], len(tried), axis=0)
    vectors[:, at] = tried
    for last in (False, True):  # along a ridge the first step goes astray
        models = [fit.model.moved(vector) for vector in vectors]
        for place, y in enumerate(fitter.problem.simulate(models, len(fit.y))):
            if y is None:
                continue
            change = fitter.step(models[place], y, J, fit.level, rows, 0.0)
            vectors[place, others] += change
            if not last:
                continue
            left = fitter.whitened(y + (J @ change) * fitter.problem.noise, fit.level)
            reached = fitter.likelihood(left, fit.level, rows) + fitter.prior(fit.model.moved(vectors[place]))
            if reached > least - fitter.settings.fit.alike:
                found.append(vectors[place])
    return np.stack(found)


def estimates_of(
    problem: BoxProblem, model: BoxModel, errors: Array
) -> tuple[tuple[ValueEstimate, ...], list[tuple[ValueEstimate, ...]]]:
    """Return estimates of the parameters, and of the values of each effect.

    Args:
        problem: the FMU and the record.
        model: the final one.
        errors: (values,) standard errors of all that was fitted.

    Returns:
        Both, with 95 % intervals.
    """

    def one(name: str, value: float, error: float, unit: str, nominal: float | None = None) -> ValueEstimate:
        value = 0.0 if abs(value) < 1e-290 else value  # a way that is kept from zero, to divide by it
        return ValueEstimate(name, value, error, interval_95(value, error), unit, nominal)

    parameters = tuple(
        one(u.name, float(model.p[k]), float(errors[k]), u.unit, u.value) for k, u in enumerate(problem.map.uncertain)
    )
    values, at = [], len(model.p)
    for effect, found in zip(model.effects, model.values, strict=True):
        units = _units_at(problem, effect)
        values.append(
            tuple(
                one(name, float(v), float(errors[at + k]), units[k])
                for k, (name, v) in enumerate(zip(effect.kind.parameters, found, strict=True))
            )
        )
        at += len(found)
    return parameters, values


def as_told(effect: BoxEffect, values: tuple[ValueEstimate, ...]) -> tuple[ValueEstimate, ...]:
    """Return the values of an effect as a user has them: a gain is the factor, 1 where there is none.

    Args:
        effect: that was found.
        values: as they were fitted, a gain by what it has more than 1.

    Returns:
        The values.
    """
    if not effect.kind.name.endswith("_gain"):
        return values
    return tuple(
        replace(one, value=1.0 + one.value, interval=(1.0 + one.interval[0], 1.0 + one.interval[1])) for one in values
    )


def _units_at(problem: BoxProblem, effect: BoxEffect) -> tuple[str, ...]:
    """Return the units of an effect's values, at the place where it acts."""
    if effect.kind.where == PORT:
        port = problem.map.ports[effect.place]
        flow = problem.units.get(port.position, "")
        names = {"effort": problem.units.get(port.input, ""), "flow": f"({flow or '1'}.s)" if port.flow_only else flow}
    elif effect.kind.where == CUT:
        cut = problem.map.cuts[effect.place]
        names = {"effort": problem.units.get(cut.effort or "", ""), "flow": problem.units.get(cut.input, "")}
    else:
        unit = problem.units.get(effect.place, "")
        names = {"effort": unit, "flow": unit, "signal": effect.signal}
    found = []
    for unit in effect.kind.units:
        shown = unit
        for key, name in names.items():
            shown = shown.replace(key, name or "1")
        found.append(shown)
    return tuple(found)


def validated(problem: BoxProblem, models: Sequence[BoxModel], data: Data) -> tuple[OutputMisfit, ...]:
    """Return the misfit of nominal, re-fitted and corrected model on a second record of the same columns.

    Args:
        problem: of the first record.
        models: the three, in this order.
        data: the second record; nothing is fitted to it.

    Returns:
        A misfit per output.

    Raises:
        FmuError: the FMU does not run over it.
    """
    second = replace(problem, data=compared_later(data, problem.late))
    runs = second.simulate(models)
    found = [y for y in runs if y is not None]
    if len(found) < len(runs):
        raise FmuError(f"{problem.runner.path}: must run over {data.source}, but {problem.runner.reason}")
    return misfits(second, found, slice(0, second.n))
