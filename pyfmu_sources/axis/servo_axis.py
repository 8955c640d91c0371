"""The single axis as the adapters and the orchestrator use it: start, advance, read.

Its equations are in :mod:`axis_equations`, its integration steps in :mod:`axis_steps`.

In all functions: ``u``: requested torque [N.m], delayed and saturated already; ``T_l``: load torque [N.m]; ``mode``:
direction of sliding, 0: none.
"""

from ..laws.drive import UNASKED, ramp
from ..laws.friction import bristle_slip, builds_up, is_dry, leaving_speed, reach
from ..laws.parameter_rows import BIG
from .axis_equations import (
    Parameters,
    State,
    drive_torque,
    filtered,
    friction_of,
    inertia,
    initial_mode,
    mode_rates,
    past_stop,
    rates,
    sliding_torque,
    slip_at_rest,
    start,
)
from .axis_steps import BREAKS, MEETS, SLOWS, event_time, held, longest_step, smooth_step

__all__ = [
    "State", "advance", "advance_to_event", "drive_torque", "inertia", "initial_mode", "mode_rates",
    "past_stop", "rates", "sliding_torque", "start",
]  # fmt: skip

# Integration steps that one communication step may take, and how many more for each second of it.
MAX_STEPS = 20000
MAX_STEPS_PER_SECOND = 20000.0


def advance(x: State, mode: int, p: Parameters, u: float, T_l: float, h: float) -> tuple[State, int]:
    """Return state and direction of sliding after ``h`` [s], positive, with the inputs held; stops are located.

    The state is NaN where damping, lag or ripple are so quick that no sensible number of steps resolves them.
    """
    if x[4] == UNASKED and filtered(p):
        x = (x[0], x[1], x[2], x[3], u)
    if p.rate_limit_rate >= BIG:
        return advance_request(x, mode, p, u, T_l, h)
    duration, target, end = ramp(x[4], u, p.drive_filter_time_constant, p.rate_limit_rate, h)
    if duration > 0.0:
        x, mode = advance_request(x, mode, p, target, T_l, duration)
    if duration < h:
        if duration > 0.0:
            x = (x[0], x[1], x[2], x[3], end)
        x, mode = advance_request(x, mode, p, u, T_l, h - duration)
    return (x, mode)


def advance_request(x: State, mode: int, p: Parameters, u: float, T_l: float, h: float) -> tuple[State, int]:
    """Return :func:`advance` for a request whose ramp does not end inside the step."""
    elapsed = 0.0
    pieces = 0
    event = True
    while event:
        x, mode, elapsed, pieces, event = request_to_event(x, mode, p, u, T_l, h, elapsed, pieces)
    return (x, mode)


def advance_to_event(
    x: State, mode: int, p: Parameters, u: float, T_l: float, h: float
) -> tuple[State, int, float, bool]:
    """Return :func:`advance` over at most ``h`` [s], positive, up to the first event, its effect included.

    Returns:
        State, direction of sliding, how far it is [s], and whether there is an event.
    """
    if x[4] == UNASKED and filtered(p):
        x = (x[0], x[1], x[2], x[3], u)
    duration = 0.0
    if p.rate_limit_rate < BIG:
        duration, target, end = ramp(x[4], u, p.drive_filter_time_constant, p.rate_limit_rate, h)
        if duration > 0.0:
            x, mode, elapsed, _, event = request_to_event(x, mode, p, target, T_l, duration, 0.0, 0)
            if event or duration >= h:
                return (x, mode, elapsed, event)
            x = (x[0], x[1], x[2], x[3], end)
    x, mode, elapsed, _, event = request_to_event(x, mode, p, u, T_l, h - duration, 0.0, 0)
    return (x, mode, duration + elapsed, event)


def request_to_event(
    x: State, mode: int, p: Parameters, u: float, T_l: float, h: float, elapsed: float, pieces: int
) -> tuple[State, int, float, int, bool]:
    """Return the solution right after its next event, or at the end of a step: it breaks away, stops, or meets a stop.

    An axis that breaks away is still at rest; its direction follows from the torque of what comes next. ``x`` is at the
    time ``elapsed`` [s] since the beginning of the step.
    """
    f = friction_of(p)
    bends = builds_up(f)
    dry = is_dry(f)
    least = leaving_speed(f)
    if mode == 0 and not dry:
        mode = 1
    most = MAX_STEPS + int(MAX_STEPS_PER_SECOND * h)
    while h - elapsed > 1e-12 * h:
        pieces += 1
        if pieces > most:
            nan = float("nan")
            return ((nan, nan, nan, nan, nan), mode, h, pieces, False)
        step = min(longest_step(x, mode, p, u, T_l, h), h - elapsed)
        if dry and not bends and mode == 0:
            mode = slip_at_rest(x, p, u, T_l)
            if mode == 0:
                stays = held(x, p, u, T_l, step)
                breaks = slip_at_rest(stays, p, u, T_l) != 0
                if breaks:
                    step = event_time(BREAKS, x, mode, p, u, T_l, step, least)
                    stays = held(x, p, u, T_l, step)
                x = stays
                elapsed += step
                if breaks:
                    return (x, mode, elapsed, pieces, True)
                continue
        moved = smooth_step(x, mode, p, u, T_l, step)
        meets = past_stop(x, p) != past_stop(moved, p)
        if meets:
            step = event_time(MEETS, x, mode, p, u, T_l, step, least)
            moved = smooth_step(x, mode, p, u, T_l, step)
        if dry and mode != 0 and moved[1] * mode < least:
            step = event_time(SLOWS, x, mode, p, u, T_l, step, least)
            moved = smooth_step(x, mode, p, u, T_l, step)
            if bends:
                x = (moved[0], moved[1], moved[2], mode * reach(f, moved[1], moved[0], 0.0), moved[4])
                mode = 0
            else:
                x = (moved[0], 0.0, moved[2], moved[3], moved[4])
                mode = slip_at_rest(x, p, u, T_l)
            return (x, mode, elapsed + step, pieces, True)
        x = moved
        if bends and mode == 0:
            mode = bristle_slip(f, mode, x[3], x[1], x[0], 0.0)
        elapsed += step
        if meets:
            return (x, mode, elapsed, pieces, True)
    return (x, mode, elapsed, pieces, False)
