"""The compensator: it crosses the gap in little time, lands softly, and holds on the flank that the load needs.

**Which flank.** In the gap the load moves by itself. So the wanted flank follows from where the load, left alone for
as long as a crossing takes and half as long again, would be beside the reference: ahead of it, it must be braked;
behind, driven. The load torque that acts anyway is part of that motion: it needs no crossing, and an elastic
reference trajectory brakes with it as far as it can. The sign of the LQR's torque is a worse guide: it brakes
long before the end of a move, against friction that would have stopped the load, and so crosses to and fro at rest.
Within ``DEAD_BAND`` of a reference that stands nothing is changed.

**The crossing** is planned (:mod:`gap_traversal`) and followed by a feedback of way, speed and torque. It ends where
the smallest half-gap that the estimate allows would end; behind that the way goes on at the speed of impact until
the teeth touch, so that a wider gap is crossed too. While it still speeds up it may turn back.

**On the flank** the LQR works on the motor's angle less the half-gap (a switched linear controller: Nordin and
Gutman, Automatica 38(10), 2002), about the motion that the reference asks for: with the twist that accelerates the
load, and the torque for it and for the motor, ahead of the drive's lag (inversion of a flat system: Fliess, Levine,
Martin and Rouchon, International Journal of Control 61(6), 1995). It never pulls: where the teeth part and it asks
for a torque away from the flank, the flank is approached anew.

Without a half-gap that is known, the request is that of the plain LQR. So it is where a flank bars the way in front of
the interval of the half-gap, until the estimate agrees with that or the teeth part again.
"""

from math import exp, fabs, log, sqrt
from typing import NamedTuple

from .gap_traversal import Traversal, go_on, plan, point_at, request_at
from .lqr import Estimate, Gains, control
from .state_prediction import Train

HOLD, CROSS, PLAIN = 0, 1, 2
ANY_TORQUE = 1e300  # limit of a request that is not to be limited [N.m]
DEVIATIONS = 2.0  # of the half-gap, by which its interval reaches down and up
LEAST_SHARE = 0.5  # of the half-gap, that the lower end of its interval must reach for a plan
SMOOTHING = 0.02  # time constant [s] of the lead, which has the noise of the estimated speed
AIM = 0.95  # share of the impact speed for which a plan is made: landings scatter by a tenth
SOFTEST = 0.2  # share of the impact speed with which a flank is met at rest: the impact itself moves the load
HORIZON = 1.5  # of a crossing, over which the load is foreseen: it is to be braked behind the landing, too
DEAD_BAND = 2.0  # margins, within which the load is where it should be
REFERENCE_LAG = 0.25  # of a crossing: time constant of the reference's acceleration; steps of its speed last so long
PER_CROSSING = 5.0  # poles of the feedback times the duration of a crossing
OWN_POLE = 0.4  # share of the drive's own pole that the feedback leaves to its torque at least
PER_SAMPLE = 0.085  # largest poles of the feedback times the sample time
BARRED = 0.75  # of the half-gap, by which a way that stands still is behind its line: a flank is where none is known
TURNING = 2  # samples before the end of a plan's first part, from which it is too late to turn back


class Tuning(NamedTuple):
    """What the compensator is told: impact speed [rad/s], share of the torque limit for plans, torque limit [N.m],
    way [rad] before the flank at which a plan ends (noise of the encoders), sample time [s].
    """

    impact_speed: float
    torque_share: float
    u_max: float
    margin: float
    sample_time: float


class Gap(NamedTuple):
    """The gap as it is estimated: half-gap and its standard deviation [rad]."""

    alpha: float
    deviation: float


class WantedMotion(NamedTuple):
    """What the load shall do: angle [rad], speed, acceleration and jerk."""

    angle: float
    speed: float
    acceleration: float
    jerk: float


class CrossingState(NamedTuple):
    """Phase, wanted flank, samples since the plan began, smoothed lead of the load over the reference [rad], speed of
    the reference behind one lag and behind two [rad/s], plan, way from mid-gap at which a flank barred it [rad] or 0.
    """

    phase: int
    flank: int
    samples: int
    lead: float
    speed_once: float
    speed_twice: float
    traversal: Traversal
    barred: float


def start_state(x: Estimate, reference_speed: float, i: float) -> CrossingState:
    """Return the state at the first sample: hold on the side on which the twist is."""
    flank = 1 if x[0] / i >= x[2] else -1
    none = Traversal(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return CrossingState(HOLD, flank, 0, 0.0, reference_speed, reference_speed, none, 0.0)


def derive_reference(angle: float, speed: float, once: float, twice: float, lag: float) -> WantedMotion:
    """Return the reference with acceleration and jerk from its speed behind one ``lag`` [s] and behind two.

    Both are late by two lags; for the acceleration the jerk makes up for that.
    """
    jerk = (speed - 2.0 * once + twice) / (lag * lag)
    return WantedMotion(angle, speed, (once - twice) / lag + 2.0 * lag * jerk, jerk)


def lead_after(time: float, r: WantedMotion, x: Estimate, d: Train) -> float:
    """Return how far [rad] the load, left alone, is ahead of the reference after ``time`` [s]."""
    slowing = (d.b_l * x[3] + x[4]) / d.J_l
    alone = x[2] + time * (x[3] - 0.5 * time * slowing)
    return alone - r.angle - time * (r.speed + time * (0.5 * r.acceleration + time * r.jerk / 6.0))


def crossing_time(alpha: float, d: Train, s: Tuning) -> float:
    """Return about how long [s] a crossing from rest takes, without the creep behind its plan.

    A quick drive takes ``2 sqrt(2 alpha M/U)``, one whose lag is all takes ``(64 alpha tau M/U)^(1/3)``; the cube of
    the time is taken to be the sum of both cubes.
    """
    level = s.u_max * s.torque_share if s.torque_share > 0.0 else s.u_max
    square = 8.0 * alpha * d.J_m * d.i / level
    return exp(log(square * (8.0 * d.tau + sqrt(square))) / 3.0)


def hold(r: WantedMotion, x: Estimate, gains: Gains, d: Train, s: Tuning) -> float:
    """Return the request [N.m] of the LQR about the motion that the reference asks for.

    What the load needs to move so stands beside its load torque; what the motor needs is taken off its torque.
    """
    load = x[4] + d.J_l * r.acceleration + d.b_l * r.speed
    motor = d.i * (d.J_m * r.acceleration + d.b_m * r.speed)
    change = d.i * (d.J_m * r.jerk + d.b_m * r.acceleration) + (d.J_l * r.jerk + d.b_l * r.acceleration) / d.i
    about = (x[0], x[1], x[2], x[3], load, x[5] - motor)
    u = control(r.angle, r.speed, about, gains, d.i, d.compliance, ANY_TORQUE) + motor + d.tau * change
    return max(-s.u_max, min(s.u_max, u))


def impact_speed(reference: float, reference_speed: float, x: Estimate, alpha: float, s: Tuning) -> float:
    """Return the speed [rad/s] at which to land: less where little is to move, as the impact moves the load."""
    need = abs(x[2] - reference) / alpha + abs(reference_speed) / s.impact_speed
    return AIM * s.impact_speed * max(SOFTEST, min(1.0, need))


def follow(state: CrossingState, duration: float, end: float, x: Estimate, d: Train, s: Tuning) -> float:
    """Return the request [N.m] along the plan of a crossing; from the way ``end`` [rad] on the teeth may touch.

    The gains give the error of the chain of way, speed and torque the poles of ``(s + r) (s^2 + 1.4 p s + p^2)``, where
    ``r`` is ``p``, but not much slower than a quick drive is by itself. What else accelerates the twist, friction and
    load, is a torque that the request cancels.
    """
    t = state.traversal
    side = float(state.flank)
    M = d.J_m * d.i
    extra = side * (M * (d.b_l * x[3] + x[4]) / d.J_l - d.b_m * x[1])
    time = state.samples * s.sample_time
    aim = point_at(t, time, d.tau, M)
    p = min(PER_SAMPLE / s.sample_time, PER_CROSSING / duration)
    u = request_at(t, time, time + s.sample_time) - extra
    behind = aim[0] - side * (x[0] / d.i - x[2])
    if t.third == 0.0 and side * (x[0] / d.i - x[2]) > end:
        behind = min(behind, s.margin)  # the teeth may touch: no push for the way that they bar
    r = max(p, OWN_POLE / d.tau)
    u += d.tau * M * p * (r * p * behind + (1.4 * r + p) * (aim[1] - side * (x[1] / d.i - x[3])))
    u += ((r + 1.4 * p) * d.tau - 1.0) * (aim[2] - side * x[5] - extra)
    return side * max(-s.u_max, min(s.u_max, u))


def plan_crossing(flank: int, x: Estimate, end: float, speed: float, d: Train, s: Tuning) -> Traversal:
    """Return the traversal from the present state to the way ``end`` [rad] towards a flank, at ``speed`` [rad/s]."""
    side = float(flank)
    M = d.J_m * d.i
    torque = side * (x[5] + M * (d.b_l * x[3] + x[4]) / d.J_l - d.b_m * x[1])
    start = (side * (x[0] / d.i - x[2]), side * (x[1] / d.i - x[3]), torque)
    return plan(start, end, speed, s.torque_share * s.u_max, d.tau, M)


def act(
    state: CrossingState,
    reference: float,
    reference_speed: float,
    x: Estimate,
    gap: Gap,
    gains: Gains,
    d: Train,
    s: Tuning,
) -> tuple[CrossingState, float]:
    """Return the state and the request [N.m] of this sample.

    ``reference``: wanted load angle [rad]; ``reference_speed``: [rad/s]; ``x``: estimate ``(theta_m, omega_m, theta_l,
    omega_l, T_l, T_m)``, whose twist is zero in mid-gap.
    """
    phase, flank, samples, lead, once, twice, traversal, barred = state
    lowest = gap.alpha - DEVIATIONS * max(gap.deviation, 0.0)
    end = lowest - s.margin
    way = flank * (x[0] / d.i - x[2])
    line = point_at(traversal, samples * s.sample_time, d.tau, d.J_m * d.i)[0]
    behind = phase == CROSS and samples > 0 and way > 0.0 and line - way > BARRED * gap.alpha
    stopped = behind and flank * (x[1] / d.i - x[3]) < 0.5 * s.impact_speed
    barred = way if stopped else barred
    barred = barred if barred < end and way > 0.0 else 0.0
    if gap.alpha <= 0.0 or lowest <= LEAST_SHARE * gap.alpha or barred > 0.0:
        plain = control(reference, reference_speed, x, gains, d.i, d.compliance, s.u_max)
        return (CrossingState(PLAIN, flank, 0, 0.0, reference_speed, reference_speed, traversal, barred), plain)
    phase = HOLD if phase == PLAIN else phase
    crossing = crossing_time(gap.alpha, d, s)
    lag = REFERENCE_LAG * crossing
    share = s.sample_time / (s.sample_time + lag)
    once += share * (reference_speed - once)
    twice += share * (once - twice)
    speed = impact_speed(reference, reference_speed, x, gap.alpha, s)
    duration = crossing + (gap.alpha - end) / s.impact_speed
    r = derive_reference(reference, reference_speed, once, twice, lag)
    ahead = lead_after(HORIZON * duration + SMOOTHING, r, x, d)
    lead += (ahead - lead) * s.sample_time / (s.sample_time + SMOOTHING)
    band = DEAD_BAND * s.margin
    there = fabs(reference_speed) * crossing <= s.margin and fabs(x[2] - reference) <= band
    in_time = phase == HOLD or (samples + TURNING) * s.sample_time <= traversal.first
    if in_time and not there and lead * flank > band:
        phase, flank, samples = CROSS, -flank, 0
    shifted = (x[0] - flank * d.i * gap.alpha, x[1], x[2], x[3], x[4], x[5])
    held = hold(r, shifted, gains, d, s)
    way = flank * (x[0] / d.i - x[2])
    time = samples * s.sample_time
    unsure = (DEVIATIONS * max(gap.deviation, 0.0) + s.margin) * traversal.end_speed / s.impact_speed
    sure = phase == HOLD or (samples > 0 and line >= gap.alpha + unsure)
    touching = (way > gap.alpha and sure) or stopped
    if touching or s.torque_share == 0.0 or (phase == HOLD and way > 0.0 and held * flank >= 0.0):
        return (CrossingState(HOLD, flank, 0, lead, once, twice, traversal, 0.0), held)
    if phase == HOLD or samples == 0 or way < -gap.alpha - s.margin:
        # Still on the other flank: the way begins where that is left.
        samples = 0
        traversal = plan_crossing(flank, x, end, speed, d, s)
    elif time >= traversal.first + traversal.second + traversal.third:
        # Too quick for a plan that has not ended yet: no line shall pull it back.
        samples = 0
        ahead_of_line = way > line + s.margin
        traversal = plan_crossing(flank, x, end, speed, d, s) if ahead_of_line else go_on(line, speed, traversal.level)
    state = CrossingState(CROSS, flank, samples, lead, once, twice, traversal, 0.0)
    u = follow(state, duration, end, x, d, s)
    return (CrossingState(CROSS, flank, samples + 1, lead, once, twice, traversal, 0.0), u)
