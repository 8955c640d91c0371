"""What ``compensate.json`` holds: the same plants under each law."""

import msgspec

from orchestrator.shared.results import ResultData
from orchestrator.shared.results.regulator import ForecastFound


class LawFound(msgspec.Struct, frozen=True):
    """One law on all plants: medians, and every traversal.

    ``impact`` is the largest of a run [rad/s], ``error`` that of the load during the move, root mean square [rad],
    ``rest`` the motion at the end, peak to peak [counts of the load's encoder], ``contacts`` then [1/s].
    ``times`` [s] and ``impacts`` [rad/s] are of all traversals; ``path_times`` [s] and ``path`` [rad] of one.
    """

    law: str
    impact: float
    error: float
    rest: float
    contacts: float
    times: tuple[float, ...] = ()
    impacts: tuple[float, ...] = ()
    path_times: tuple[float, ...] = ()
    path: tuple[float, ...] = ()


class CompensateFound(ResultData, frozen=True, kw_only=True):
    """``compensate``: half-gap [rad], impact speed asked for [rad/s], and the least time of a traversal [s].

    ``bound_speeds`` [rad/s] and ``bound_times`` [s] are that time for other speeds; ``path_times`` [s] and ``path``
    [rad] the quickest traversal.
    """

    alpha: float
    tau: float
    impact_speed: float
    bound: float
    laws: tuple[LawFound, ...]
    forecast: ForecastFound | None = None
    bound_speeds: tuple[float, ...] = ()
    bound_times: tuple[float, ...] = ()
    path_times: tuple[float, ...] = ()
    path: tuple[float, ...] = ()
