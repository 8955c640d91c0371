"""The drivetrain with nonlinear effects: integrated inside each smooth mode, its events located.

Between two events the right-hand side is smooth, so the integrator (:mod:`dormand_prince`) keeps its order; the events
are those of :mod:`smooth_events`.

In all functions: ``h``: length of the step [s]; ``u``: requested torque [N.m], delayed and saturated already;
``T_l``: load torque [N.m].
"""

from ..hybrid.event_numbers import NO_EVENT, TOO_MUCH
from .bristles import settled_slips
from .dormand_prince import mode_rates, runge_kutta
from .dry_friction import NEVER, direction
from .equations import Mode, Parameters, State, twist_rate
from .smooth_events import joined_body, settled, switched, violated

# Integration steps that one communication step may take, and how many more for each second of it. What needs more is
# stiffer than any machine: the step ends with NaN, which the FMU refuses.
MAX_STEPS = 5000
MAX_STEPS_PER_SECOND = 40000.0
LOCATE_STEPS = 60
# An event counts as this many steps: 200 bounces fit into the work of one communication step.
WORK_OF_EVENT = 15


def dipped(x: State, k1: State, after: State, k7: State, mode: Mode, p: Parameters, h: float) -> float:
    """Return the moment [s] inside a step at which a twist or a speed turns back, or 0 when none does."""
    turn = 0.0
    rate = twist_rate(x, p)
    rate_after = twist_rate(after, p)
    if (mode[0] != 0 and direction(mode[0]) * rate < 0.0 < direction(mode[0]) * rate_after) or (
        mode[0] == 0 and rate * rate_after < 0.0
    ):
        turn = h * rate / (rate - rate_after)
    if mode[1] * k1[1] < 0.0 < mode[1] * k7[1]:
        turn = h * k1[1] / (k1[1] - k7[1])
    if mode[2] * k1[3] < 0.0 < mode[2] * k7[3]:
        turn = h * k1[3] / (k1[3] - k7[3])
    return turn


def locate(x: State, k1: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float) -> tuple[State, float, int]:
    """Return (state, time, guard) at which the first guard turns negative inside a step that ends beyond it."""
    low = 0.0
    high = h
    beyond = x
    which = -1
    for _ in range(LOCATE_STEPS):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            break
        state, _k, _e = runge_kutta(x, k1, mode, p, u, T_l, middle)
        found = violated(state, mode, p, u, T_l)
        if found < 0:
            low = middle
        else:
            high = middle
            beyond = state
            which = found
    if which < 0:
        beyond, _k, _e = runge_kutta(x, k1, mode, p, u, T_l, h)
        which = violated(beyond, mode, p, u, T_l)
    return (beyond, high, which)


def refused(x: State) -> State:
    """Return the state that says that a step has no result: NaN throughout."""
    nan = float("nan")
    return (nan, nan, nan, nan, nan, nan, nan, nan, nan, nan, nan, nan)


def advance_smooth(x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float) -> tuple[State, Mode]:
    """Return state and mode after ``h`` [s] with the inputs held; NaN where no step size resolves the motion."""
    elapsed = 0.0
    work = 0
    x, mode = joined_body(x, mode, p, T_l)
    x, mode, events = settled(x, mode, 0, p, u, T_l)
    while elapsed < h:
        x, mode, elapsed, work, which = smooth_to_event(x, mode, p, u, T_l, h, elapsed, work)
        if which == TOO_MUCH:
            return (refused(x), mode)
        if which == NO_EVENT:
            return (x, mode)
        x, mode = switched(x, mode, which, events, p, u, T_l)
        x, mode, events = settled(x, mode, events + 1, p, u, T_l)
    return (x, mode)


def advance_smooth_to_event(
    x: State, mode: Mode, p: Parameters, u: float, T_l: float, h: float
) -> tuple[State, Mode, float, int]:
    """Return :func:`advance_smooth` up to the first event, which has not had its effect yet.

    Returns:
        State, mode, how far it is [s], and the guard that ends the mode (``NO_EVENT``: none does).
    """
    x, mode = joined_body(x, mode, p, T_l)
    x, mode, _ = settled(x, mode, 0, p, u, T_l)
    x, mode, elapsed, _, which = smooth_to_event(x, mode, p, u, T_l, h, 0.0, 0)
    return (refused(x) if which == TOO_MUCH else x, mode, elapsed, which)


def smooth_to_event(
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
        turn = dipped(x, k1, after, k7, mode, p, step)
        if turn > 0.0 and violated(after, mode, p, u, T_l) < 0:
            inside, _k, _e = runge_kutta(x, k1, mode, p, u, T_l, turn)
            if violated(inside, mode, p, u, T_l) >= 0:
                after, step, last = inside, turn, False
        if violated(after, mode, p, u, T_l) >= 0:
            after, step, which = locate(x, k1, mode, p, u, T_l, step)
            return (after, mode, elapsed + step, work + WORK_OF_EVENT, which)
        x = after
        k1 = k7
        elapsed += step
        if mode[1] == 0 or mode[2] == 0:
            settled_mode = settled_slips(x, mode, p)
            if settled_mode[1] != mode[1] or settled_mode[2] != mode[2]:
                mode = settled_mode
                k1 = mode_rates(x, mode, p, u, T_l)
        if last:
            return (x, mode, h, work, NO_EVENT)
        step *= min(5.0, 0.9 * error**-0.2) if error > 1e-10 else 5.0
    return (x, mode, elapsed, work, TOO_MUCH)
