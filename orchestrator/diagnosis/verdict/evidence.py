"""What else a record shows beyond the named effects, each with its evidence: ripple, trend over the stroke, asymmetry.

These are regressions of the final model's innovations on what a small torque at the motor would have done to them,
with what the free parameters explain projected out. Nothing is added to the model by them: they say what is left, and
how sure that is. A model that leaves anything has innovations that are not quite white, so gains are to be read
against the ``level`` that a line at an arbitrary period gains; noise exceeds it as ``exp(-gain/level)`` does.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts, reaching_back
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.response import error_response, filtered
from orchestrator.diagnosis.fit.slope import taken
from orchestrator.diagnosis.search.periodic import cycle_grid, line_spectrum
from orchestrator.diagnosis.settings import EvidenceSettings
from orchestrator.shared.inference.noise import rms

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Term:
    """A torque that the final model lacks.

    Attributes:
        name: what it follows.
        size: of the torque [N.m or N]: amplitude of a line, change over the stroke of a trend, half of what the two
            directions differ by of an asymmetry.
        gain: in log-likelihood, had it been added.
        level: gain of a line at an arbitrary period.
        sure: True if chance does not explain it.
        period: of a line, in units of the motor's position; None for others.
    """

    name: str
    size: float
    gain: float
    level: float
    sure: bool
    period: float | None = None


@dataclass(frozen=True)
class Evidence:
    """Everything that was looked for, strongest first, and the spectrum of lines (periods, gains)."""

    terms: tuple[Term, ...]
    periods: Array
    gains: Array


def evidence(likelihood: RecordLikelihood, model: Fit, parts: Parts) -> Evidence:
    """Return what the model leaves that follows the position or direction of the driven body.

    Args:
        likelihood: of the record.
        model: the final model.
        parts: of the record; those that may be looked at count.

    Returns:
        The terms, and the gain at each period of position.
    """
    looked, settings, first = parts.seen, likelihood.settings, likelihood.plant.bodies[0]
    regress = _Regression(likelihood, model, looked)
    theta, omega = regress.states[:, first.angle], regress.states[:, first.speed]
    stroke = float(np.ptp(theta[looked]))
    cycles = cycle_grid(stroke / (2.0 * np.pi), likelihood.signals.h, rms(omega), settings.scan)
    power = line_spectrum(likelihood, model, looked, cycles)
    level = float(max(np.median(power) / np.log(2.0), 1.0))
    terms = _lines(regress, theta, (cycles, power), level, stroke, settings.evidence)
    centred = (theta - theta[looked].mean()) / max(stroke, 1e-300)
    typical = max(rms(omega[looked]), 1e-300)
    for name, basis in (
        ("trend over the stroke", centred),
        ("curvature over the stroke", centred**2),
        ("direction, constant", np.ones_like(omega)),
        ("direction, growing with speed", np.abs(omega) / typical),
    ):
        found = regress(basis[:, None])
        if found is None:
            continue
        size, gain = found
        terms.append(Term(name, float(abs(size[0])), gain, level, gain > settings.evidence.term_sure * level))
    terms.sort(key=lambda term: term.gain, reverse=True)
    return Evidence(tuple(terms), 2.0 * np.pi / cycles, power)


class _Regression:
    """Regresses innovations on the response to torques at the driven body."""

    def __init__(self, likelihood: RecordLikelihood, model: Fit, looked: slice) -> None:
        """Take innovations, states and the Jacobian of the free parameters once."""
        self._response, self._looked = error_response(likelihood, model), looked
        self._own = likelihood.settings.evidence.own
        _, self.states = likelihood.innovations(model.p, model.q)
        e = model.colour.white(model.z, looked)
        wide, inner = reaching_back(looked, model.colour.order)
        J = model.colour.white(taken(likelihood, model.p, model.q, model.free, model.z, wide).columns, inner)
        self._basis, _ = np.linalg.qr(J.reshape(e.size, len(model.free)))
        self._residual = self._clean(e.reshape(-1, 1))[:, 0]

    def __call__(self, basis: Array) -> tuple[Array, float] | None:
        """Return the coefficients of torques along the columns of ``basis`` (n, k), and their gain.

        None: the free parameters do the same.
        """
        r = self._response
        raw = filtered(np.ascontiguousarray(basis), r.F, np.ascontiguousarray(r.B[:, 0]), r.W)
        columns = r.colour.white(raw, self._looked)
        columns = columns.reshape(self._residual.size, basis.shape[1])
        given = np.linalg.norm(columns)
        columns = self._clean(columns)
        if np.linalg.norm(columns) < self._own * given:
            return None
        size, *_ = np.linalg.lstsq(columns, -self._residual, rcond=None)
        left = self._residual + columns @ size
        return np.asarray(size), 0.5 * float(self._residual @ self._residual - left @ left)

    def _clean(self, columns: Array) -> Array:
        return np.asarray(columns - self._basis @ (self._basis.T @ columns))


def _lines(
    regress: _Regression, theta: Array, spectrum: tuple[Array, Array], level: float, stroke: float,
    settings: EvidenceSettings,
) -> list[Term]:  # fmt: skip
    """Return the strongest lines, each followed by its second harmonic where that shows."""
    cycles, power = spectrum
    found: list[Term] = []
    taken: list[int] = []
    least = float(np.log(cycles.size)) + settings.sure
    for at in np.argsort(power)[::-1].tolist():
        # What does not repeat within the travel is a trend.
        repeats = cycles[at] * stroke > 2.0 * settings.least_repeats * np.pi
        if repeats and all(abs(at - other) > settings.separation for other in taken):
            taken.append(at)
            found.append(_line(regress, "ripple", theta, float(cycles[at]), level, least))
        if len(taken) == settings.lines:
            break
    for line in [term for term in found if term.sure and term.period is not None]:
        assert line.period is not None
        harmonic, wide = 4.0 * np.pi / line.period, settings.harmonic_search
        near = min(
            (
                _line(regress, "ripple, second harmonic", theta, harmonic * f, level, settings.harmonic_sure)
                for f in (1.0 - wide, 1.0, 1.0 + wide)
            ),
            key=lambda term: -term.gain,
        )
        same = any(abs(near.period / t.period - 1.0) < settings.same_period for t in found if t.period and near.period)
        if near.sure and not same:
            found.append(near)
    return found


def _line(regress: _Regression, name: str, theta: Array, cycles: float, level: float, least: float) -> Term:
    found = regress(np.column_stack([np.sin(cycles * theta), np.cos(cycles * theta)]))
    size, gain = found if found is not None else (np.zeros(2), 0.0)
    return Term(name, float(np.hypot(*size)), gain, level, bool(gain > least * level), 2.0 * np.pi / cycles)
