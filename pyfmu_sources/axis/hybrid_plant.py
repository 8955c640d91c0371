"""The axis as the hybrid machine asks for it: rates in a mode, what ends it, what follows.

``mode``: direction of sliding (0: none) and the end stop at which the axis is (-1, 0: none, 1).

In all functions: ``u``: requested torque [N.m], delayed and saturated already; ``T_l``: load torque [N.m].
"""

from ..hybrid.machine import NEVER
from ..laws.friction import bristle_sign, bristle_slip, builds_up, capacity, is_dry, leaving_speed, reach
from ..laws.parameter_rows import BIG
from .axis_equations import Parameters, State, friction_of, past_stop, rates, sliding_torque, slip_at_rest

COUNT = 5
DRIVE, REQUEST = 2, 4
GUARDS = 2
TOLERANCE = 2e-10
SLIP, STOP = range(GUARDS)
Mode = tuple[int, int]


def mode_rates(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> State:
    """Return the derivative of ``x``; an axis that does not slide bends its bristle, or sticks where it has none."""
    if mode[0] != 0:
        return rates(x, float(mode[0]), p, u, T_l)
    f = friction_of(p)
    sign, bends = bristle_sign(f, 0, x[3], x[1], x[0], 0.0)
    r = rates(x, sign, p, u, T_l)
    return (r[0], r[1], r[2], bends, r[4]) if builds_up(f) else (0.0, 0.0, r[2], 0.0, r[4])


def guard(x: State, mode: Mode, which: int, p: Parameters, u: float, T_l: float) -> float:
    """Return how far the axis is from the end of its sliding or sticking [rad/s or N.m], or from a stop [rad]."""
    slip, stop = mode
    if which == STOP:
        if p.end_stop_upper >= BIG and p.end_stop_lower <= -BIG:
            return NEVER
        if stop == 0:
            return min(p.end_stop_upper - x[0], x[0] - p.end_stop_lower)
        return x[0] - p.end_stop_upper if stop == 1 else p.end_stop_lower - x[0]
    f = friction_of(p)
    if not is_dry(f) or (slip == 0 and builds_up(f)):
        return NEVER
    if slip == 0:
        return capacity(f, x[0], 0.0) - abs(sliding_torque(at_rest(x), p, u, T_l))
    return x[1] * slip - leaving_speed(f)


def guard_room(x: State, mode: Mode, which: int, p: Parameters) -> float:
    """Return how far below zero a guard may fall by rounding."""
    if which == STOP:
        return 1e-14 * (1.0 + abs(x[0]))
    return 1e-12 * (1.0 + abs(x[2])) if mode[0] == 0 else 1e-14


def switched(x: State, mode: Mode, which: int, events: int, p: Parameters, u: float, T_l: float) -> tuple[State, Mode]:
    """Return state and mode after the guard ``which`` has ended ``mode``."""
    slip, stop = mode
    if which == STOP:
        return (x, (slip, past_stop(x, p) if stop == 0 else 0))
    f = friction_of(p)
    if builds_up(f):
        return ((x[0], x[1], x[2], slip * reach(f, x[1], x[0], 0.0), x[4]), (0, stop))
    return (at_rest(x), (slip_at_rest(x, p, u, T_l), stop))


def turning(x: State, k1: State, after: State, k7: State, mode: Mode, p: Parameters, h: float) -> float:
    """Return when [s] inside a step the axis is slowest, or turns round at a stop, or 0 where it does neither."""
    if mode[0] * k1[1] < 0.0 < mode[0] * k7[1]:
        return h * k1[1] / (k1[1] - k7[1])
    return h * x[1] / (x[1] - after[1]) if x[1] * after[1] < 0.0 else 0.0


def begin_step(x: State, mode: Mode, p: Parameters, T_l: float) -> tuple[State, Mode]:
    """Return state and mode as a step begins: without dry friction the axis always slides."""
    f = friction_of(p)
    return (x, (1, mode[1])) if mode[0] == 0 and not is_dry(f) else (x, mode)


def end_step(x: State, mode: Mode, p: Parameters) -> tuple[Mode, bool]:
    """Return the mode after a step of the integrator, in which a settled bristle slides, and whether it is new."""
    slip = bristle_slip(friction_of(p), mode[0], x[3], x[1], x[0], 0.0)
    return ((slip, mode[1]), slip != mode[0])


def at_rest(x: State) -> State:
    """Return the state with the axis standing still."""
    return (x[0], 0.0, x[2], x[3], x[4])


def asked(x: State, request: float) -> State:
    """Return the state with the filter of the drive at a ``request`` [N.m]."""
    return (x[0], x[1], x[2], x[3], request)


def with_drive(x: State, torque: float) -> State:
    """Return the state with the ``torque`` [N.m] of the drive behind its lag."""
    return (x[0], x[1], torque, x[3], x[4])
