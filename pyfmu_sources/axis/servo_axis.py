"""The single axis as the adapters and the orchestrator use it: start, advance, read; outputs for model exchange.

Its equations are in :mod:`axis_equations`; the hybrid machine moves it, bound to :mod:`hybrid_plant`.

In all functions: ``u``: requested torque [N.m], delayed and saturated already; ``T_l``: load torque [N.m]; ``mode``:
direction of sliding, 0: none.
"""

from ..hybrid import machine as template
from ..hybrid.binding import bind
from ..laws.drive import saturated
from ..laws.friction import is_dry
from . import hybrid_plant
from .axis_equations import (
    Parameters,
    State,
    drive_torque,
    friction_of,
    inertia,
    initial_mode,
    past_stop,
    rates,
    sliding_torque,
    start,
)
from .hybrid_plant import Mode, mode_rates

__all__ = [
    "State", "advance", "advance_to_event", "drive_torque", "inertia", "initial_mode", "mode_rates",
    "past_stop", "rates", "sliding_torque", "start",
]  # fmt: skip

Indicators = tuple[float, float]
Outputs = tuple[float, float, float]

machine = bind(template, hybrid_plant)
# Direction of sliding before the first request, which decides.
UNDECIDED = 2


def advance(x: State, mode: int, p: Parameters, u: float, T_l: float, h: float) -> tuple[State, int]:
    """Return state and direction of sliding after ``h`` [s], positive, with the inputs held; NaN if it is too stiff."""
    x, after = machine.advance(x, (mode, past_stop(x, p)), p, u, T_l, h)
    return (x, after[0])


def advance_to_event(
    x: State, mode: int, p: Parameters, u: float, T_l: float, h: float
) -> tuple[State, int, float, int]:
    """Return :func:`advance` over at most ``h`` [s], positive, up to the first event, its effect included.

    Returns:
        State, direction of sliding, how far it is [s], and the number of the event (``NO_EVENT``: there is none).
    """
    x, after, elapsed, which = machine.advance_to_event(x, (mode, past_stop(x, p)), p, u, T_l, h)
    x, after, _ = machine.after_events(x, after, which, 0, p, u, T_l)
    return (x, after[0], elapsed, which)


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
    return (mode_rates(x, (mode, 0), p, asked, T_l), outputs)


def after_events(x: State, mode: int, stop: int, p: Parameters, u: float, T_l: float) -> tuple[State, Mode]:
    """Return the state, and direction of sliding and end stop (-1, 0: none, 1) once none of them is at its end."""
    x, after, _ = machine.settled(x, (decided(x, mode, p, u), stop), 0, p, u, T_l)
    return (x, after)
