"""What ``compensate.json`` holds: the same plants under each law."""

import msgspec

from orchestrator.shared.results import ResultData
from orchestrator.shared.results.regulator import ForecastFound


class LawFound(msgspec.Struct, frozen=True):
    """One law on all plants: medians, 95 % quantiles in ``upper``, and every traversal.

    ``impact`` is the largest of a run [rad/s], ``error`` that of the load during the move, root mean square [rad],
    ``rest`` the motion at the end, peak to peak [counts of the load's encoder], ``contacts`` then [1/s].
    ``unstable`` plants leave the end of the move; they are in no other number. ``times`` [s] and ``impacts`` [rad/s]
    are of all traversals; ``path_times`` [s] and ``path`` [rad] of one.
    """

    law: str
    impact: float
    error: float
    rest: float
    contacts: float
    unstable: int = 0
    upper: dict[str, float] = {}
    times: tuple[float, ...] = ()
    impacts: tuple[float, ...] = ()
    path_times: tuple[float, ...] = ()
    path: tuple[float, ...] = ()


class CompensateFound(ResultData, frozen=True, kw_only=True):
    """``compensate``: half-gap [rad], impact speed asked for [rad/s], and the least time of a traversal [s].

    ``bound_speeds`` [rad/s] and ``bound_times`` [s] are that time for other speeds; ``path_times`` [s] and ``path``
    [rad] the quickest traversal. ``machine`` is the model's file, ``gains`` are the LQR's for ``weights`` of the states
    and 1 for the request. ``doubts`` say what is not as it should be; ``files`` are what was made of it.
    """

    alpha: float
    tau: float
    impact_speed: float
    bound: float
    laws: tuple[LawFound, ...]
    forecast: ForecastFound | None = None
    machine: str | None = None
    plants: int | None = None
    weights: tuple[float, ...] = ()
    gains: tuple[float, ...] = ()
    doubts: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    bound_speeds: tuple[float, ...] = ()
    bound_times: tuple[float, ...] = ()
    path_times: tuple[float, ...] = ()
    path: tuple[float, ...] = ()
