"""The state at the instant from which a request acts, foreseen over the requests that are under way.

A request that acts late meets another state than the one that was estimated. Fed back from the state that is foreseen
for that instant, a loop has the poles that it has without dead time (finite spectrum assignment: Manitius and Olbrot,
IEEE Trans. Automatic Control 24(4), 1979). Drives have dead time, and so have masters that step FMUs side by side.

The shaft's torque is implicit in the twist at the end of a part, so that a shaft of any stiffness, a rigid one too,
stops the teeth without chatter (Stewart and Trinkle, Int. J. Numerical Methods in Engineering 39(15), 1996).

``sent`` holds the requests [N.m] that are under way, the oldest first. A ``delay`` counts samples; parts of one count.
"""

from math import exp
from typing import Annotated, NamedTuple

from .lqr import Estimate

MOST_LATE = 64.0  # samples
Sent = Annotated[list[float], 66]
ROUNDING = 1e-9  # of a sample
LONGEST_PART = 2.5e-4  # of a foreseen motion [s]
MOST_PARTS = 40  # of a sample


class Train(NamedTuple):
    """The drivetrain as the compensator knows it, in SI units."""

    J_m: float
    J_l: float
    b_m: float
    b_l: float
    i: float
    compliance: float
    tau: float


def n_under_way(delay: float) -> int:
    """Return how many requests are under way at a sample instant for a ``delay`` of so many samples."""
    return int(delay + 1.0 - ROUNDING)


def oldest_share(delay: float) -> float:
    """Return for which share of a sample the oldest request that is under way acts from a sample instant on."""
    return delay - (n_under_way(delay) - 1)


def foresee(x: Estimate, u: float, duration: float, alpha: float, d: Train) -> Estimate:
    """Return the state after ``duration`` [s] with the request ``u`` [N.m] acting.

    ``x``: state ``(theta_m, omega_m, theta_l, omega_l, T_l, T_m)``, whose twist is zero in mid-gap; ``alpha``: half-gap
    [rad].
    """
    theta_m, omega_m, theta_l, omega_l, T_l, T_m = x
    parts = min(1 + int(duration / LONGEST_PART), MOST_PARTS)
    h = duration / parts
    fade = exp(-h / d.tau)
    ease = 1.0 / (d.J_m * d.i * d.i) + 1.0 / d.J_l
    for _ in range(parts):
        before = T_m
        T_m = u + (T_m - u) * fade
        free_m = omega_m + h * (0.5 * (before + T_m) - d.b_m * omega_m) / d.J_m
        free_l = omega_l - h * (d.b_l * omega_l + T_l) / d.J_l
        way = theta_m / d.i - theta_l + h * (free_m / d.i - free_l)
        wound = way - max(-alpha, min(alpha, way))
        pulse = h * wound / (d.compliance + h * h * ease)
        if wound == 0.0:
            # Nothing touches: what the motion has gained in the part acts for half of it.
            theta_m -= 0.5 * h * (free_m - omega_m)
            theta_l -= 0.5 * h * (free_l - omega_l)
        omega_m = free_m - pulse / (d.J_m * d.i)
        omega_l = free_l + pulse / d.J_l
        theta_m += h * omega_m
        theta_l += h * omega_l
    return (theta_m, omega_m, theta_l, omega_l, T_l, T_m)


def foresee_late(x: Estimate, sent: Sent, delay: float, sample_time: float, alpha: float, d: Train) -> Estimate:
    """Return the state ``delay`` samples of ``sample_time`` [s] later; what is under way acts until then."""
    share = oldest_share(delay)
    for n in range(len(sent)):
        x = foresee(x, sent[n], share * sample_time, alpha, d)
        share = 1.0
    return x
