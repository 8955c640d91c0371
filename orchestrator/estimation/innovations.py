"""One-step prediction errors of the drivetrain: an extended Kalman filter over located contact events.

Between two events the dead-zone model is affine in ``x = (theta_m, omega_m, theta_l, omega_l, T_m)``. Its matrices
come from :func:`pyfmu_sources.drivetrain.equations.rates`; here they are discretised once per parameter set, the flank
is followed inside each sample, and the covariance is carried through every change of flank by its saltation matrix.
With the process noise at zero this is the output-error likelihood of the deterministic plant; with process noise it
is the likelihood in innovation form, in which an imperfect model does not drift away from the record.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.building.translation.kernels import Kernels
from pyfmu_sources.drivetrain.equations import DrivetrainParameters, State, rates
from pyfmu_sources.laws.backlash_models import DEAD_ZONE
from pyfmu_sources.laws.parameter_rows import BIG

Array = NDArray[np.float64]
KERNEL = Kernels("orchestrator.estimation.kernel")
STATES = 5
FADING = 1e-3  # rad, half-gap below which the impulse of a contact fades


@dataclass(frozen=True)
class AffineModel:
    """The plant in its three smooth modes, index 0: flank -1, 1: free, 2: flank +1.

    Attributes:
        matrices: (3, 5, 5) A, 1/s.
        inputs: (5,) b_u, effect of the requested torque.
        constants: (3, 5) effect of offsets and constant torques.
        normal: (5,) twist = normal . x.
        alpha: half gap [rad].
        mobility: (2,) what a torque at motor or load does to the speed beside it, 1/inertia.
        jump: (5,) sudden change of the state when the teeth touch at flank +1.
    """

    matrices: Array
    inputs: Array
    constants: Array
    normal: Array
    alpha: float
    mobility: Array
    jump: Array


def affine_model(values: Sequence[float], impulse: float = 0.0) -> AffineModel:
    """Return the smooth modes of the dead-zone plant with parameters ``values``; nonlinear effects are not seen.

    ``impulse`` [N.m.s] is what the shaft lacks at the load when the teeth touch, and has too much when they part,
    beside a damper ``c`` that acts from the first moment of contact on: half of ``c`` times the depth within which a
    real contact's damping sets in (Hunt and Crossley 1975). It fades with the gap: without one, nothing touches.
    """
    p = DrivetrainParameters._make(values)._replace(
        backlash_model=float(DEAD_ZONE), drive_filter_time_constant=0.0, rate_limit_rate=BIG
    )
    matrices = np.zeros((3, STATES, STATES))
    constants = np.zeros((3, STATES))
    zero = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    inputs = np.zeros(STATES)
    for flank in (-1, 0, 1):
        base: tuple[float, ...] = rates(zero, flank, 0.0, 0.0, p, 0.0, 0.0)
        constants[flank + 1] = base[:STATES]
        for n in range(STATES):
            unit = _unit(n)
            moved = rates(unit, flank, 0.0, 0.0, p, 0.0, 0.0)
            matrices[flank + 1, :, n] = [moved[m] - base[m] for m in range(STATES)]
        moved = rates(zero, flank, 0.0, 0.0, p, 1.0, 0.0)
        inputs = np.array([moved[m] - base[m] for m in range(STATES)])
    normal = np.array([1.0 / p.i, 0.0, -1.0, 0.0, 0.0])
    mobility = np.array([1.0 / p.J_m, 1.0 / p.J_l])
    faded = impulse * p.alpha / math.hypot(p.alpha, FADING)
    jump = faded * np.array([0.0, mobility[0] / p.i, 0.0, -mobility[1], 0.0])
    return AffineModel(matrices, inputs, constants, normal, p.alpha, mobility, jump)


def _unit(n: int) -> State:
    a, b, c, d, e = (1.0 if m == n else 0.0 for m in range(STATES))
    return (a, b, c, d, e, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class NoiseLevels:
    """Standard deviations of measurement [rad] and of white torque noise [N.m.s^0.5], motor and load each."""

    measured: tuple[float, float]
    torque: tuple[float, float]


@dataclass(frozen=True)
class Innovations:
    """Result of a filter run.

    Attributes:
        errors: (n, outputs) measured minus predicted [rad].
        variances: (n, outputs) what the filter expects of their squares.
        states: (n, 5) state after the measurement, empty unless asked for.
        contacts: (n,) flank after the measurement, empty unless asked for.
    """

    errors: Array
    variances: Array
    states: Array
    contacts: NDArray[np.int64]

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
) -> Innovations:
    """Run the filter over a record.

    Args:
        u: (n,) requested torque, held over a sample [N.m].
        y: (n, 2) motor and load angle, or (n, 1) motor angle only [rad]; NaN: missing, its update is skipped.
        step: sample time [s].
        x0: (5,) state at the first sample, taken as exact (its uncertainty is the fit's business).
        u_deviation: (n,) standard deviation of the torque where it is not known [N.m], or None.

    Returns:
        One-step errors and their variances, (n, outputs) each.
    """
    phi, gain_u, gain_1 = _discrete(model, step)
    intensity = (np.array(noise.torque) * model.mobility) ** 2
    variance = np.array(noise.measured[: y.shape[1]]) ** 2
    n = y.shape[0]
    u_variance = np.empty(0) if u_deviation is None else u_deviation**2
    errors, variances = np.empty(y.shape), np.empty(y.shape)
    states = np.empty((n if keep else 0, STATES))
    contacts = np.empty(n if keep else 0, dtype=np.int64)
    KERNEL.run_filter(
        model.matrices, model.inputs, model.constants, model.normal, model.alpha, model.jump, phi, gain_u, gain_1, step,
        u, u_variance, y, variance, intensity, x0, errors, variances, states, contacts, soft,
    )  # fmt: skip
    return Innovations(errors, variances, states, contacts)


def simulate(model: AffineModel, u: Array, step: float, x0: Array) -> Array:
    """Return the states (n, 5) of the plant that is fed ``u`` (n,) from ``x0`` (5,), without any measurement.

    Args:
        u: requested torque, held over a sample [N.m].
        step: sample time [s].
    """
    phi, gain_u, gain_1 = _discrete(model, step)
    states = np.empty((u.size, STATES))
    KERNEL.run_free(
        model.matrices, model.inputs, model.constants, model.normal, model.alpha, model.jump, phi, gain_u, gain_1,
        step, u, x0, states,
    )  # fmt: skip
    return states


def _discrete(model: AffineModel, step: float) -> tuple[Array, Array, Array]:
    """Return the transition matrices (3, 5, 5) and input gains (3, 5) of the three modes over a whole sample."""
    phi = np.empty((3, STATES, STATES))
    gain_u = np.empty((3, STATES))
    gain_1 = np.empty((3, STATES))
    for m in range(3):
        KERNEL.transition(model.matrices[m], model.inputs, model.constants[m], step, phi[m], gain_u[m], gain_1[m])
    return phi, gain_u, gain_1
