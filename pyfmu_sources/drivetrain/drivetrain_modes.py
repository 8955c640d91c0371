"""The drivetrain as model exchange sees it: derivatives of states and outputs; the integrator is the host's.

In all functions: ``u``: requested torque [N.m], delayed and saturated already; ``T_l``: load torque [N.m].
"""

from typing import Annotated

from ..laws.drive import saturated
from .dry_friction import shaft_torque
from .equations import Mode, Parameters, State
from .hybrid_plant import GUARDS, mode_rates

Indicators = Annotated[tuple[float, ...], GUARDS]
Outputs = tuple[float, float, float, float, float, float]

# Events that follow each other within this time [s] are chattering, as events within one communication step are.
QUIET = 1e-3
# Half the time [s] over which the derivative of the shaft's torque is taken: rounding and curvature are equally small.
LITTLE = 1e-6


def state_rates(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> State:
    """Return the time derivative of ``x`` in ``mode``; the states of an extra inertia that is not there stand still."""
    r = mode_rates(x, mode, p, u, T_l)
    if p.extra_resonance_inertia > 0.0:
        return r
    return (r[0], r[1], r[2], r[3], r[4], 0.0, 0.0, r[7], r[8], r[9], r[10], r[11])


def rates_and_outputs(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> tuple[State, Outputs]:
    """Return the derivatives, and the outputs theta_m, theta_l, omega_m, omega_l, T_m and T_shaft; limits ``u``."""
    shaft = shaft_torque(x, mode, p, T_l)
    outputs = (x[0] + p.sensor_offset_motor_offset, x[2] + p.sensor_offset_load_offset, x[1], x[3], x[4], shaft)
    return (state_rates(x, mode, p, saturated(u, p.torque_saturation_limit), T_l), outputs)


def output_rates(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> Outputs:
    """Return the derivatives of the outputs of :func:`rates_and_outputs` [1/s]; of T_shaft by a central difference."""
    r = state_rates(x, mode, p, u, T_l)
    later = shaft_torque(along(x, r, LITTLE), mode, p, T_l)
    sooner = shaft_torque(along(x, r, -LITTLE), mode, p, T_l)
    return (r[0], r[2], r[1], r[3], r[4], (later - sooner) / (2.0 * LITTLE))


def along(x: State, r: State, h: float) -> State:
    """Return ``x + h r``, ``h`` in s; the drive's filter, which may not have been asked yet, stays."""
    return (
        x[0] + h * r[0], x[1] + h * r[1], x[2] + h * r[2], x[3] + h * r[3], x[4] + h * r[4], x[5] + h * r[5],
        x[6] + h * r[6], x[7] + h * r[7], x[8] + h * r[8], x[9] + h * r[9], x[10] + h * r[10], x[11],
    )  # fmt: skip
