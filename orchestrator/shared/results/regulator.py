"""What ``regulator.json`` holds: gains of an LQR, and what its loop does."""

import msgspec

from orchestrator.shared.results import ResultData


class ForecastFound(msgspec.Struct, frozen=True):
    """A loop at rest, without friction and load, by its gains alone.

    ``twist`` and ``load`` are amplitudes over the half-gap, ``frequency`` [Hz]; ``settled``: the motion was followed
    until it repeated itself or came to rest. Margins are those without a gap [rad], [s],
    as factors of the gain; None: there is none. ``rank`` of six states.
    """

    cycles: bool
    twist: float
    load: float
    frequency: float
    phase_margin: float
    delay_margin: float | None
    rank: int
    settled: bool = True
    lower_gain: float | None = None
    upper_gain: float | None = None


class RegulatorFound(ResultData, frozen=True, kw_only=True):
    """``regulator``: gains by name, the forecast, and the loop's response at the request.

    ``frequencies`` [Hz], ``response`` its size, ``phases`` [rad].
    """

    gains: dict[str, float]
    sample_time: float
    delay: int
    forecast: ForecastFound
    frequencies: tuple[float, ...] = ()
    response: tuple[float, ...] = ()
    phases: tuple[float, ...] = ()
