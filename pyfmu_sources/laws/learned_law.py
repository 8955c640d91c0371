"""A law learned from a record: a torque along straight lines between knots over one signal of a plant.

The predictor of a diagnosis compiles :func:`straight`; an FMU holds a law as the flat tuple that ``L_*`` number.

In all functions: ``clock``: time of the record that it was learned from [s].
"""

from math import sqrt
from typing import Annotated

KNOTS = 11

# What a law follows, and what is added for one that also grows with the load's speed, or begins at some time.
MOTOR_SPEED, LOAD_SPEED, LOAD_ANGLE, TWIST, DRIVE, CYCLE_M, CYCLE_L = range(1, 8)
WITH_SPEED, LATER = 10, 20

L_FORM, L_CLOCK, L_SINCE, L_PERIOD, L_DRY, L_KNOTS = range(6)
L_VALUES = L_KNOTS + KNOTS
LAW_COUNT = L_VALUES + KNOTS

# Motion of a plant as a law sees it: speeds of motor and load, angle of the load, twist, torque of the drive.
Motion = tuple[float, float, float, float, float]
Law = Annotated[tuple[float, ...], LAW_COUNT]

# A law is held over pieces of a step: at most so long [s], and so large a share of the shortest time constant it makes.
LONGEST_PIECE = 1e-3
SHARE = 0.2
CLOSE = 1e-9  # of a period, within which a cyclic law is at its knot


def straight(s: float, p: Law, knot_at: int, value_at: int) -> float:
    """Return a law's value: straight lines between its knots, the last ones go on."""
    n = 1
    while n < KNOTS - 1 and s > p[knot_at + n]:
        n += 1
    share = (s - p[knot_at + n - 1]) / (p[knot_at + n] - p[knot_at + n - 1])
    return p[value_at + n - 1] + share * (p[value_at + n] - p[value_at + n - 1])


def kind_of(law: Law) -> int:
    """Return what a law follows, 1 to 7."""
    return int(law[L_FORM]) % WITH_SPEED


def begins_late(law: Law) -> bool:
    """Tell whether a law acts from some time on only."""
    return law[L_FORM] >= LATER


def is_cyclic(law: Law) -> bool:
    """Tell whether a law comes by a clock alone, once a cycle."""
    return kind_of(law) in (CYCLE_M, CYCLE_L)


def until_knot(law: Law, clock: float) -> float:
    """Return how long a cyclic law runs straight on [s]."""
    period = law[L_PERIOD]
    close = CLOSE * period
    s = (clock - law[L_SINCE]) % period
    if period - s <= close:
        s -= period
    for n in range(KNOTS):
        ahead = law[L_KNOTS + n] - s
        if ahead > close:
            return min(ahead, period - s)
    return period - s


def law_torque(law: Law, clock: float, motion: Motion) -> float:
    """Return the torque [N.m] of a law that acts, without its dry friction: against a body, or with the elastic one."""
    kind = kind_of(law)
    s = motion[kind - 1] if kind <= DRIVE else (clock - law[L_SINCE]) % law[L_PERIOD]
    torque = straight(s, law, L_KNOTS, L_VALUES)
    if WITH_SPEED <= law[L_FORM] < LATER:
        torque *= abs(motion[1])
    return torque


def at_bodies(law: Law, torque: float, ratio: float) -> tuple[float, float]:
    """Return a law's ``torque`` [N.m] where it acts: against the motor and against the load."""
    kind = kind_of(law)
    if kind == TWIST:
        return (torque / ratio, -torque)
    if kind in (MOTOR_SPEED, DRIVE, CYCLE_M):
        return (torque, 0.0)
    return (0.0, torque)


def longest_piece(law: Law, motor: float, load: float, ratio: float) -> float:
    """Return over how long a law may be held [s]: a share of the shortest time constant that it makes.

    ``motor`` and ``load`` are inertias [kg.m2].
    """
    kind = kind_of(law)
    steepest = largest = 0.0
    for n in range(KNOTS):
        value = abs(law[L_VALUES + n])
        largest = max(largest, value)
        if n > 0:
            rise = law[L_VALUES + n] - law[L_VALUES + n - 1]
            steepest = max(steepest, abs(rise / (law[L_KNOTS + n] - law[L_KNOTS + n - 1])))
    rate = 0.0
    if kind == MOTOR_SPEED:
        rate = steepest / motor
    elif kind == LOAD_SPEED:
        rate = steepest / load
    elif kind == LOAD_ANGLE:
        rate = sqrt(steepest / load)
    elif kind == TWIST:
        rate = sqrt(steepest * (1.0 / (motor * ratio * ratio) + 1.0 / load))
    if WITH_SPEED <= law[L_FORM] < LATER:
        rate = max(rate, largest / load, largest / (motor * abs(ratio)))
    return min(LONGEST_PIECE, SHARE / rate) if rate > 0.0 else LONGEST_PIECE
