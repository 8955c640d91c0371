"""The compensator: it crosses the gap in little time, lands softly, and holds on the flank that the load needs.

What the load needs is the torque of the LQR for a motor that follows the load rigidly; its sign is the wanted
flank. While the teeth touch there, the LQR works on the motor's angle less the half-gap (a switched linear
controller: Nordin and Gutman, Automatica 38(10), 2002). When the wanted flank changes, a traversal is planned
(:mod:`gap_traversal`) and followed by a feedback of way, speed and torque. It ends where the smallest half-gap
that the estimate allows would end; behind that the way goes on at the speed of impact until the teeth touch, so
that a wider gap is crossed too.

A crossing takes time, in which the load moves by itself. So the flank changes only if the LQR will still want
it at the landing. And while it holds, the compensator never pulls: where the teeth part and the LQR asks for a
torque away from the flank, the flank is approached anew. Both keep the loop from crossing to and fro at rest.

Without a half-gap that is known, the request is that of the plain LQR.
"""

from math import fabs
from typing import NamedTuple

from .gap_traversal import Traversal, plan, point_at, request_at
from .lqr import Estimate, Gains, control

HOLD, CROSS = 0, 1
ANY_TORQUE = 1e300  # limit of a request that is not to be limited [N.m]
DEVIATIONS = 2.0  # of the half-gap, by which its interval reaches down and up
LEAST_SHARE = 0.5  # of the half-gap, that the lower end of its interval must reach for a plan
SMOOTHING = 0.02  # time constant [s] of the part of the wanted torque that has the noise of estimated speeds
SOFTEST = 0.2  # share of the impact speed with which a flank is met at rest: the impact itself moves the load
PER_CROSSING = 5.0  # poles of the feedback times the duration of a plan
PER_SAMPLE = 0.07  # largest poles of the feedback times the sample time


class Tuning(NamedTuple):
    """What the compensator is told: impact speed [rad/s], share of the torque limit for plans, torque limit [N.m],
    wanted torque [N.m] against the flank from which it may change, way [rad] before the flank at which a plan ends
    (noise of the encoders), sample time [s].
    """

    impact_speed: float
    torque_share: float
    u_max: float
    flank_torque: float
    margin: float
    sample_time: float


class Train(NamedTuple):
    """The drivetrain as the compensator knows it, in SI units."""

    J_m: float
    J_l: float
    b_m: float
    b_l: float
    i: float
    compliance: float
    tau: float


class Gap(NamedTuple):
    """The gap as it is estimated: half-gap and its standard deviation [rad]."""

    alpha: float
    deviation: float


class CrossingState(NamedTuple):
    """Phase, wanted flank, samples since the plan began, smoothed part of the wanted torque [N.m], plan."""

    phase: int
    flank: int
    samples: int
    smoothed: float
    traversal: Traversal


def start_state(x: Estimate, i: float) -> CrossingState:
    """Return the state at the first sample: hold on the side on which the twist is."""
    flank = 1 if x[0] / i >= x[2] else -1
    return CrossingState(HOLD, flank, 0, 0.0, Traversal(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))


def rigid_torque(reference: float, reference_speed: float, x: Estimate, gains: Gains, d: Train) -> tuple[float, float]:
    """Return the torque [N.m] that the LQR asks of a motor that follows the load rigidly, and the part of the angles.

    The other part, of speed and load torque, has their noise.
    """
    theta_l, omega_l, T_l = x[2], x[3], x[4]
    rigid = (d.i * (theta_l + T_l * d.compliance), d.i * omega_l, theta_l, omega_l, T_l, T_l / d.i)
    whole = control(reference, reference_speed, rigid, gains, d.i, d.compliance, ANY_TORQUE)
    return (whole, (gains[0] * d.i + gains[2]) * (reference - theta_l))


def after_crossing(x: Estimate, duration: float, d: Train) -> Estimate:
    """Return the estimate with the load as it is after ``duration`` [s] on its own."""
    slowing = (d.b_l * x[3] + x[4]) / d.J_l
    theta_l = x[2] + duration * x[3] - 0.5 * duration * duration * slowing
    return (x[0], x[1], theta_l, x[3] - duration * slowing, x[4], x[5])


def crossing_time(alpha: float, end: float, speed: float, d: Train, s: Tuning) -> float:
    """Return how long [s] a crossing from rest to the way ``end`` [rad] and on to the flank takes; 0 without plans."""
    if s.torque_share == 0.0:
        return 0.0
    ahead = plan((-alpha, 0.0, 0.0), end, speed, s.torque_share * s.u_max, d.tau, d.J_m * d.i)
    return ahead.first + ahead.second + ahead.third + (alpha - end) / speed


def impact_speed(reference: float, reference_speed: float, x: Estimate, alpha: float, s: Tuning) -> float:
    """Return the speed [rad/s] at which to land: less where little is to move, as the impact moves the load."""
    need = abs(x[2] - reference) / alpha + abs(reference_speed) / s.impact_speed
    return s.impact_speed * max(SOFTEST, min(1.0, need))


def follow(state: CrossingState, x: Estimate, d: Train, s: Tuning) -> float:
    """Return the request [N.m] along the plan of a crossing.

    With ``e`` the error of the way the gains make ``e''' + 2.4 p e'' + 2.4 p^2 e' + p^3 e = 0`` of the chain of way,
    speed and torque. What else accelerates the twist, friction and load, is a torque that the request cancels.
    """
    t = state.traversal
    side = float(state.flank)
    M = d.J_m * d.i
    extra = side * (M * (d.b_l * x[3] + x[4]) / d.J_l - d.b_m * x[1])
    time = state.samples * s.sample_time
    aim = point_at(t, time, d.tau, M)
    duration = t.first + t.second + t.third
    p = PER_SAMPLE / s.sample_time
    if duration * p > PER_CROSSING:
        p = PER_CROSSING / duration
    u = request_at(t, time, time + s.sample_time) - extra
    u += d.tau * M * p * p * (p * (aim[0] - side * (x[0] / d.i - x[2])) + 2.4 * (aim[1] - side * (x[1] / d.i - x[3])))
    u += (2.4 * p * d.tau - 1.0) * (aim[2] - side * x[5] - extra)
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

    Args:
        reference: wanted load angle [rad].
        reference_speed: [rad/s].
        x: estimate ``(theta_m, omega_m, theta_l, omega_l, T_l, T_m)``, whose twist is zero in mid-gap.
    """
    phase, flank, samples, smoothed, traversal = state
    whole, of_angles = rigid_torque(reference, reference_speed, x, gains, d)
    smoothed += (whole - of_angles - smoothed) * s.sample_time / (s.sample_time + SMOOTHING)
    wanted = of_angles + smoothed
    lowest = gap.alpha - DEVIATIONS * gap.deviation
    if lowest <= LEAST_SHARE * gap.alpha:
        plain = control(reference, reference_speed, x, gains, d.i, d.compliance, s.u_max)
        return (CrossingState(HOLD, flank, 0, smoothed, traversal), plain)
    end = lowest - s.margin
    speed = impact_speed(reference, reference_speed, x, gap.alpha, s)
    settled = reference_speed == 0.0 and fabs(x[2] - reference) <= s.margin
    if phase == HOLD and not settled and wanted * flank < -s.flank_torque:
        h = crossing_time(gap.alpha, end, speed, d, s)
        coming, _ = rigid_torque(reference + h * reference_speed, reference_speed, after_crossing(x, h, d), gains, d)
        if coming * flank < -s.flank_torque:
            phase, flank, samples = CROSS, -flank, 0
    shifted = (x[0] - flank * d.i * gap.alpha, x[1], x[2], x[3], x[4], x[5])
    held = control(reference, reference_speed, shifted, gains, d.i, d.compliance, s.u_max)
    way = flank * (x[0] / d.i - x[2])
    if way > gap.alpha or s.torque_share == 0.0:
        return (CrossingState(HOLD, flank, 0, smoothed, traversal), held)
    if phase == HOLD:
        if held * flank >= 0.0:
            return (CrossingState(HOLD, flank, 0, smoothed, traversal), held)
        samples = 0
    if samples == 0 or way < -gap.alpha - s.margin:
        # Still on the other flank: the way begins where that is left.
        samples = 0
        traversal = plan_crossing(flank, x, end, speed, d, s)
    u = follow(CrossingState(CROSS, flank, samples, smoothed, traversal), x, d, s)
    return (CrossingState(CROSS, flank, samples + 1, smoothed, traversal), u)
