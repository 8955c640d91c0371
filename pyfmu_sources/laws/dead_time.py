"""Dead time of a requested torque: the requests that are still under way.

A request is ``(time [s], torque [N.m])``; the list of them is ordered, the oldest first, and its first may act already.

In all functions: ``u``: requested torque [N.m].
"""

from typing import Annotated

MOST_REQUESTS = 16384
Request = tuple[float, float]
Requests = Annotated[list[Request], MOST_REQUESTS]
ROUNDING = 1e-9  # of a step: how far time stamps may be off


def is_new(requests: Requests, u: float) -> int:
    """Return 1 if the torque ``u`` [N.m] is another one than was requested last, else 0."""
    if len(requests) == 0:
        return 1
    return 1 if requests[-1][1] != u else 0


def request_at(requests: Requests, n: int, u: float, time: float) -> Request:
    """Return request ``n`` (from 0); the one behind the last is what is requested now, ``u`` at ``time`` [s]."""
    if n < len(requests):
        return requests[n]
    return (time, u)
