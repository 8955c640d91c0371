"""What else a record shows beyond the named effects, each with its evidence: ripple, trend over the stroke, asymmetry.

These are regressions of the final model's innovations on what a small torque at the motor would have done to them,
with what the free parameters explain projected out. Nothing is added to the model by them: they say what is left, and
how sure that is. A model that leaves anything has innovations that are not quite white, so gains are to be read
against the ``level`` that a line at an arbitrary period gains; noise exceeds it as ``exp(-gain/level)`` does.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fitting import Fit, Parts, jacobian
from orchestrator.diagnosis.likelihood import Likelihood
from orchestrator.diagnosis.outcome import Diagnosis
from orchestrator.diagnosis.plants import Plant
from orchestrator.diagnosis.remainder import filtered
from orchestrator.diagnosis.screening import cycle_grid, error_response, line_spectrum

Array = NDArray[np.float64]

LINES = 3  # strongest lines looked at
SURE = 7.0  # levels beyond what the best of all scanned periods would gain by chance
HARMONIC_SURE = 7.0  # levels that a second harmonic, of which there is one, must gain
TERM_SURE = 7.0
OWN = 0.03  # share of its response that a term must keep when the free parameters' is taken out


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


def evidence(likelihood: Likelihood, plant: Plant, model: Fit, parts: Parts) -> Evidence:
    """Return what the model leaves that follows the motor's position or direction."""
    looked = parts.seen
    regress = _Regression(likelihood, plant, model, looked)
    theta, omega = regress.states[:, 0], regress.states[:, 1]
    stroke = float(np.ptp(theta[looked]))
    whole = Parts(looked, parts.validated, parts.held_out)
    speed = float(np.sqrt(np.mean(omega**2)))
    cycles = cycle_grid(stroke / (2.0 * np.pi), likelihood.signals.h, speed)
    power = line_spectrum(likelihood, plant, model, whole, cycles)
    level = float(max(np.median(power) / np.log(2.0), 1.0))
    terms = _lines(regress, theta, cycles, power, level, stroke)
    centred = (theta - theta[looked].mean()) / max(stroke, 1e-300)
    typical = max(float(np.sqrt(np.mean(omega[looked] ** 2))), 1e-300)
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
        terms.append(Term(name, float(abs(size[0])), gain, level, gain > TERM_SURE * level))
    terms.sort(key=lambda term: term.gain, reverse=True)
    return Evidence(tuple(terms), 2.0 * np.pi / cycles, power)


def evidence_of(diagnosis: Diagnosis) -> Evidence:
    """Return what the final model of a diagnosis leaves."""
    w = diagnosis.workings
    return evidence(w.likelihood, w.plant, w.final, w.parts)


class _Regression:
    """Regresses innovations on the response to torques at the motor."""

    def __init__(self, likelihood: Likelihood, plant: Plant, model: Fit, looked: slice) -> None:
        """Take innovations, states and the Jacobian of the free parameters once."""
        self._response, self._looked = error_response(likelihood, plant, model), looked
        _, self.states = likelihood.innovations(model.p, model.q)
        e = model.z[looked]
        root = np.linalg.inv(np.linalg.cholesky(e.T @ e / len(e)))
        J = root @ jacobian(likelihood, model.p, model.q, model.free, model.z, looked)
        self._basis, _ = np.linalg.qr(J.reshape(e.size, len(model.free)))
        self._residual = self._clean((e @ root.T).reshape(-1, 1))[:, 0]

    def __call__(self, basis: Array) -> tuple[Array, float] | None:
        """Return the coefficients of torques along the columns of ``basis`` (n, k), and their gain.

        None: the free parameters do the same.
        """
        r = self._response
        columns = filtered(np.ascontiguousarray(basis), r.F, np.ascontiguousarray(r.B[:, 0]), r.W)[self._looked]
        columns = columns.reshape(self._residual.size, basis.shape[1])
        given = np.linalg.norm(columns)
        columns = self._clean(columns)
        if np.linalg.norm(columns) < OWN * given:
            return None
        size, *_ = np.linalg.lstsq(columns, -self._residual, rcond=None)
        left = self._residual + columns @ size
        return np.asarray(size), 0.5 * float(self._residual @ self._residual - left @ left)

    def _clean(self, columns: Array) -> Array:
        return np.asarray(columns - self._basis @ (self._basis.T @ columns))


def _lines(
    regress: _Regression, theta: Array, cycles: Array, power: Array, level: float, stroke: float
) -> list[Term]:  # fmt: skip
    """Return the strongest lines, each followed by its second harmonic where that shows."""
    found: list[Term] = []
    taken: list[int] = []
    for at in np.argsort(power)[::-1].tolist():
        # What does not repeat within the travel is a trend.
        if cycles[at] * stroke > 4.0 * np.pi and all(abs(at - other) > 4 for other in taken):
            taken.append(at)
            least = float(np.log(cycles.size)) + SURE
            found.append(_line(regress, "ripple", theta, float(cycles[at]), level, least))
        if len(taken) == LINES:
            break
    for line in [term for term in found if term.sure and term.period is not None]:
        assert line.period is not None
        harmonic = 4.0 * np.pi / line.period
        near = min((_line(regress, "ripple, second harmonic", theta, harmonic * f, level, HARMONIC_SURE)
                    for f in (0.998, 1.0, 1.002)), key=lambda term: -term.gain)  # fmt: skip
        if near.sure and not any(abs(near.period / t.period - 1.0) < 0.01 for t in found if t.period and near.period):
            found.append(near)
    return found


def _line(regress: _Regression, name: str, theta: Array, cycles: float, level: float, least: float) -> Term:
    found = regress(np.column_stack([np.sin(cycles * theta), np.cos(cycles * theta)]))
    size, gain = found if found is not None else (np.zeros(2), 0.0)
    return Term(name, float(np.hypot(*size)), gain, level, bool(gain > least * level), 2.0 * np.pi / cycles)
