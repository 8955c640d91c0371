"""From one flank of the gap to the other in the least time that lands softly: three parts of the full torque.

Inside the gap motor and load are apart. The way ``w`` from mid-gap towards the wanted flank, the twist
``theta_m/i - theta_l`` with the sign of that flank, obeys

    M w'' = T,    tau T' = u - T,    M = J_m i,

once the request cancels what else accelerates motor and load. Such a chain of three is driven to a given way,
speed and torque in the least time by a request at its limits that changes sign at most twice (Pontryagin's
principle; Athans and Falb, Optimal Control, 1966, chapter 7). Here the requests are ``+level``, ``-level`` and
``+level``, and the end has the way and the speed that are asked for, and no torque. For a first part of given
duration the others follow in closed form; the first is the root of the way that is left at the end.

In all functions: a point is ``(way [rad], its speed [rad/s], torque [N.m])``; ``level`` of the request [N.m],
``tau`` of the drive [s], ``inertia`` M [kg.m2].
"""

from math import exp, fabs, log, sqrt
from typing import NamedTuple

NARROWINGS = 40
WIDENINGS = 30
WIDER = 4.0
SHORTEST = 1e-3  # of tau: the duration from which the first part is widened
EXACT = 1e-10  # by which the way of a plan may miss its end [rad]
LARGEST_EXPONENT = 700.0  # of what a double holds

Point = tuple[float, float, float]


class Traversal(NamedTuple):
    """A way through the gap: where it starts, how long each request lasts [s], where it ends."""

    way: float
    speed: float
    torque: float
    level: float
    first: float
    second: float
    third: float
    end_way: float
    end_speed: float


def move(point: Point, u: float, duration: float, tau: float, inertia: float) -> Point:
    """Return the point after ``duration`` [s] with the request ``u`` [N.m] held."""
    way, speed, torque = point
    fade = exp(-duration / tau)
    left = torque - u
    lagged = tau * (1.0 - fade)
    return (
        way + speed * duration + (0.5 * u * duration * duration + left * tau * (duration - lagged)) / inertia,
        speed + (u * duration + left * lagged) / inertia,
        u + left * fade,
    )


def later_parts(first: float, torque: float, ratio: float, level: float, tau: float) -> tuple[bool, float, float]:
    """Return whether a first part of ``first`` [s] can end without torque at the speed asked for, and the others [s].

    With ``x = exp(-second/tau)``, ``E = exp(-first/tau)`` and the torque ``T_1`` after the first part, the torque and
    the change of momentum at the end give ``(T_1 + level) x^2 - 2 level x + E ratio level = 0``. ``torque``: at the
    start [N.m]; ``ratio``: ``exp(c/tau)``, where ``c`` [s] is how long ``level`` takes for the change of momentum asked
    for.
    """
    fade = exp(-first / tau)
    reached = level + (torque - level) * fade
    root = level * level - (reached + level) * fade * ratio * level
    if root < 0.0 or reached + level <= 0.0:
        return (False, 0.0, 0.0)
    x = fade * ratio * level / (level + sqrt(root))
    turned = -level + (reached + level) * x
    if x > 1.0 or x <= 0.0 or turned > 0.0:
        return (False, 0.0, 0.0)
    return (True, -tau * log(x), tau * log((level - turned) / level))


def end_of(start: Point, first: float, second: float, third: float, level: float, tau: float, inertia: float) -> Point:
    """Return the point after the three parts [s] from ``start``."""
    point = move(start, level, first, tau, inertia)
    point = move(point, -level, second, tau, inertia)
    return move(point, level, third, tau, inertia)


def end_of_parts(
    start: Point, first: float, ratio: float, level: float, tau: float, inertia: float
) -> tuple[bool, float, float, float]:
    """Return whether a first part [s] can end as asked for, the other parts [s], and the way [rad] at their end."""
    possible, second, third = later_parts(first, start[2], ratio, level, tau)
    if not possible:
        return (False, 0.0, 0.0, 0.0)
    return (True, second, third, end_of(start, first, second, third, level, tau, inertia)[0])


def go_on(way: float, speed: float, level: float) -> Traversal:
    """Return the even way on from ``way`` [rad] at ``speed`` [rad/s]: a traversal whose parts last no time."""
    return Traversal(way, speed, 0.0, level, 0.0, 0.0, 0.0, way, speed)


def plan(start: Point, end_way: float, end_speed: float, level: float, tau: float, inertia: float) -> Traversal:
    """Return the traversal from ``start`` that is at ``end_way`` [rad] with ``end_speed`` [rad/s] and without torque.

    Where there is none, since the start is too near or too quick to end so, its three parts last no time: it
    is a way from the start on with the speed asked for. The first part is enclosed, then found by the Illinois method
    (Dowell and Jarratt, BIT 11, 1971); where its lower end has no way yet, by halving.
    """
    momentum = (end_speed - start[1]) * inertia - start[2] * tau
    ratio = exp(max(-LARGEST_EXPONENT, min(LARGEST_EXPONENT, momentum / level / tau)))
    none = go_on(start[0], end_speed, level)
    has_low, second, third, way = end_of_parts(start, 0.0, ratio, level, tau, inertia)
    below = way - end_way
    if has_low and below > 0.0:
        return none
    low = 0.0
    high = SHORTEST * tau
    beyond = 0.0
    side = 0
    for _ in range(WIDENINGS):
        possible, second, third, way = end_of_parts(start, high, ratio, level, tau, inertia)
        beyond = way - end_way
        if possible and beyond > 0.0:
            break
        low = high
        high *= WIDER
        has_low = possible
        below = beyond
    for _ in range(NARROWINGS):
        first = high - beyond * (high - low) / (beyond - below) if has_low else 0.5 * (low + high)
        possible, second, third, way = end_of_parts(start, first, ratio, level, tau, inertia)
        miss = way - end_way
        if possible and fabs(miss) < EXACT:
            return Traversal(start[0], start[1], start[2], level, first, second, third, end_way, end_speed)
        if possible and miss > 0.0:
            high = first
            beyond = miss
            below = 0.5 * below if side > 0 else below
            side = 1
        else:
            low = first
            below = miss
            beyond = 0.5 * beyond if side < 0 and has_low else beyond
            side = -1
            has_low = possible
    # Between what cannot be had and what overshoots there may be nothing that ends at the place.
    return none


def point_at(t: Traversal, time: float, tau: float, inertia: float) -> Point:
    """Return the point of a traversal at ``time`` [s]; behind its end it goes on evenly."""
    point = (t.way, t.speed, t.torque)
    first = min(time, t.first)
    second = min(time - first, t.second)
    third = min(time - first - second, t.third)
    left = time - first - second - third
    if left > 0.0:
        return (t.end_way + t.end_speed * left, t.end_speed, 0.0)
    point = move(point, t.level, first, tau, inertia)
    point = move(point, -t.level, second, tau, inertia)
    return move(point, t.level, third, tau, inertia)


def request_at(t: Traversal, begin: float, end: float) -> float:
    """Return the mean request [N.m] of a traversal between two instants [s]; behind its end it is zero."""
    turn = t.first + t.second
    last = turn + t.third
    first = max(0.0, min(end, t.first) - begin)
    second = max(0.0, min(end, turn) - max(begin, t.first))
    third = max(0.0, min(end, last) - max(begin, turn))
    return t.level * (first - second + third) / (end - begin)
