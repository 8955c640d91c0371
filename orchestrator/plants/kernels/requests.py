"""What a drive makes of the requests of a record: a kernel."""

from orchestrator.building.translation.kernel_arrays import Reals
from pyfmu_sources.laws.drive import followed_request

__all__ = ["follow"]


def follow(u: Reals, lag: float, rate: float, h: float, means: Reals, begins: Reals) -> None:
    """Fill what requests become behind a second lag and a limited rate.

    Args:
        u: (n,) requests [N.m], each held for ``h`` [s].
        lag: [s].
        rate: largest [N.m/s].
        means: (n,) filled, over each sample.
        begins: (n,) filled, at the beginning of each.
    """
    request = u[0]
    for n in range(len(u)):
        begins[n] = request
        request, means[n] = followed_request(request, u[n], lag, rate, h)
