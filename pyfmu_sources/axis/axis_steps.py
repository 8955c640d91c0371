"""A single axis between its events: steps of a Runge-Kutta method, and when within one of them an event falls.

In all functions: ``mode``: direction of sliding, 0: none; ``u``: requested torque [N.m], delayed and saturated
already; ``T_l``: load torque [N.m]; ``h``: length of the step [s].
"""

from math import exp, sqrt

from ..laws.friction import breakaway_torque, builds_up, falls, reach
from ..laws.parameter_rows import BIG, TINY
from .axis_equations import (
    Parameters,
    State,
    filtered,
    friction_of,
    mode_rates,
    past_stop,
    slip_at_rest,
)

SHARE = 0.05  # of the time in which the fastest rate acts: a step
AHEAD = 0.05  # of the time in which a sliding axis would stop: a step that comes no nearer to where friction falls
SLOWS, BREAKS, MEETS = range(3)
THERE = 1e-14  # of the torque: a drive that is no farther from its request has come there


def longest_step(x: State, mode: int, p: Parameters, u: float, T_l: float, h: float) -> float:
    """Return a step [s] that resolves all rates well (a Runge-Kutta step errs by its 5th power)."""
    rate = (p.b + abs(p.directional_friction_motor_difference) + 2.0 * p.quadratic_drag_coefficient * abs(x[1])) / p.J
    if p.torque_ripple_amplitude != 0.0:
        rate = max(
            rate,
            p.torque_ripple_cycles_per_rev
            * (abs(x[1]) + sqrt(abs(p.torque_ripple_amplitude) / (p.torque_ripple_cycles_per_rev * p.J + TINY))),
        )
    step = min(h, SHARE / (max(rate, further_rate(x, mode, p)) + TINY))
    if p.tau > 0.0:
        step = min(step, step_of_lag(x, p, u))
    if falls(friction_of(p)):
        step = step_of_fall(x, mode, p, u, T_l, step)
    return step


def step_of_lag(x: State, p: Parameters, u: float) -> float:
    """Return a step [s] that resolves the drive's lag: one that has come close to its request asks for no short one."""
    if filtered(p):
        return SHARE * p.tau
    torque = abs(x[2]) + abs(u)
    behind = abs(x[2] - u)
    if behind <= THERE * torque:
        return BIG
    return 0.5 * SHARE * p.tau * (torque / behind) ** 0.2


def step_of_fall(x: State, mode: int, p: Parameters, u: float, T_l: float, most: float) -> float:
    """Return a step [s] that resolves friction that falls with speed: near rest and far above its speed it hardly does.

    A long step may not come near that speed.

    Args:
        most: step that everything else allows [s].
    """
    fall = abs(p.stribeck_friction_motor_breakaway - p.stribeck_friction_motor_coulomb) / p.J
    short = SHARE * p.stribeck_friction_motor_stribeck_speed / (fall + TINY)
    if short >= most:
        return most
    speed = abs(x[1])
    acceleration = abs(mode_rates(x, mode, p, u, T_l)[1])
    # Near rest friction is flat: it falls by no more than twice the speed that is reached, over the square of its own.
    reached = 0.5 * short * p.stribeck_friction_motor_stribeck_speed
    near = 2.0 * reached / (speed + sqrt(speed * speed + 4.0 * acceleration * reached) + TINY * TINY)
    ratio = 0.5 * speed / p.stribeck_friction_motor_stribeck_speed
    if ratio < 1.0:
        return min(most, max(short, near))
    ahead = AHEAD * speed / (acceleration + TINY)
    return min(most, max(short, min(ahead, short / (2.0 * ratio * exp(-ratio * ratio) + TINY))))


def further_rate(x: State, mode: int, p: Parameters) -> float:
    """Return the fastest rate [1/s] of bristle, filter, harmonics, spring, end stops and varying inertia."""
    rate = 0.0
    f = friction_of(p)
    if mode == 0 and builds_up(f):
        stiffness = breakaway_torque(f) / f.distance
        rate = max(sqrt(stiffness / p.J), f.damping / p.J) + abs(x[1]) / (reach(f, x[1], x[0], 0.0) + TINY)
    if p.drive_filter_time_constant > 0.0:
        rate = max(rate, 1.0 / p.drive_filter_time_constant)
    if p.torque_ripple_second_amplitude != 0.0 or p.torque_ripple_third_amplitude != 0.0:
        torque = abs(p.torque_ripple_second_amplitude) + abs(p.torque_ripple_third_amplitude)
        rate = max(
            rate,
            3.0
            * p.torque_ripple_cycles_per_rev
            * (abs(x[1]) + sqrt(torque / (p.torque_ripple_cycles_per_rev * p.J + TINY))),
        )
    if p.spring_load_stiffness != 0.0 or p.spring_load_cubic != 0.0:
        way = x[0] - p.spring_load_angle
        rate = max(rate, sqrt((abs(p.spring_load_stiffness) + 3.0 * abs(p.spring_load_cubic) * way * way) / p.J))
    if past_stop(x, p) != 0:
        rate = max(rate, sqrt(p.end_stop_stiffness * (1.0 + p.end_stop_dissipation * abs(x[1])) / p.J))
    if p.varying_inertia_amplitude != 0.0:
        rate = max(rate, p.varying_inertia_cycles_per_rev * abs(x[1]))
    if p.periodic_friction_motor_amplitude != 0.0:
        rate = max(
            rate,
            p.periodic_friction_motor_cycles_per_rev
            * (
                abs(x[1])
                + sqrt(
                    abs(p.periodic_friction_motor_amplitude) / (p.periodic_friction_motor_cycles_per_rev * p.J + TINY)
                )
            ),
        )
    return rate


def along(x: State, h: float, r: State) -> State:
    """Return ``x + h r``."""
    return (x[0] + h * r[0], x[1] + h * r[1], x[2] + h * r[2], x[3] + h * r[3], x[4] + h * r[4])


def driven(x: State, after: State, p: Parameters, u: float, h: float) -> State:
    """Return the state ``after``, ``h`` [s] later, with the drive's torque then: ``u + (drive - u) exp(-h / tau)``."""
    if p.tau <= 0.0 or filtered(p):
        return after
    return (after[0], after[1], u + (x[2] - u) * exp(-h / p.tau), after[3], after[4])


def smooth_step(x: State, mode: int, p: Parameters, u: float, T_l: float, h: float) -> State:
    """Return the state after one classical Runge-Kutta step in one direction of sliding."""
    a = mode_rates(x, mode, p, u, T_l)
    b = mode_rates(driven(x, along(x, 0.5 * h, a), p, u, 0.5 * h), mode, p, u, T_l)
    c = mode_rates(driven(x, along(x, 0.5 * h, b), p, u, 0.5 * h), mode, p, u, T_l)
    d = mode_rates(driven(x, along(x, h, c), p, u, h), mode, p, u, T_l)
    w = h / 6.0
    after = (
        x[0] + w * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0]),
        x[1] + w * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1]),
        x[2] + w * (a[2] + 2.0 * b[2] + 2.0 * c[2] + d[2]),
        x[3] + w * (a[3] + 2.0 * b[3] + 2.0 * c[3] + d[3]),
        x[4] + w * (a[4] + 2.0 * b[4] + 2.0 * c[4] + d[4]),
    )
    return driven(x, after, p, u, h)


def held(x: State, p: Parameters, u: float, T_l: float, h: float) -> State:
    """Return the state after ``h`` [s] at rest: the drive's torque alone moves."""
    if filtered(p):
        return smooth_step((x[0], 0.0, x[2], x[3], x[4]), 0, p, u, T_l, h)
    return driven(x, (x[0], 0.0, x[2], x[3], x[4]), p, u, h)


def is_before(what: int, x: State, mode: int, p: Parameters, u: float, T_l: float, h: float, least: float) -> bool:
    """Tell whether an event, one of ``SLOWS``, ``BREAKS``, ``MEETS``, is still to come after ``h`` [s]."""
    if what == BREAKS:
        return slip_at_rest(held(x, p, u, T_l, h), p, u, T_l) == 0
    after = smooth_step(x, mode, p, u, T_l, h)
    if what == SLOWS:
        return after[1] * mode > least
    return past_stop(after, p) == past_stop(x, p)


def event_time(what: int, x: State, mode: int, p: Parameters, u: float, T_l: float, h: float, least: float) -> float:
    """Return when within ``h`` [s] an event falls, by bisection.

    Args:
        what: ``SLOWS``: an axis that slides falls to the speed ``least`` [rad/s]; ``BREAKS``: the growing torque of the
            drive breaks one away that sticks; ``MEETS``: it reaches or leaves an end stop.
    """
    low, high = 0.0, h
    for _ in range(50):
        middle = 0.5 * (low + high)
        if is_before(what, x, mode, p, u, T_l, middle, least):
            low = middle
        else:
            high = middle
    return high
