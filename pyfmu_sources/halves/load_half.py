"""The load's half of a drivetrain that is cut at its gear: gap, elastic shaft and load, driven by the motor's motion.

    J_l theta_l'' + b_l theta_l' = T_shaft - T_l,    d = theta_m / i - theta_l
    T_shaft = k (d -+ alpha) + c d'  beyond the gap,  0 within

The motor's motion over a step is a polynomial, so that the solution within one contact is a power series, and the next
contact event a root of a power series, found as in :mod:`linear_mode`.

In all functions: ``theta_m``: motor angle
[rad]; ``contact``: flank that touches: -1, 0 or 1; ``omega_m``: motor speed [rad/s]; ``T_l``: load torque [N.m];
``begin``: in the motion's time [s]; ``end``: in the motion's time [s].
"""

from math import sqrt
from typing import NamedTuple

from ..drivetrain.linear_mode import EPSILON, GUARD_ROUNDINGS, TERMS, Series, first_root
from ..hybrid.event_numbers import NO_EVENT


class LoadParameters(NamedTuple):
    """Inertia [kg.m2], stiffness [N.m/rad], damping, friction [N.m.s/rad], gear ratio and half-gap [rad]."""

    J_l: float
    k: float
    c: float
    b_l: float
    i: float
    alpha: float


Parameters = LoadParameters
State = tuple[float, float]
Outputs = tuple[float, float, float]
# Coefficients by powers of time: angle (four) and speed (three) of the motor.
Motion = tuple[float, float, float, float, float, float, float]

MOST_EVENTS = 5000
LOOSE = 1e-9  # of the half-gap and 1 rad


def held_motion(theta_m: float, omega_m: float) -> Motion:
    """Return the motion of held inputs: a constant angle [rad], and a constant speed [rad/s] for the damping alone."""
    return (theta_m, 0.0, 0.0, 0.0, omega_m, 0.0, 0.0)


def cubic_motion(theta: float, omega: float, theta_end: float, omega_end: float, h: float) -> Motion:
    """Return the motion that has these angles [rad] and speeds [rad/s] at both ends of ``h`` [s] (Hermite's cubic)."""
    mean = (theta_end - theta) / h
    second = (3.0 * mean - 2.0 * omega - omega_end) / h
    third = (omega + omega_end - 2.0 * mean) / (h * h)
    return (theta, omega, second, third, omega, 2.0 * second, 3.0 * third)


def moved(motion: Motion, t: float) -> Motion:
    """Return a motion with its time counted from ``t`` [s]."""
    a, b, c, d, e, f, g = motion
    return (
        a + t * (b + t * (c + t * d)),
        b + t * (2.0 * c + 3.0 * t * d),
        c + 3.0 * t * d,
        d,
        e + t * (f + t * g),
        f + 2.0 * t * g,
        g,
    )


def settled(x: State, contact: int, p: Parameters, theta_m: float, speed: float) -> int:
    """Return the flank that touches once the gap allows it; 1 without a gap.

    A motor's angle from elsewhere is never exact: within ``LOOSE`` a contact ends only when the teeth move on that way.
    ``speed``: derivative of the twist [rad/s].
    """
    if p.alpha == 0.0:
        return 1
    d = theta_m / p.i - x[0]
    side = contact if contact != 0 else 1 if d > 0.0 else -1
    beyond = side * d - p.alpha
    inwards = side * speed
    if contact != 0:
        beyond = -beyond
        inwards = -inwards
    room = rounding(x, p, theta_m)
    if beyond <= room or (beyond <= LOOSE * (1.0 + p.alpha) and inwards <= 0.0):
        return contact
    if contact == 0:
        return side
    return -contact if -contact * d > p.alpha else 0


def change(contact: int, follows: int) -> int:
    """Return the guard (0, 1) that leads from one contact to another, or ``NO_EVENT``."""
    if contact == follows:
        return NO_EVENT
    return 1 if contact == 0 and follows == -1 else 0


def rounding(x: State, p: Parameters, theta_m: float) -> float:
    """Return how far off a twist may be by rounding [rad]."""
    return GUARD_ROUNDINGS * EPSILON * (1.0 + abs(theta_m / p.i) + abs(x[0]) + p.alpha)


def shaft_torque(x: State, contact: int, p: Parameters, theta_m: float, omega_m: float) -> float:
    """Return the torque of the shaft on the load [N.m]."""
    if contact == 0:
        return 0.0
    wound = theta_m / p.i - x[0] - contact * p.alpha
    return p.k * wound + p.c * (omega_m / p.i - x[1])


def rates_and_outputs(
    x: State, contact: int, p: Parameters, theta_m: float, omega_m: float, T_l: float
) -> tuple[State, Outputs]:
    """Return the derivatives, and the outputs theta_l, omega_l and T_shaft."""
    torque = shaft_torque(x, contact, p, theta_m, omega_m)
    return ((x[1], (torque - T_l - p.b_l * x[1]) / p.J_l), (x[0], x[1], torque))


def guards(x: State, contact: int, p: Parameters, theta_m: float) -> tuple[float, float]:
    """Return how far the contact is from its end at either flank [rad]; 1 for a guard that is not in use."""
    if p.alpha == 0.0:
        return (1.0, 1.0)
    d = theta_m / p.i - x[0]
    if contact == 0:
        return (p.alpha - d, p.alpha + d)
    return (contact * d - p.alpha, 1.0)


def after(contact: int, which: int) -> int:
    """Return the contact that follows when the guard ``which`` (0 or 1) ends one."""
    if contact != 0:
        return 0
    return 1 if which == 0 else -1


def solution(
    x: State, contact: int, p: Parameters, motion: Motion, T_l: float, step: float
) -> tuple[State, float, int]:
    """Return the state at the first event within a short ``step`` [s], at what share of it, and the guard."""
    touches = 1.0 if contact != 0 else 0.0
    k, c, i = touches * p.k, touches * p.c, p.i
    theta: Series = [x[0]]
    omega: Series = [x[1]]
    driver: Series = [motion[0] / i]
    scale = 1.0
    for n in range(TERMS):
        angle = motion[n] if n < 4 else 0.0
        speed = motion[4 + n] if n < 3 else 0.0
        push = scale * (k * angle + c * speed) / i
        if n == 0:
            push -= T_l + k * contact * p.alpha
        f = step / (n + 1)
        a, b = theta[n], omega[n]
        theta.append(f * b)
        omega.append(f * (push - k * a - (c + p.b_l) * b) / p.J_l)
        scale *= step
        driver.append(scale * motion[n + 1] / i if n < 3 else 0.0)
    share = 1.0
    which = NO_EVENT
    if p.alpha > 0.0:
        tolerance = rounding(x, p, motion[0])
        for candidate in range(1 if contact != 0 else 2):
            side = 1.0 if contact > 0 or (contact == 0 and candidate == 1) else -1.0
            offset = -p.alpha if contact != 0 else p.alpha
            room: Series = [offset + tolerance + side * (driver[0] - theta[0])]
            for n in range(1, TERMS + 1):
                room.append(side * (driver[n] - theta[n]))
            time = first_root(room, share, tolerance)
            if time < share:
                share = time
                which = candidate
    return ((value(theta, share), value(omega, share)), share, which)


def value(series: Series, time: float) -> float:
    """Return a power series at ``time``, 0 to 1."""
    total = series[TERMS]
    for n in range(TERMS - 1, -1, -1):
        total = series[n] + time * total
    return total


def fastest(p: Parameters) -> float:
    """Return a rate [1/s] that none of the motion exceeds."""
    return sqrt(p.k / p.J_l) + (p.c + p.b_l) / p.J_l


def advance_to_event(
    x: State, contact: int, p: Parameters, motion: Motion, T_l: float, begin: float, end: float
) -> tuple[State, float, int]:
    """Return the state at the first event of a motion between two times, the time, and the guard."""
    longest = 1.0 / fastest(p)
    time = begin
    there = moved(motion, begin)
    which = change(contact, settled(x, contact, p, there[0], there[1] / p.i - x[1]))
    if which != NO_EVENT:
        return (x, begin, which)
    while time < end:
        step = end - time
        last = step <= longest
        if not last:
            step = longest
        x, share, which = solution(x, contact, p, moved(motion, time), T_l, step)
        if which != NO_EVENT:
            return (x, time + share * step, which)
        if last:
            break
        time += step
    return (x, end, NO_EVENT)


def advance(
    x: State, contact: int, p: Parameters, motion: Motion, T_l: float, begin: float, end: float
) -> tuple[State, int]:
    """Return state and contact at the end of a motion, all events inside; NaN where there are far too many."""
    time = begin
    for _ in range(MOST_EVENTS):
        x, time, which = advance_to_event(x, contact, p, motion, T_l, time, end)
        if which == NO_EVENT:
            return (x, contact)
        contact = after(contact, which)
    nan = float("nan")
    return ((nan, nan), contact)
