"""What the hybrid machine asks of a plant, as the simplest plant that has it all: a ball that a drive throws up.

A plant is rates, guards and jumps. Between events the rates are smooth; a guard that turns negative ends the mode, and
a jump follows. ``x``: state; ``mode``: what stays as it is between two events; ``u``: requested torque [N.m], delayed
and saturated already; ``T_l``: load torque [N.m]; all are those of the plant.
"""

from typing import Annotated, NamedTuple

COUNT = 4
"""Number of states."""
DRIVE, REQUEST = 2, 3
"""Places in the state of the drive's torque behind its lag, and of the request that it follows."""
GUARDS = 1
"""Number of guards."""
TOLERANCE = 1e-11
"""Error that one step of the integrator may make, relative to the state."""
State = Annotated[tuple[float, ...], COUNT]
Mode = tuple[int]


class Parameters(NamedTuple):
    """Mass, restitution, and what the machine asks of every drive: its lag, its filter and its largest rate."""

    mass: float
    restitution: float
    tau: float
    drive_filter_time_constant: float
    rate_limit_rate: float


def mode_rates(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> State:
    """Return the derivative of ``x`` in ``mode``."""
    return (x[1], (x[2] - T_l) / p.mass, (u - x[2]) / p.tau, 0.0)


def guard(x: State, mode: Mode, which: int, p: Parameters, u: float, T_l: float) -> float:
    """Return a guard, by its number; negative ends the mode. One that cannot is 1e300."""
    return x[0]


def guard_room(x: State, mode: Mode, which: int, p: Parameters) -> float:
    """Return how far below zero a guard may fall by rounding."""
    return 1e-14


def switched(x: State, mode: Mode, which: int, events: int, p: Parameters, u: float, T_l: float) -> tuple[State, Mode]:
    """Return state and mode after the guard ``which`` has ended ``mode``; it is event number ``events`` of a step."""
    return ((0.0, -p.restitution * x[1], x[2], x[3]), mode)


def turning(x: State, k1: State, after: State, k7: State, mode: Mode, p: Parameters, h: float) -> float:
    """Return when [s] inside a step a guard may dip below zero and come back, or 0: where what it follows turns round.

    ``k1`` and ``k7``: derivatives at the beginning ``x`` and at the end ``after``.
    """
    return h * x[1] / (x[1] - after[1]) if x[1] < 0.0 < after[1] else 0.0


def begin_step(x: State, mode: Mode, p: Parameters, T_l: float) -> tuple[State, Mode]:
    """Return state and mode as a communication step begins."""
    return (x, mode)


def end_step(x: State, mode: Mode, p: Parameters) -> tuple[Mode, bool]:
    """Return the mode after a step of the integrator, and whether it is new; when that was need not be located."""
    return (mode, False)


def asked(x: State, request: float) -> State:
    """Return the state with the filter of the drive at a ``request`` [N.m]."""
    return (x[0], x[1], x[2], request)


def with_drive(x: State, torque: float) -> State:
    """Return the state with the ``torque`` [N.m] of the drive behind its lag."""
    return (x[0], x[1], torque, x[3])
