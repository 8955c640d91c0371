"""What may be attached around an FMU: one row each, with where a fit starts from."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from orchestrator.effects import of_bodies
from orchestrator.effects.effect import Bounds, Effect, PlaceScales, Starts
from orchestrator.shared.arrays import Array
from pyfmu_sources.laws import body as laws

Values = tuple[float, ...]
INPUT, OUTPUT, PORT, PARAMETER, CUT = "input", "output", "port", "parameter", "cut"
ONCE_A_TURN = 0.03  # of a turn by which a ripple must differ from gravity, which comes once a turn
LONG = 0.04  # of the motion over which hysteresis builds up at least: below, it is friction
STARTS_OFF = 1e-3  # of its rms by which an input starts away from zero to be tried from both


def _shares(short: str, shares: Values, of: str) -> Callable[[PlaceScales], Starts]:
    return lambda s: {short: tuple(f * getattr(s, of) for f in shares)}


def _rates(s: PlaceScales) -> Values:
    steps = np.abs(np.diff(s.signal))
    top = float(steps.max()) / s.h if len(steps) else 1.0
    return tuple(f * top for f in (0.02, 0.05, 0.12, 0.25, 0.5, 0.8))


def _all_rates(s: PlaceScales) -> tuple[float, ...]:
    """Return rates up to many times what the samples show: a jump between two of them takes its time all the same."""
    return tuple(float(f * _rates(s)[-1]) for f in np.geomspace(0.003, 60.0, 64))


def _all_quanta(s: PlaceScales) -> tuple[float, ...]:
    """Return quanta of which the peak holds 60 to a half, a quarter more or less each time: no threshold is passed."""
    return tuple(float(s.peak / count) for count in np.arange(60.0, 0.5, -0.25))


def _speeds_and_walks(s: PlaceScales) -> Starts:
    walk = s.speed * s.h
    return {"speed": tuple(v * s.speed for v in (0.1, 0.3)), "distance": tuple(d * walk for d in (0.1, 0.6, 3.0))}


_DELAYS = (0.15, 0.5, 1.0, 1.7, 2.5, 4.0, 6.0, 9.0, 14.0)
_LAGS = (0.3, 1.0, 3.0, 8.0, 20.0)


def _repeats(values: Mapping[str, float], scales: PlaceScales) -> bool:
    """Tell whether a ripple comes back within the motion, more than once a turn: else it is a spring, or gravity."""
    slow = bool(scales.cycles) and abs(values["wavenumber"]) < 0.5 * scales.cycles[0]
    return not slow and not (scales.angular and abs(values["wavenumber"] - 1.0) < ONCE_A_TURN)


def _row(
    site: str, name: str, kind: str, units: Mapping[str, str], scales: Callable[[PlaceScales], Values], **others: Any
) -> Effect:
    """Return a row whose response is linear in all its values, unless it says where a fit starts."""
    small = lambda s: dict(zip(units, scales(s), strict=True))  # noqa: E731
    linear = {} if "starts" in others else {"amplitudes": tuple(units)}
    return Effect(name, site, kind, units, next(iter(units)), small, **{**linear, **others})


def _from(short: str, least: float) -> Callable[[PlaceScales], Bounds]:
    """Return bounds of one value that has a least one."""
    return lambda s: {short: (least, np.inf)}


def _series(
    site: str, name: str, kind: str, short: str, unit: str, small: Callable[[PlaceScales], float], **others: Any
) -> Effect:
    """Return the row of an effect in series, of one value that is not below zero."""
    given = {"bounds": _from(short, 0.0), **others}
    return _row(site, f"{site}_{name}", kind, {short: unit}, lambda s: (small(s),), **given)


_SERIES = (
    _row(INPUT, "input_gain", "gain", {"gain": "1"}, lambda s: (0.01,)),
    _row(INPUT, "input_offset", "constant", {"offset": "effort"}, lambda s: (0.01 * s.size,)),
    _series(INPUT, "delay", "timing", "delay", "s", lambda s: 0.02 * s.h, starts=_shares("delay", _DELAYS, "h"),
            remembers=True),
    _series(INPUT, "lag", "timing", "time_constant", "s", lambda s: 0.02 * s.h,
            starts=_shares("time_constant", _LAGS, "h"), remembers=True),
    _series(INPUT, "saturation", "limit", "limit", "effort", lambda s: 0.003 * s.peak,
            starts=_shares("limit", (0.3, 0.5, 0.65, 0.75, 0.83, 0.89, 0.93, 0.96, 0.985, 0.996), "peak"),
            scan=lambda s: tuple(float(s.peak * (1.0 - f)) for f in np.geomspace(0.9, 0.001, 48))),
    _series(INPUT, "dead_zone", "limit", "width", "effort", lambda s: 0.003 * s.peak,
            starts=_shares("width", (0.01, 0.03, 0.08, 0.16, 0.3), "peak"),
            scan=lambda s: tuple(float(s.peak * f) for f in np.geomspace(0.0003, 0.8, 48))),
    _series(INPUT, "rate_limit", "limit", "rate", "effort/s", lambda s: 0.01 * _rates(s)[2],
            starts=lambda s: {"rate": _rates(s)}, bounds=_from("rate", 1e-30), remembers=True, scan=_all_rates),
    _series(INPUT, "quantisation", "resolution", "step", "effort", lambda s: 0.01 * s.peak,
            starts=_shares("step", (0.05, 0.1, 0.2, 0.4), "peak"), scan=_all_quanta),
    _row(OUTPUT, "output_gain", "gain", {"gain": "1"}, lambda s: (0.003,)),
    _row(OUTPUT, "output_offset", "constant", {"offset": "flow"}, lambda s: (s.noise,)),
    _series(OUTPUT, "delay", "timing", "delay", "s", lambda s: 0.02 * s.h, starts=_shares("delay", _DELAYS, "h")),
    _series(OUTPUT, "lag", "timing", "time_constant", "s", lambda s: 0.02 * s.h,
            starts=_shares("time_constant", _LAGS, "h")),
    _series(OUTPUT, "quantisation", "resolution", "step", "flow", lambda s: s.noise,
            starts=_shares("step", (6.0, 15.0, 40.0, 100.0), "noise")),
)  # fmt: skip

_FEEDBACK = (
    _row(PORT, "coulomb_friction", "friction", {"level": "effort", "distance": "flow"},
         lambda s: (0.01 * s.size, 0.2 * s.speed * s.h),
         starts=lambda s: {"distance": tuple(f * (s.speed * s.h) for f in (0.1, 0.6, 3.0, 12.0, 60.0))},
         amplitudes=("level",), law=laws.COULOMB,
         bounds=lambda s: {"level": (0.0, np.inf), "distance": (1e-300, np.inf)},
         signed=False,
         possible=lambda v, s: 0.0 < v["level"] < 3.0 * s.peak and v["distance"] < 0.5 * s.span),
    _row(PORT, "stribeck_friction", "friction",
         {"sliding": "effort", "breakaway": "effort", "speed": "flow/s", "distance": "flow"},
         lambda s: (0.01 * s.size, 0.01 * s.size, 0.02 * s.speed, 0.2 * s.speed * s.h), starts=_speeds_and_walks,
         amplitudes=("sliding", "breakaway"), law=laws.STRIBECK, signed=False, contains="coulomb_friction",
         bounds=lambda s: {"sliding": (0.0, np.inf), "breakaway": (0.0, np.inf), "speed": (1e-300, np.inf),
                           "distance": (1e-300, np.inf)},
         possible=lambda v, s: v["breakaway"] > max(1.03 * v["sliding"], 0.0)),
    *of_bodies.AT_PORT,
    _row(PORT, "viscous_drag", "speed", {"coefficient": "effort.s/flow"}, lambda s: (0.01 * s.size / s.speed,),
         law=laws.VISCOUS, signed=False, possible=of_bodies.is_positive),
    _row(PORT, "spring", "position", {"stiffness": "effort/flow"}, lambda s: (0.01 * s.size / s.position,),
         law=laws.SPRING, signed=False, possible=of_bodies.is_positive),
    _row(PORT, "hardening_spring", "position", {"cubic": "effort/flow3"}, lambda s: (0.01 * s.size / s.position**3,),
         law=laws.HARDENING),
    _row(PORT, "gravity", "position", {"sine": "effort", "cosine": "effort"},
         lambda s: (0.01 * s.size, 0.01 * s.size), law=laws.GRAVITY),
    _row(PORT, "ripple", "wave", {"sine": "effort", "cosine": "effort", "wavenumber": "1/flow"},
         lambda s: (0.01 * s.size, 0.01 * s.size, 0.02 / s.span), starts=lambda s: {"wavenumber": s.cycles[:1]},
         amplitudes=("sine", "cosine"), law=laws.RIPPLE, possible=_repeats),
    _row(PORT, "hysteresis", "memory", {"level": "effort", "distance": "flow"},
         lambda s: (0.01 * s.size, 0.02 * s.span),
         starts=lambda s: {"distance": tuple(f * s.span for f in (0.08, 0.25, 0.8))}, amplitudes=("level",),
         law=laws.HYSTERESIS, bounds=lambda s: {"level": (0.0, np.inf), "distance": (1e-300, np.inf)}, signed=False,
         possible=lambda v, s: 0.0 < v["level"] < 10.0 * s.peak and LONG * s.span < v["distance"] < 3.0 * s.span),
    _row(PORT, "load", "constant", {"effort": "effort"}, lambda s: (0.01 * s.size,), law=laws.LOAD),
    _row(PORT, "directional_friction", "speed", {"difference": "effort.s/flow"}, lambda s: (0.01 * s.size / s.speed,),
         law=laws.DIRECTIONAL),
    _row(PORT, "added_inertia", "inertia", {"inertia": "effort.s2/flow"},
         lambda s: (0.003 * s.size / s.acceleration,), law=laws.INERTIA),
)  # fmt: skip

_ELSEWHERE = (
    _row(PARAMETER, "parameter_drift", "parameter", {"rate": "effort/s"}, lambda s: (0.05 * s.size / s.span,)),
    _row(PARAMETER, "parameter_dependence", "parameter", {"slope": "effort/signal"},
         lambda s: (0.05 * s.size / s.span,)),
    _row(CUT, "backlash", "gap", {"width": "flow"}, lambda s: (0.02 * s.size,),
         starts=_shares("width", (0.1, 0.4, 1.5, 6.0, 25.0), "size"), law=laws.BACKLASH, bounds=_from("width", 0.0),
         possible=lambda v, s: 0.0 < v["width"] < 0.5 * s.span),
    _row(CUT, "compliance", "resonance", {"compliance": "flow/effort"}, lambda s: (0.01 * s.size / s.effort,),
         law=laws.COMPLIANCE, signed=False, possible=of_bodies.is_positive),
)  # fmt: skip

BANK: Mapping[str, Effect] = {row.name: row for row in (*_SERIES, *_FEEDBACK, *_ELSEWHERE)}


@dataclass(frozen=True)
class FmuEffect:
    """An effect of the bank at a place: the name of an input, an output, a parameter, a port or a cut of the map.

    ``at_rest``: a signal with memory was zero before the record, and not what it was at first. ``signal``: what a
    parameter depends on.
    """

    row: Effect
    place: str
    scales: PlaceScales = field(compare=False, repr=False)
    at_rest: bool = False
    signal: str = ""

    @property
    def label(self) -> str:
        """Return name and place."""
        return f"{self.row.name}@{self.place}" + (f"({self.signal})" if self.signal else "")

    @property
    def remembers(self) -> bool:
        """Whether it matters what the signal was before the record."""
        return self.row.remembers and abs(self.scales.signal[0]) > STARTS_OFF * self.scales.size

    @property
    def lower(self) -> Values:
        """Return the least of each value."""
        bounds = self.row.bounds(self.scales)
        return tuple(bounds[name][0] if name in bounds else -np.inf for name in self.row.parameters)

    def at(self, values: Values) -> tuple["FmuEffect", Array]:
        """Return effect and values as a run takes them, of values as the analysis has them."""
        count = len(self.row.parameters)
        given = np.maximum(np.array(values[:count]), self.lower)
        return replace(self, at_rest=len(values) > count and values[count] > 0.5), given

    def values_by_name(self, values: Values) -> dict[str, float]:
        """Return values by name; a gain, which is fitted by what it has more than 1, is the factor."""
        more = 1.0 if self.row.name.endswith("_gain") else 0.0
        return {name: more + value for name, value in zip(self.row.parameters, values, strict=False)}

    def is_possible(self, values: Values) -> bool:
        """Tell whether a fit has not left what the effect means."""
        return self.row.possible(dict(zip(self.row.parameters, values, strict=True)), self.scales)
