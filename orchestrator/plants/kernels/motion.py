"""Motion of a plant by its own equations: free runs in steps of its own, and torques along a measured motion.

The direction of dry friction, which the equations take as an argument, builds up over a short distance here (Dahl's
bristle, Canudas de Wit et al., IEEE Trans. Automatic Control 40(3), 1995): real friction does, innovations become
differentiable in the parameters, and as the distance goes to zero it is the signum that the FMU uses. In the same way
the damping of teeth that meet grows with their penetration (Hunt and Crossley, J. Applied Mechanics 42(2), 1975).

These are kernels, written for the drivetrain and bound to other plants (:mod:`orchestrator.building.translation`).

In all functions: ``p``: parameters of the analysis, an array; ``values``: the same by name; ``h``: a sample [s].
"""

from math import ceil, exp

from orchestrator.building.translation.kernel_arrays import Pairs, Reals, Table
from orchestrator.plants.kernels.drivetrain import (
    LAST_SPEED,
    Values,
    bodies_of,
    friction,
    has_flanks,
    lag_of,
    meets,
    rates,
    reaches,
    rest_levels,
    values_of,
)
from orchestrator.plants.kernels.point import Point, along, with_torque

SLOTS = "orchestrator.plants.kernels.drivetrain"
DEFAULTS = "orchestrator.plants.kernels.plain"
__all__ = ["accelerate", "accelerate_with_hidden_load", "rate_at", "run_coarsely", "slide_bristle"]

NEAR = 1.5  # distances of presliding per sample below which friction counts as turning round
CALM = 0.02  # distances of presliding per sample below which it hardly changes
LAGGED = 4  # place of the drive's torque in the state

Way = tuple[int, float, float, float, float, float]
Bristle = tuple[float, float]
Hidden = tuple[float, float, float]
Unseen = tuple[float, float, float, float, float]
Seen = tuple[float, float, float, float]


def turn_bristle(
    bristle: float, speed: float, level: float, level_at_rest: float, varies: bool, distance: float, h: float
) -> Bristle:
    """Return the bristle [rad] after ``h`` at constant speed and friction's mean direction (Dahl, LuGre).

    A level that depends on more than speed may go to zero within a step, and grow again: a bristle bends no farther
    than it allows, and where it follows at once, so does the direction.
    """
    if level <= 1e-9 * level_at_rest or level_at_rest == 0.0:
        return (0.0, 0.0)
    reach = distance * level / level_at_rest
    settled = reach if speed > 0.0 else -reach
    ways = abs(speed) * h / reach
    if not varies:
        new = settled + (bristle - settled) * exp(-ways)
        return (new, 0.5 * (bristle + new) / reach)
    off = min(max(bristle, -reach), reach) - settled
    left = exp(-ways)
    mean = (1.0 - left) / ways if ways > 1e-6 else 1.0
    return (settled + off * left, (settled + off * mean) / reach)


def near_rest(speed: float, acceleration: float, distance: float, h: float) -> bool:
    """Tell whether dry friction may turn round within ``h``, so far that steps must be short."""
    way = abs(speed) * h
    change = 1.5 * h * h * abs(acceleration)
    return way < change + NEAR * distance and way + change > CALM * distance


def grown(distance: float, level: float, level_at_rest: float) -> float:
    """Return the distance over which friction builds up at a ``level`` above that at rest, which may be zero."""
    return distance * max(1.0, level / level_at_rest) if level_at_rest > 0.0 else distance


def step_of(span: float, steps: int, h: float, lag: float) -> Way:
    """Return how a ``span`` [s] of a sample is run: number of steps, their length, and what they keep of the torque.

    The drive follows what is asked by a lag that may be far quicker than a step. What is kept is the part of the
    distance between both that is left at the beginning, in the middle and at the end of a step as it acts, and at its
    end as it is. What acts is the straight line with the same impulse and the same moment, which moves a mass as far.
    """
    if span <= 1e-9 * h:
        return (0, 0.0, 0.0, 0.0, 0.0, 0.0)
    count = ceil(steps * span / h - 1e-9)
    step = span / count
    if lag <= 0.0:
        return (count, step, 1.0, 1.0, 1.0, 1.0)
    ratio = step / lag
    if ratio < 1e-3:
        left = 1.0 - ratio * (1.0 - 0.5 * ratio)
        return (count, step, 1.0, 0.5 * (1.0 + left), left, left)
    left = exp(-ratio)
    mean = (1.0 - left) / ratio
    slope = 12.0 * ((1.0 - left * (1.0 + ratio)) / (ratio * ratio) - 0.5 * mean)
    return (count, step, mean - 0.5 * slope, mean, mean + 0.5 * slope, left)


def advance(x: Point, signs: Bristle, values: Values, torque: float, way: Way) -> Point:
    """Return the state one Runge-Kutta step on, under ``torque`` [N.m]."""
    _, step, begin, middle, end, left = way
    off = x[LAGGED] - torque
    k1 = rates(with_torque(x, torque + off * begin), signs, values, torque)
    k2 = rates(with_torque(along(x, k1, 0.5 * step), torque + off * middle), signs, values, torque)
    k3 = rates(with_torque(along(x, k2, 0.5 * step), torque + off * middle), signs, values, torque)
    k4 = rates(with_torque(along(x, k3, step), torque + off * end), signs, values, torque)
    new = along(along(along(along(x, k1, step / 6.0), k2, step / 3.0), k3, step / 3.0), k4, step / 6.0)
    return with_torque(new, torque + off * left)


def run_coarsely(
    start: Reals, p: Reals, early: Reals, late: Reals, first: float, h: float, few: int, many: int, out: Pairs
) -> None:
    """Fill ``out``, the angles of a free run. No event is located.

    In each sample the torque ``early`` acts for ``first`` [s], then ``late`` (a dead time is no multiple of ``h``).

    Args:
        start: (8,) states.
        early: (n,) [N.m].
        late: (n,) [N.m].
        first: [s].
        few: Runge-Kutta steps of a sample.
        many: of one in which friction may turn round, or teeth or end stops meet.
        out: (n, 2) filled [rad].
    """
    x = (start[0], start[1], start[2], start[3], start[4], start[5], start[6], start[7])
    values = values_of(p)
    rest, varies = rest_levels(values)
    reach = reaches(values)
    lag = lag_of(values)
    meeting = has_flanks(values)
    usual = (step_of(first, few, h, lag), step_of(h - first, few, h, lag))
    turning = (step_of(first, many, h, lag), step_of(h - first, many, h, lag))
    rubs = rest[0] > 0.0 or rest[1] > 0.0
    bristle_m, bristle_l, sign_m, sign_l = 0.0, 0.0, 0.0, 0.0
    for n in range(len(late)):
        out[n, 0], out[n, 1] = x[0], x[2]
        short = False
        if rubs or meeting:
            rate = rates(x, (sign_m, sign_l), values, late[n])
            near_m, near_l = reach[0], reach[1]
            if varies[0] or varies[1]:  # no other level is above that at rest
                level = friction(x, values)
                near_m, near_l = grown(near_m, level[0], rest[0]), grown(near_l, level[1], rest[1])
            short = rest[0] > 0.0 and near_rest(x[1], rate[1], near_m, h)
            short = short or (rest[1] > 0.0 and near_rest(x[3], rate[3], near_l, h))
            short = short or (meeting and meets(x, rate, values, h))
        for piece in range(2):
            torque = early[n] if piece == 0 else late[n]
            way = turning[piece] if short else usual[piece]
            for _ in range(way[0]):
                if rubs:
                    level = friction(x, values)
                    bristle_m, sign_m = turn_bristle(bristle_m, x[1], level[0], rest[0], varies[0], reach[0], way[1])
                    bristle_l, sign_l = turn_bristle(bristle_l, x[3], level[1], rest[1], varies[1], reach[1], way[1])
                x = advance(x, (sign_m, sign_l), values, torque, way)


def rate_at(x: Reals, p: Reals, u: float, out: Reals) -> None:
    """Fill the rates ``out`` (8,) of the states ``x`` (8,) without dry friction, where ``u`` [N.m] is asked for."""
    r = rates((x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7]), (0.0, 0.0), values_of(p), u)
    for n in range(8):
        out[n] = r[n]


# Along a measured motion: angles and speeds of the bodies are those that were measured; states that no encoder shows
# (the angle of an added inertia, the memory of a shaft) are integrated beside them by classical Runge-Kutta steps.


def slide_bristle(steps: Reals, width: float, out: Reals) -> None:
    """Fill the deflection of a bristle, in shares of its ``width`` [rad]: it follows the motion up to 1, then slides.

    The noise of an encoder below the width does not turn it round (Prandtl's element). ``steps``: (n,) motion from
    sample to sample [rad]; ``width``: over which friction builds up [rad]; ``out``: (n,) filled.
    """
    deflection = 0.0
    for n in range(len(steps)):
        deflection = min(1.0, max(-1.0, deflection + steps[n] / width))
        out[n] = deflection


def rate_along(now: Seen, hidden: Hidden, signs: Bristle, values: Values) -> Point:
    """Return the rates at a measured instant, without the drive's torque."""
    return rates((now[0], now[1], now[2], now[3], 0.0, hidden[0], hidden[1], hidden[2]), signs, values, 0.0)


def between(a: Seen, b: Seen, step: float) -> Seen:
    """Return angles and speeds in the middle of two samples."""
    return (
        0.5 * (a[0] + b[0]) + 0.125 * step * (a[1] - b[1]),
        0.5 * (a[1] + b[1]),
        0.5 * (a[2] + b[2]) + 0.125 * step * (a[3] - b[3]),
        0.5 * (a[3] + b[3]),
    )


def hidden_along(hidden: Hidden, rate: Point, step: float) -> Hidden:
    """Return the hidden states after a straight step."""
    return (hidden[0] + step * rate[5], hidden[1] + step * rate[6], hidden[2] + step * rate[7])


def accelerate(motion: Table, signs: Pairs, p: Reals, step: float, moves: bool, out: Pairs) -> None:
    """Fill the accelerations that the equations give along a measured motion, without the drive's torque.

    Args:
        motion: (n, 4) angle and speed of the first and the second body.
        signs: (n, 2) directions of dry friction.
        step: a sample [s].
        moves: whether hidden states move.
        out: (n, 2) filled, of the first and the second body [rad/s2].
    """
    values = values_of(p)
    hidden = (motion[0, 2], motion[0, 3], 0.0)
    for n in range(len(motion)):
        now = (motion[n, 0], motion[n, 1], motion[n, 2], motion[n, 3])
        direction = (signs[n, 0], signs[n, 1])
        k1 = rate_along(now, hidden, direction, values)
        out[n, 0], out[n, 1] = k1[1], k1[LAST_SPEED]
        if moves and n + 1 < len(motion):
            then = (motion[n + 1, 0], motion[n + 1, 1], motion[n + 1, 2], motion[n + 1, 3])
            half = between(now, then, step)
            k2 = rate_along(half, hidden_along(hidden, k1, 0.5 * step), direction, values)
            k3 = rate_along(half, hidden_along(hidden, k2, 0.5 * step), direction, values)
            k4 = rate_along(then, hidden_along(hidden, k3, step), direction, values)
            hidden = (
                hidden[0] + step / 6.0 * (k1[5] + 2.0 * k2[5] + 2.0 * k3[5] + k4[5]),
                hidden[1] + step / 6.0 * (k1[6] + 2.0 * k2[6] + 2.0 * k3[6] + k4[6]),
                hidden[2] + step / 6.0 * (k1[7] + 2.0 * k2[7] + 2.0 * k3[7] + k4[7]),
            )


def rate_beside(angle: float, speed: float, y: Unseen, signs: Bristle, values: Values) -> Point:
    """Return the rates where the motor's angle and speed are measured, without the drive's torque."""
    return rates((angle, speed, y[0], y[1], 0.0, y[2], y[3], y[4]), signs, values, 0.0)


def unseen_along(y: Unseen, rate: Point, h: float) -> Unseen:
    """Return the states beside the motor's after a straight step."""
    return (y[0] + h * rate[2], y[1] + h * rate[3], y[2] + h * rate[5], y[3] + h * rate[6], y[4] + h * rate[7])


def accelerate_with_hidden_load(
    motor: Pairs, width: float, p: Reals, step: float, substeps: int, bristle: Reals, motion: Pairs, signs: Reals,
    out: Reals,
) -> None:  # fmt: skip
    """Fill the motor's acceleration where the load is not measured.

    The second body, its dry friction and the other hidden states are integrated along the motor's measured motion,
    from rest without twist.

    Args:
        motor: (n, 2) measured angle and speed.
        width: over which the load's friction builds up [rad].
        step: a sample [s].
        substeps: Runge-Kutta steps in a sample.
        bristle: (n,) direction of the motor's dry friction.
        motion: (n, 2) filled: the load's angle and speed.
        signs: (n,) filled: direction of the load's dry friction.
        out: (n,) filled [rad/s2].
    """
    values = values_of(p)
    _, _, ratio = bodies_of(values)
    at_load = motor[0, 0] / ratio
    y = (at_load, 0.0, at_load, 0.0, 0.0)
    h = step / substeps
    sign = 0.0
    for n in range(len(motor)):
        motion[n, 0], motion[n, 1], signs[n] = y[0], y[1], sign
        out[n] = rate_beside(motor[n, 0], motor[n, 1], y, (bristle[n], sign), values)[1]
        if n + 1 == len(motor):
            break
        bend = 0.5 * step * (motor[n + 1, 1] - motor[n, 1])
        turn = motor[n + 1, 0] - motor[n, 0]
        gain = motor[n + 1, 1] - motor[n, 1]
        for part in range(substeps):
            begin = y[0]
            at = (part / substeps, (part + 0.5) / substeps, (part + 1.0) / substeps)
            angles = (
                motor[n, 0] + at[0] * turn - at[0] * (1.0 - at[0]) * bend,
                motor[n, 0] + at[1] * turn - at[1] * (1.0 - at[1]) * bend,
                motor[n, 0] + at[2] * turn - at[2] * (1.0 - at[2]) * bend,
            )
            speeds = (motor[n, 1] + at[0] * gain, motor[n, 1] + at[1] * gain, motor[n, 1] + at[2] * gain)
            direction = (bristle[n], sign)
            k1 = rate_beside(angles[0], speeds[0], y, direction, values)
            k2 = rate_beside(angles[1], speeds[1], unseen_along(y, k1, 0.5 * h), direction, values)
            k3 = rate_beside(angles[1], speeds[1], unseen_along(y, k2, 0.5 * h), direction, values)
            k4 = rate_beside(angles[2], speeds[2], unseen_along(y, k3, h), direction, values)
            y = unseen_along(unseen_along(y, k1, h / 6.0), k2, h / 3.0)
            y = unseen_along(unseen_along(y, k3, h / 3.0), k4, h / 6.0)
            sign = min(1.0, max(-1.0, sign + (y[0] - begin) / width))
