"""The single axis as model exchange sees it: state derivatives, event indicators, what follows at an event.

The laws are those of :mod:`axis_equations`; here they are without its integrator, which is the host's. Between events
the direction of sliding and the end stop that is touched do not change.

In all functions: ``u``: requested torque [N.m], delayed and saturated already; ``T_l``: load torque [N.m]; ``mode``:
direction of sliding, 0: none.
"""

from ..laws.drive import saturated
from ..laws.friction import builds_up, capacity, is_dry, leaving_speed, reach
from ..laws.parameter_rows import BIG
from .axis_equations import (
    Parameters,
    State,
    drive_torque,
    friction_of,
    initial_mode,
    mode_rates,
    past_stop,
    sliding_torque,
    slip_at_rest,
)

Indicators = tuple[float, float]
Outputs = tuple[float, float, float]

# Direction of sliding before the first request, which decides.
UNDECIDED = 2
# An indicator turns negative when it is this many roundings below zero, so that the event update, which wants one,
# surely finds the mode at its end.
ROOMS = 2.0


def decided(x: State, mode: int, p: Parameters, u: float) -> int:
    """Return the direction of sliding (-1, 0, 1), from state and request if nothing has decided it yet."""
    if mode == UNDECIDED:
        mode = initial_mode(x, p, u)
    f = friction_of(p)
    return 1 if mode == 0 and not is_dry(f) else mode


def rates_and_outputs(x: State, mode: int, p: Parameters, u: float, T_l: float) -> tuple[State, Outputs]:
    """Return the derivatives, and the outputs theta_m, omega_m and T_m; limits ``u``."""
    asked = saturated(u, p.torque_saturation_limit)
    outputs = (x[0] + p.sensor_offset_motor_offset, x[1], drive_torque(x, p, asked))
    return (mode_rates(x, mode, p, asked, T_l), outputs)


def slipping_room(x: State, mode: int) -> float:
    """Return how far below zero the friction's indicator may fall by rounding."""
    return 1e-12 * (1.0 + abs(x[2])) if mode == 0 else 1e-14


def slipping(x: State, mode: int, p: Parameters, u: float, T_l: float) -> float:
    """Return how far dry friction is from the end of its mode, in N.m (it sticks) or rad/s (it slides).

    Returns:
        The distance; 1 where the mode cannot end: no dry friction, or a bristle that bends.
    """
    f = friction_of(p)
    if not is_dry(f) or (mode == 0 and builds_up(f)):
        return 1.0
    if mode == 0:
        return capacity(f, x[0], 0.0) - abs(sliding_torque((x[0], 0.0, x[2], x[3], x[4]), p, u, T_l))
    return x[1] * mode - leaving_speed(f)


def stop_room(x: State) -> float:
    """Return how far below zero the end stops' indicator may fall by rounding [rad]."""
    return 1e-14 * (1.0 + abs(x[0]))


def to_stop(x: State, stop: int, p: Parameters) -> float:
    """Return how far [rad] the axis is from an end stop or, with ``stop`` -1 or 1, from leaving that one."""
    if p.end_stop_upper >= BIG and p.end_stop_lower <= -BIG:
        return 1.0
    if stop == 1:
        return x[0] - p.end_stop_upper
    if stop == -1:
        return p.end_stop_lower - x[0]
    return min(p.end_stop_upper - x[0], x[0] - p.end_stop_lower)


def indicators(x: State, mode: int, stop: int, p: Parameters, u: float, T_l: float) -> Indicators:
    """Return both event indicators: dry friction and end stops; the mode ends when one turns negative.

    Args:
        stop: end stop at which the axis is: -1, 0 (none) or 1.
    """
    return (slipping(x, mode, p, u, T_l) + ROOMS * slipping_room(x, mode), to_stop(x, stop, p) + ROOMS * stop_room(x))


def after_events(x: State, mode: int, stop: int, p: Parameters, u: float, T_l: float) -> tuple[State, int, int]:
    """Return state, direction of sliding and end stop once none of them is at its end."""
    mode = decided(x, mode, p, u)
    if slipping(x, mode, p, u, T_l) < -slipping_room(x, mode):
        f = friction_of(p)
        if builds_up(f):
            x = (x[0], x[1], x[2], mode * reach(f, x[1], x[0], 0.0), x[4])
            mode = 0
        else:
            x = (x[0], 0.0, x[2], x[3], x[4])
            mode = slip_at_rest(x, p, u, T_l)
    if to_stop(x, stop, p) < -stop_room(x):
        stop = past_stop(x, p) if stop == 0 else 0
    return (x, mode, stop)
