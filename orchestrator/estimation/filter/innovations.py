"""One-step prediction errors of a drivetrain: an extended Kalman filter over located contact events.

Between two events the dead-zone model is affine. Its modes are discretised once per parameter set, the flanks are
followed inside each sample, and the covariance is carried through every change of flank by its saltation matrix.
With the process noise at zero this is the output-error likelihood of the deterministic plant; with process noise it
is the likelihood in innovation form, in which an imperfect model does not drift away from the record.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orchestrator.building.translation.kernels import Kernels
from orchestrator.estimation.filter.model import AffineModel, NoiseLevels
from orchestrator.shared.arrays import Array

LEAST_LAG = 5e-4  # of the drive, in samples: a shorter one acts the same, and would take a contact thousands of pieces
ROOM = "orchestrator.estimation.filter"
KERNELS = {1: Kernels(f"{ROOM}.kernel"), 2: Kernels(f"{ROOM}.kernel[{ROOM}.two_stages]")}  # by gaps in a row


@dataclass(frozen=True)
class Innovations:
    """Result of a filter run."""

    errors: Array  # (rows, outputs) measured minus predicted [rad]
    variances: Array  # (rows, outputs) what the filter expects of their squares
    states: Array  # (rows, n) state after the measurement, empty unless asked for
    contacts: NDArray[np.int64]  # (rows, stages) flank after the measurement, empty unless asked for

    @property
    def deviance(self) -> float:
        """Return twice the negative log likelihood without its constant."""
        return float(np.sum(np.log(self.variances) + self.errors**2 / self.variances))


def innovations(
    model: AffineModel,
    u: Array,
    y: Array,
    step: float,
    x0: Array,
    noise: NoiseLevels,
    keep: bool = False,
    soft: bool = False,
    u_deviation: Array | None = None,
    spread: Array | None = None,
) -> Innovations:
    """Run the filter over a record.

    Args:
        u: (rows,) requested torque, held over a sample [N.m].
        y: (rows, 2) motor and load angle, or (rows, 1) motor angle only [rad]; NaN: missing, its update is skipped.
        step: sample time [s].
        x0: (n,) state at the first sample.
        soft: average the dead zones over the distribution of the twist.
        u_deviation: (rows,) standard deviation of the torque where it is not known [N.m], or None.
        spread: (n,) standard deviations of ``x0`` (default: it is exact, its uncertainty is the fit's business).

    Returns:
        One-step errors and their variances, (rows, outputs) each.
    """
    intensity = (np.array(noise.torque) * model.mobility) ** 2
    variance = np.array(noise.measured[: y.shape[1]]) ** 2
    rows = y.shape[0]
    u_variance = np.empty(0) if u_deviation is None else u_deviation**2
    errors, variances = np.empty(y.shape), np.empty(y.shape)
    kept = rows if keep else 0
    states, contacts = np.empty((kept, x0.size)), np.empty((kept, model.stages), dtype=np.int64)
    KERNELS[model.stages].run_filter(
        *_arrays(model, step), step, u, u_variance, y, variance, intensity, model.dry, x0,
        np.zeros(x0.size) if spread is None else spread, errors, variances, states, contacts, soft,
    )  # fmt: skip
    return Innovations(errors, variances, states, contacts)


def count_traversals(flanks: NDArray[Any]) -> int:
    """Return how often teeth that left a flank met the other one; flanks (n,) are -1, 0 (free) or 1."""
    touched = flanks[flanks != 0]
    return int(np.count_nonzero(np.diff(touched)))


def simulate(model: AffineModel, u: Array, step: float, x0: Array) -> Array:
    """Return the states (rows, n) of the plant that is fed ``u`` (rows,) from ``x0`` (n,), without any measurement.

    ``u``: requested torque, held over a sample [N.m]; ``step``: sample time [s].
    """
    states = np.empty((u.size, x0.size))
    KERNELS[model.stages].run_free(*_arrays(model, step), step, u, model.dry, x0, states)
    return states


def _arrays(model: AffineModel, step: float) -> tuple[Array, ...]:
    """Return what kernels take of a model, its modes over a whole sample last."""
    model = _with_least_lag(model, LEAST_LAG * step)
    phi, gain, gain_1 = (
        np.empty_like(model.matrices),
        np.empty((len(model.matrices), *model.inputs.shape)),
        np.empty_like(model.constants),
    )
    KERNELS[model.stages].transitions(model.matrices, model.inputs, model.constants, step, phi, gain, gain_1)
    return (
        model.matrices, model.inputs, model.constants, model.normals, model.halves, model.depths, phi, gain, gain_1
    )  # fmt: skip


def _with_least_lag(model: AffineModel, least: float) -> AffineModel:
    """Return the plant with a lag of the drive of at least this [s]."""
    share = -1.0 / (least * model.matrices[0, -1, -1])
    if not 0.0 < share < 1.0:
        return model
    rows = np.append(np.ones(model.matrices.shape[-1] - 1), share)
    return replace(
        model, matrices=model.matrices * rows[:, None], inputs=model.inputs * rows, constants=model.constants * rows
    )
