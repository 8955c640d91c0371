"""What goes in and out: a drive's limit, lag and largest rate, a constant load, the zeros of encoders.

In all functions: ``u``: what it follows [N.m]; ``request``: behind the lag, at the beginning [N.m];
``time_constant``: of the lag [s]; 0: none.
"""

from math import exp

from .parameter_rows import BIG, TINY, Parameter, mark_linear

INPUT = mark_linear(
    Parameter("effects.input_delay.delay", "s", 0.0, 0.0, 10.0, "Dead time of the requested torque"),
    Parameter("effects.torque_saturation.limit", "N.m", BIG, 0.0, BIG, "Largest torque that the drive delivers"),
)
REQUEST = (
    Parameter("effects.drive_filter.time_constant", "s", 0.0, 0.0, BIG, "Second lag of the drive (0: none)"),
    Parameter("effects.rate_limit.rate", "N.m/s", BIG, TINY, BIG, "Fastest change of the drive's torque request"),
)


def load_rows(name: str) -> tuple[Parameter, ...]:
    """Return the row of a constant torque against the body ``name``."""
    text = f"Constant torque against the {name}"
    return mark_linear(Parameter("effects.load_torque.torque", "N.m", 0.0, -BIG, BIG, text))


def encoder_rows(site: str, name: str) -> tuple[Parameter, ...]:
    """Return the row of the zero of an encoder."""
    text = f"Offset of the {name}"
    return mark_linear(Parameter(f"effects.sensor_offset.{site}.offset", "rad", 0.0, -BIG, BIG, text))


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


def ramp(request: float, u: float, time_constant: float, limit: float, h: float) -> tuple[float, float, float]:
    """Return how long [s] of ``h`` a request that follows ``u`` [N.m] changes at its ``limit`` [N.m/s], and two:
    one so far away that what follows it goes on at the limit, and the one at which that ends.
    """
    duration = min(h, ramp_time(request, u, time_constant, limit))
    reach = 2.0 * limit * (duration + max(time_constant, RAMP_END))
    if u > request:
        return (duration, request + reach, u - limit * time_constant)
    return (duration, request - reach, u + limit * time_constant)


def followed_request(request: float, u: float, time_constant: float, limit: float, h: float) -> tuple[float, float]:
    """Return a request that follows a held ``u`` [N.m] with a lag and a limited rate, after ``h`` [s], and its mean.

    ``limit``: largest rate [N.m/s].
    """
    ramp = min(h, ramp_time(request, u, time_constant, limit))
    slope = limit if u > request else -limit
    total = (request + 0.5 * slope * ramp) * ramp
    reached = request + slope * ramp
    left_over = h - ramp
    if left_over <= 0.0:
        return (reached, total / h)
    if time_constant == 0.0:
        return (u, (total + u * left_over) / h)
    left = (u - reached) * exp(-left_over / time_constant)
    return (u - left, (total + u * left_over - time_constant * (u - reached - left)) / h)
