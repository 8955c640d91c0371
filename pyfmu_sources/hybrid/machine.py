"""The hybrid machine of every plant: integrate, locate an event, give it its effect, settle, go on.

Integration is by Dormand and Prince's method of order 5(4) (J. Comput. Appl. Math. 6, 1980): its error estimate chooses
the steps, so that no law has to say how quick it is. The torque of a drive that follows a held request has a closed
form, from which stages take it: a drive that is far quicker than its machine asks for no short steps.

It is written for the names of :mod:`.plant`, and bound to each plant (:mod:`.binding`).

In all functions: ``h``: length of the step [s]; ``u``: requested torque [N.m], delayed and saturated already;
``T_l``: load torque [N.m].
"""

from math import exp, sqrt
from typing import Annotated

from ..laws.drive import UNASKED, ramp
from ..laws.parameter_rows import BIG
from .event_numbers import NO_EVENT, TOO_MUCH
from .plant import (
    COUNT,
    DRIVE,
    GUARDS,
    REQUEST,
    TOLERANCE,
    Mode,
    Parameters,
    State,
    asked,
    begin_step,
    end_step,
    guard,
    guard_room,
    mode_rates,
    switched,
    turning,
    with_drive,
)

SLOTS = (
    "COUNT", "DRIVE", "GUARDS", "REQUEST", "TOLERANCE", "Mode", "Parameters", "State", "asked", "begin_step",
    "end_step", "guard", "guard_room", "mode_rates", "switched", "turning", "with_drive",
)  # fmt: skip

ABSOLUTE = 0.01  # rad, rad/s or N.m, times the tolerance: what counts as much as the state itself near zero
SLOW = 0.01  # of the drive's lag: its torque is smooth within a shorter step
NEVER = 1e300
# Integration steps that one communication step may take, and how many more for each second of it. What needs more is
# stiffer than any machine: the step ends with NaN, which the FMU refuses.
MAX_STEPS = 5000
MAX_STEPS_PER_SECOND = 40000.0
LOCATE_STEPS = 60
# An event counts as this many steps: 200 bounces fit into the work of one communication step.
WORK_OF_EVENT = 15
# An indicator turns negative when its guard is this many roundings below zero, so that the event update, which
# wants one, surely finds it violated.
ROOMS = 2.0


def is_quick(p: Parameters, h: float) -> bool:
    """Tell whether a drive moves within a step, and follows the request itself: not a filtered or limited one."""
    return h > SLOW * p.tau and p.tau > 0.0 and p.drive_filter_time_constant <= 0.0 and p.rate_limit_rate >= BIG


def driven(x: State, after: State, p: Parameters, u: float, h: float) -> State:
    """Return ``after``, ``h`` [s] later, with the torque of a quick drive then: ``u + (T_m - u) exp(-h / tau)``."""
    return with_drive(after, u + (x[DRIVE] - u) * exp(-h / p.tau))


def runge_kutta(
    x: State, k1: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float
) -> tuple[State, State, float]:
    """Return the state after one step, its derivative there and the scaled error: below 1 within the tolerance."""
    quick = is_quick(p, h)
    at = tuple(x[n] + h / 5.0 * k1[n] for n in range(COUNT))
    k2 = mode_rates(driven(x, at, p, u, h / 5.0) if quick else at, mode, p, u, T_l)
    at = tuple(x[n] + h * (3.0 / 40.0 * k1[n] + 9.0 / 40.0 * k2[n]) for n in range(COUNT))
    k3 = mode_rates(driven(x, at, p, u, 0.3 * h) if quick else at, mode, p, u, T_l)
    at = tuple(x[n] + h * (44.0 / 45.0 * k1[n] + -56.0 / 15.0 * k2[n] + 32.0 / 9.0 * k3[n]) for n in range(COUNT))
    k4 = mode_rates(driven(x, at, p, u, 0.8 * h) if quick else at, mode, p, u, T_l)
    at = tuple(
        x[n]
        + h * (19372.0 / 6561.0 * k1[n] + -25360.0 / 2187.0 * k2[n] + 64448.0 / 6561.0 * k3[n] + -212.0 / 729.0 * k4[n])
        for n in range(COUNT)
    )
    k5 = mode_rates(driven(x, at, p, u, 8.0 / 9.0 * h) if quick else at, mode, p, u, T_l)
    at = tuple(
        x[n] + h * (
            9017.0 / 3168.0 * k1[n] + -355.0 / 33.0 * k2[n] + 46732.0 / 5247.0 * k3[n] + 49.0 / 176.0 * k4[n]
            + -5103.0 / 18656.0 * k5[n]
        ) for n in range(COUNT)
    )  # fmt: skip
    k6 = mode_rates(driven(x, at, p, u, h) if quick else at, mode, p, u, T_l)
    after = tuple(
        x[n] + h * (
            35.0 / 384.0 * k1[n] + 500.0 / 1113.0 * k3[n] + 125.0 / 192.0 * k4[n] + -2187.0 / 6784.0 * k5[n]
            + 11.0 / 84.0 * k6[n]
        ) for n in range(COUNT)
    )  # fmt: skip
    after = driven(x, after, p, u, h) if quick else after
    k7 = mode_rates(after, mode, p, u, T_l)
    shares = tuple(
        h * (
            71.0 / 57600.0 * k1[n] + -71.0 / 16695.0 * k3[n] + 71.0 / 1920.0 * k4[n] + -17253.0 / 339200.0 * k5[n]
            + 22.0 / 525.0 * k6[n] + -1.0 / 40.0 * k7[n]
        ) / (TOLERANCE * (ABSOLUTE + max(abs(x[n]), abs(after[n])))) for n in range(COUNT)
    )  # fmt: skip
    square = 0.0
    known = DRIVE if quick else -1
    for n in range(COUNT):
        if n != known:
            square += shares[n] * shares[n]
    return (after, k7, sqrt(square / 8.0))


def refused(x: State) -> State:
    """Return the state that says that a step has no result: NaN throughout."""
    return tuple(float("nan") for n in range(COUNT))


def violated(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> int:
    """Return the guard that ``x`` violates most, relative to its room, or -1."""
    worst = -1
    depth = 1.0
    for which in range(GUARDS):
        value = guard(x, mode, which, p, u, T_l)
        if value < 0.0:
            excess = -value / guard_room(x, mode, which, p)
            if excess > depth:
                depth = excess
                worst = which
    return worst


def settled(x: State, mode: Mode, events: int, p: Parameters, u: float, T_l: float) -> tuple[State, Mode, int]:
    """Return state and mode once no guard is violated any more at this moment."""
    for _ in range(2 * GUARDS):
        which = violated(x, mode, p, u, T_l)
        if which < 0:
            break
        x, mode = switched(x, mode, which, events, p, u, T_l)
        events += 1
    return (x, mode, events)


def after_events(
    x: State, mode: Mode, which: int, events: int, p: Parameters, u: float, T_l: float
) -> tuple[State, Mode, int]:
    """Return state, mode and number of events in a row once no guard is violated."""
    if which != NO_EVENT:
        x, mode = switched(x, mode, which, events, p, u, T_l)
        events += 1
    return settled(x, mode, events, p, u, T_l)


def indicator(x: State, mode: Mode, which: int, p: Parameters, u: float, T_l: float) -> float:
    """Return an event indicator, 1 if it is not in use."""
    value = guard(x, mode, which, p, u, T_l)
    if value >= NEVER:
        return 1.0
    return value + ROOMS * guard_room(x, mode, which, p)


def indicators(x: State, mode: Mode, p: Parameters, u: float, T_l: float) -> Annotated[tuple[float, ...], GUARDS]:
    """Return all event indicators; the mode ends when one turns negative."""
    return tuple(indicator(x, mode, which, p, u, T_l) for which in range(GUARDS))


def depth(x: State, mode: Mode, which: int, p: Parameters, u: float, T_l: float) -> float:
    """Return how far a guard is from its event, which has it between one and two roundings below zero."""
    return guard(x, mode, which, p, u, T_l) + 1.5 * guard_room(x, mode, which, p)


def locate(
    x: State, k1: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float, beyond: State, which: int
) -> tuple[State, float, int]:
    """Return (state, time, guard) at which the first guard turns negative inside a step.

    Regula falsi with halved ends (Illinois), and every third time the middle, where a guard is far from straight.
    ``beyond``: state at the end of the step, which violates the guard ``which``.
    """
    low, high, last = 0.0, h, 0
    above, below = depth(x, mode, which, p, u, T_l), depth(beyond, mode, which, p, u, T_l)
    for n in range(LOCATE_STEPS):
        share = above / (above - below) if n % 3 != 2 and above < NEVER else 0.5
        time = low + share * (high - low)
        if time <= low or time >= high:
            time = 0.5 * (low + high)
            if time <= low or time >= high:
                break
        state, _k, _e = runge_kutta(x, k1, mode, p, u, T_l, time)
        found = violated(state, mode, p, u, T_l)
        if found < 0:
            below = 0.5 * below if last < 0 else below
            above = depth(state, mode, which, p, u, T_l)
            low, last = time, -1
            continue
        above = NEVER if found != which else 0.5 * above if last > 0 else above
        below = depth(state, mode, found, p, u, T_l)
        high, last, beyond, which = time, 1, state, found
        if -below <= 0.5 * guard_room(state, mode, which, p):
            break
    return (beyond, high, which)


def to_event(
    x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float, elapsed: float, work: int
) -> tuple[State, Mode, float, int, int]:
    """Return the solution from ``elapsed`` [s] in a step on, at its next event or at the step's end."""
    k1 = mode_rates(x, mode, p, u, T_l)
    step = h - elapsed
    most = MAX_STEPS + int(MAX_STEPS_PER_SECOND * h)
    while work < most:
        work += 1
        last = elapsed + step >= h
        if last:
            step = h - elapsed
        after, k7, error = runge_kutta(x, k1, mode, p, u, T_l, step)
        if not error <= 1.0:
            if step > 1e-12 * h:
                step *= max(0.2, 0.9 * error**-0.2) if error < NEVER else 0.2
                continue
            if not error < NEVER:
                break
        which = violated(after, mode, p, u, T_l)
        turn = turning(x, k1, after, k7, mode, p, step) if which < 0 else 0.0
        if turn > 0.0:
            inside, _k, _e = runge_kutta(x, k1, mode, p, u, T_l, turn)
            which = violated(inside, mode, p, u, T_l)
            if which >= 0:
                after, step = inside, turn
        if which >= 0:
            after, step, which = locate(x, k1, mode, p, u, T_l, step, after, which)
            return (after, mode, elapsed + step, work + WORK_OF_EVENT, which)
        x = after
        k1 = k7
        elapsed += step
        mode, changed = end_step(x, mode, p)
        if changed:
            k1 = mode_rates(x, mode, p, u, T_l)
        if last:
            return (x, mode, h, work, NO_EVENT)
        step *= min(5.0, 0.9 * error**-0.2) if error > 1e-10 else 5.0
    return (x, mode, elapsed, work, TOO_MUCH)


def advance_held(x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float) -> tuple[State, Mode]:
    """Return :func:`advance` for a request whose ramp does not end inside the step."""
    elapsed = 0.0
    work = 0
    x, mode = begin_step(x, mode, p, T_l)
    x, mode, events = settled(x, mode, 0, p, u, T_l)
    while elapsed < h:
        x, mode, elapsed, work, which = to_event(x, mode, p, u, T_l, h, elapsed, work)
        if which == TOO_MUCH:
            return (refused(x), mode)
        if which == NO_EVENT:
            return (x, mode)
        x, mode = switched(x, mode, which, events, p, u, T_l)
        x, mode, events = settled(x, mode, events + 1, p, u, T_l)
    return (x, mode)


def held_to_event(
    x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float
) -> tuple[State, Mode, float, int]:
    """Return :func:`advance_to_event` for a request whose ramp does not end inside the step."""
    x, mode = begin_step(x, mode, p, T_l)
    x, mode, _ = settled(x, mode, 0, p, u, T_l)
    x, mode, elapsed, _, which = to_event(x, mode, p, u, T_l, h, 0.0, 0)
    return (refused(x) if which == TOO_MUCH else x, mode, elapsed, which)


def request_begun(x: State, p: Parameters, u: float) -> State:
    """Return the state with a drive that follows its request settled at what is asked first."""
    follows = p.drive_filter_time_constant > 0.0 or p.rate_limit_rate < BIG
    return asked(x, u) if follows and x[REQUEST] == UNASKED else x


def advance(x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float) -> tuple[State, Mode]:
    """Return state and mode after ``h`` [s] with the inputs held; NaN where no step size resolves the motion.

    The end of a ramp of the request, which is limited in its rate, is met exactly.
    """
    x = request_begun(x, p, u)
    if p.rate_limit_rate >= BIG:
        return advance_held(x, mode, p, u, T_l, h)
    duration, target, end = ramp(x[REQUEST], u, p.drive_filter_time_constant, p.rate_limit_rate, h)
    if duration > 0.0:
        x, mode = advance_held(x, mode, p, target, T_l, duration)
    if duration < h:
        if duration > 0.0:
            x = asked(x, end)
        x, mode = advance_held(x, mode, p, u, T_l, h - duration)
    return (x, mode)


def advance_to_event(
    x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float
) -> tuple[State, Mode, float, int]:
    """Return :func:`advance` up to the first event, which has not had its effect yet.

    Returns:
        State, mode, how far it is [s], and the guard that ends the mode (``NO_EVENT``: none does).
    """
    x = request_begun(x, p, u)
    duration = 0.0
    if p.rate_limit_rate < BIG:
        duration, target, end = ramp(x[REQUEST], u, p.drive_filter_time_constant, p.rate_limit_rate, h)
        if duration > 0.0:
            x, mode, elapsed, which = held_to_event(x, mode, p, target, T_l, duration)
            if which != NO_EVENT or duration >= h:
                return (x, mode, elapsed, which)
            x = asked(x, end)
    x, mode, elapsed, which = held_to_event(x, mode, p, u, T_l, h - duration)
    return (x, mode, duration + elapsed, which)
