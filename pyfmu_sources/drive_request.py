"""What a drive makes of a request: its limit, its lag and its largest rate.

In all functions: ``u``: what it follows [N.m]; ``request``: behind the lag, at the beginning [N.m];
``time_constant``: of the lag [s]; 0: none.
"""

from math import exp

UNASKED = 1e300  # N.m, of a filtered request before the first step: the drive has settled at what is asked first
RAMP_END = 1e-4  # s, of a request that is reached: any time constant, as nothing moves any more


def saturated(u: float, limit: float) -> float:
    """Return the torque that a drive with a symmetric ``limit`` delivers for the request ``u`` [N.m]."""
    if u > limit:
        return limit
    if u < -limit:
        return -limit
    return u


def request_rate(request: float, u: float, time_constant: float, limit: float) -> float:
    """Return the rate [N.m/s] of a request that follows ``u`` [N.m] with a lag, never faster than ``limit``.

    Without a lag the request must not be reached inside a step: :func:`ramp_time` tells when it is.
    """
    rate = (u - request) / max(time_constant, RAMP_END)
    return saturated(rate, limit)


def ramp_time(request: float, u: float, time_constant: float, limit: float) -> float:
    """Return how long [s] a request that follows ``u`` [N.m] still changes at its ``limit`` [N.m/s]."""
    return max(0.0, abs(u - request) / limit - time_constant)


def ramp_target(request: float, u: float, time_constant: float, limit: float, duration: float) -> float:
    """Return a request [N.m] so far away that what follows it changes at its ``limit`` for ``duration`` [s]."""
    reach = 2.0 * limit * (duration + max(time_constant, RAMP_END))
    return request + reach if u > request else request - reach


def ramp_end(request: float, u: float, time_constant: float, limit: float) -> float:
    """Return the request [N.m] at which a ramp towards ``u`` [N.m] ends."""
    return u - limit * time_constant if u > request else u + limit * time_constant


def followed_request(request: float, u: float, time_constant: float, limit: float, h: float) -> tuple[float, float]:
    """Return a request that follows a held ``u`` [N.m] with a lag and a limited rate, after ``h`` [s], and its mean.

    Args:
        request: at the beginning [N.m].
        limit: largest rate [N.m/s].
        h: duration [s].
    """
    ramp = min(h, ramp_time(request, u, time_constant, limit))
    slope = limit if u > request else -limit
    total = (request + 0.5 * slope * ramp) * ramp
    reached = request + slope * ramp
    rest = h - ramp
    if rest <= 0.0:
        return (reached, total / h)
    if time_constant == 0.0:
        return (u, (total + u * rest) / h)
    left = (u - reached) * exp(-rest / time_constant)
    return (u - left, (total + u * rest - time_constant * (u - reached - left)) / h)
