"""The events of the two-stage drivetrain: what ends a mode, what follows it, and what model exchange sees of both.

Guards are numbered: 0 and 1 for the contact of stage 1, 2 and 3 for that of stage 2; 4 and 5, 6 and 7, 8 and 9 for the
dry friction of motor, intermediate shaft and load. Of a pair both are in use inside a gap and while a body sticks, else
the first alone. A mode ends when a guard turns negative. All guards are affine in the state.

In all functions: ``which``: number of a guard; ``constant``: 1: with inputs and offsets; 0: the linear part alone;
``u``: requested torque [N.m], delayed and saturated already; ``T_l``: load torque [N.m].
"""

from typing import Annotated

from ..drivetrain.linear_mode import EPSILON, GUARD_ROUNDINGS
from ..hybrid.event_numbers import NO_EVENT
from ..laws.drive import saturated
from .train_equations import (
    Mode,
    Parameters,
    State,
    friction_levels,
    half_gaps,
    linear_rates,
    outside_torques,
    pushes,
    stage_torques,
    twists,
)

Outputs = tuple[float, float, float, float, float, float, float, float, float, float, float]

GUARDS = 10
Indicators = Annotated[tuple[float, ...], GUARDS]
FRICTION = 4  # the first guard of dry friction
# An indicator turns negative when its guard is this many roundings below zero, so that the event update, which
# wants one, surely finds it violated.
ROOMS = 2.0


def is_in_use(mode: Mode, which: int, p: Parameters) -> bool:
    """Tell whether the guard can end the mode."""
    pair = which // 2
    present = half_gaps(p)[pair] > 0.0 if which < FRICTION else friction_levels(p)[pair - 2] > 0.0
    return present and (mode[pair] == 0 or which % 2 == 0)


def guard(x: State, constant: float, mode: Mode, which: int, p: Parameters, T_l: float) -> float:
    """Return the guard ``which`` of ``mode``, in rad (contacts), rad/s (a body slides) or N.m (it sticks)."""
    pair = which // 2
    side = 1.0 if which % 2 == 0 else -1.0
    if which < FRICTION:
        twist = twists(x, p)[pair]
        alpha = constant * half_gaps(p)[pair]
        return alpha - side * twist if mode[pair] == 0 else mode[pair] * twist - alpha
    body = pair - 2
    if mode[pair] != 0:
        return mode[pair] * x[2 * body + 1]
    return constant * friction_levels(p)[body] - side * pushes(x, constant, mode, p, T_l)[body]


def guard_room(x: State, mode: Mode, which: int, p: Parameters) -> float:
    """Return how far below zero rounding alone can take a guard."""
    roundings = GUARD_ROUNDINGS * EPSILON
    first = 1.0 + abs(x[0] / p.i_1) + abs(x[2]) + p.alpha_1
    second = 1.0 + abs(x[2] / p.i_2) + abs(x[4]) + p.alpha_2
    if which < FRICTION:
        return roundings * (first if which < 2 else second)
    pair = which // 2
    if mode[pair] != 0:
        return roundings * (1.0 + abs(x[2 * pair - 3]))
    turning = p.c_1 * (abs(x[1] / p.i_1) + abs(x[3])) + p.c_2 * (abs(x[3] / p.i_2) + abs(x[5]))
    return roundings * (1.0 + abs(x[6]) + friction_levels(p)[pair - 2] + p.k_1 * first + p.k_2 * second + turning)


def with_item(mode: Mode, place: int, item: int) -> Mode:
    """Return the mode with another item at a place."""
    return (
        item if place == 0 else mode[0],
        item if place == 1 else mode[1],
        item if place == 2 else mode[2],
        item if place == 3 else mode[3],
        item if place == 4 else mode[4],
    )


def switch_mode(x: State, mode: Mode, which: int) -> tuple[State, Mode]:
    """Return state and mode after the guard ``which`` has ended ``mode``; a body that stops sticks, for now."""
    pair = which // 2
    if mode[pair] == 0:
        return (x, with_item(mode, pair, 1 if which % 2 == 0 else -1))
    if which >= FRICTION:
        x = (
            x[0], 0.0 if pair == 2 else x[1], x[2], 0.0 if pair == 3 else x[3], x[4], 0.0 if pair == 4 else x[5], x[6],
        )  # fmt: skip
    return (x, with_item(mode, pair, 0))


def settle_mode(x: State, mode: Mode, p: Parameters, T_l: float) -> tuple[State, Mode]:
    """Return state and mode once no guard is violated any more at this moment: contacts first, then friction."""
    for _ in range(2):
        for which in range(GUARDS):
            if is_in_use(mode, which, p) and guard(x, 1.0, mode, which, p, T_l) < -guard_room(x, mode, which, p):
                x, mode = switch_mode(x, mode, which)
    return (x, mode)


def after_events(x: State, mode: Mode, which: int, p: Parameters, T_l: float) -> tuple[State, Mode]:
    """Return state and mode after an event (``NO_EVENT``: none is known), settled at the inputs of the moment."""
    if which != NO_EVENT:
        x, mode = switch_mode(x, mode, which)
    return settle_mode(x, mode, p, T_l)


def state_rates(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> State:
    """Return the time derivative of ``x`` in ``mode``."""
    return linear_rates(x, 1.0, mode, p, outside_torques(mode, p, u, T_l))


def rates_and_outputs(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> tuple[State, Outputs]:
    """Return the derivatives, and all outputs but the contacts; limits ``u``."""
    first, second = stage_torques(x, 1.0, mode, p)
    twist_1, twist_2 = twists(x, p)
    outputs = (
        x[0] + p.sensor_offset_motor_offset, x[2], x[4] + p.sensor_offset_load_offset, x[1], x[3], x[5], x[6],
        first, second, twist_1, twist_2,
    )  # fmt: skip
    return (state_rates(x, mode, p, saturated(u, p.torque_saturation_limit), T_l), outputs)


def output_rates(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> Outputs:
    """Return the derivatives of the outputs of :func:`rates_and_outputs`, with the inputs held."""
    r = state_rates(x, mode, p, u, T_l)
    first, second = stage_torques(r, 0.0, mode, p)
    turn_1, turn_2 = twists(r, p)
    return (r[0], r[2], r[4], r[1], r[3], r[5], r[6], first, second, turn_1, turn_2)


def indicator(x: State, mode: Mode, which: int, p: Parameters, T_l: float) -> float:
    """Return the event indicator ``which``, 1 if it is not in use."""
    if not is_in_use(mode, which, p):
        return 1.0
    return guard(x, 1.0, mode, which, p, T_l) + ROOMS * guard_room(x, mode, which, p)


def indicators(x: State, mode: Mode, p: Parameters, T_l: float) -> Indicators:
    """Return all event indicators; the mode ends when one turns negative."""
    return tuple(indicator(x, mode, which, p, T_l) for which in range(GUARDS))
