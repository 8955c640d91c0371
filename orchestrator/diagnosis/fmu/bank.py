"""What may be attached around an FMU: one row each, with where a fit starts from."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from pyfmu_sources.laws import port as laws

Array = NDArray[np.float64]
Values = tuple[float, ...]
INPUT, OUTPUT, PORT, PARAMETER, CUT = "input", "output", "port", "parameter", "cut"
ONCE_A_TURN = 0.03  # of a turn by which a ripple must differ from gravity, which comes once a turn
LONG = 0.04  # of the motion over which hysteresis builds up at least: below, it is friction
STARTS_OFF = 1e-3  # of its rms by which an input starts away from zero to be tried from both


@dataclass(frozen=True, eq=False)
class PlaceScales:
    """Typical sizes of what happens where an effect would act; starting values depend on them.

    Attributes:
        h: sample time [s].
        size: rms of the signal (at a port: of the effort that drives it).
        signal: its samples (rows,).
        noise: standard deviation of the measurement, for outputs.
        position: rms of the position about zero; span: from the smallest to the largest.
        speed: rms of the speed.
        angular: the position is an angle.
        effort: rms of what goes through a cut, negative where it acts against the twist.
        cycles: wavenumbers of ripples over the position, in order, told apart within its span.
    """

    h: float
    size: float
    peak: float
    signal: Array
    noise: float = 0.0
    position: float = 1.0
    span: float = 1.0
    speed: float = 1.0
    acceleration: float = 1.0
    angular: bool = False
    effort: float = 1.0
    cycles: tuple[float, ...] = ()


@dataclass(frozen=True)
class EffectKind:
    """One row of the bank.

    Attributes:
        where: in series at an ``input`` or an ``output``, as feedback at a ``port``, in the value of a ``parameter``,
            or in the ``cut`` between two FMUs.
        sort: what sort of law it is, see :class:`CandidateEffect`.
        parameters: their names, in the order of the values.
        units: of each: "effort", "flow", "signal" and "s" stand for the units at the place where it acts.
        scales: signal scales -> what counts as a small change of each.
        starts: signal scales -> values to try; None: the response is proportional to all values.
        amplitudes: in how many of the values, the first ones, the response is linear, where it is not in all.
        law: number of the law, for feedback.
        lower: smallest value of each.
        positive: amplitudes below 0 mean nothing.
        needs: the simpler effect that it contains.
        plausible: values -> False where the fit has left what the effect means.
        remembers: it matters what the signal was before the record.
        scan: signal scales -> values in order, so close that the best of them leads a fit to the right one: more than
            the FMU is run for, looked through where it is linear.
    """

    name: str
    where: str
    sort: str
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    scales: Callable[[PlaceScales], Values]
    starts: Callable[[PlaceScales], tuple[Values, ...]] | None = None
    amplitudes: int = 0
    law: int = 0
    lower: Values = ()
    positive: bool = False
    needs: str = ""
    plausible: Callable[[Values, PlaceScales], bool] = lambda values, scales: True
    remembers: bool = False
    scan: Callable[[PlaceScales], tuple[float, ...]] = lambda scales: ()


def _shares(shares: Values, of: str) -> Callable[[PlaceScales], tuple[Values, ...]]:
    return lambda s: tuple((f * getattr(s, of),) for f in shares)


def _rates(s: PlaceScales) -> tuple[Values, ...]:
    steps = np.abs(np.diff(s.signal))
    top = float(steps.max()) / s.h if len(steps) else 1.0
    return tuple((f * top,) for f in (0.02, 0.05, 0.12, 0.25, 0.5, 0.8))


def _all_rates(s: PlaceScales) -> tuple[float, ...]:
    """Return rates up to many times what the samples show: a jump between two of them takes its time all the same."""
    return tuple(float(f * _rates(s)[-1][0]) for f in np.geomspace(0.003, 60.0, 64))


def _all_quanta(s: PlaceScales) -> tuple[float, ...]:
    """Return quanta of which the peak holds 60 to a half, a quarter more or less each time: no threshold is passed."""
    return tuple(float(s.peak / count) for count in np.arange(60.0, 0.5, -0.25))


def _speeds_and_walks(s: PlaceScales) -> tuple[Values, ...]:
    walk = s.speed * s.h
    return tuple((0.0, 0.0, v * s.speed, d * walk) for v in (0.1, 0.3) for d in (0.1, 0.6, 3.0))


_delays = _shares((0.15, 0.5, 1.0, 1.7, 2.5, 4.0, 6.0, 9.0, 14.0), "h")
_lags = _shares((0.3, 1.0, 3.0, 8.0, 20.0), "h")
_limits = _shares((0.3, 0.5, 0.65, 0.75, 0.83, 0.89, 0.93, 0.96, 0.985, 0.996), "peak")


def _repeats(values: Values, scales: PlaceScales) -> bool:
    """Tell whether a ripple comes back within the motion, more than once a turn: else it is a spring, or gravity."""
    slow = bool(scales.cycles) and abs(values[2]) < 0.5 * scales.cycles[0]
    return not slow and not (scales.angular and abs(values[2] - 1.0) < ONCE_A_TURN)


def _positive(values: Values, scales: PlaceScales) -> bool:
    del scales
    return values[0] > 0.0


_SERIES = (
    EffectKind("input_gain", INPUT, "gain", ("gain",), ("1",), lambda s: (0.01,)),
    EffectKind("input_offset", INPUT, "constant", ("offset",), ("effort",), lambda s: (0.01 * s.size,)),
    EffectKind("input_delay", INPUT, "timing", ("delay",), ("s",), lambda s: (0.02 * s.h,), _delays, lower=(0.0,),
               remembers=True),
    EffectKind("input_lag", INPUT, "timing", ("time_constant",), ("s",), lambda s: (0.02 * s.h,), _lags, lower=(0.0,),
               remembers=True),
    EffectKind("input_saturation", INPUT, "limit", ("limit",), ("effort",), lambda s: (0.003 * s.peak,), _limits,
               lower=(0.0,), scan=lambda s: tuple(float(s.peak * (1.0 - f)) for f in np.geomspace(0.9, 0.001, 48))),
    EffectKind("input_dead_zone", INPUT, "limit", ("width",), ("effort",), lambda s: (0.003 * s.peak,),
               _shares((0.01, 0.03, 0.08, 0.16, 0.3), "peak"), lower=(0.0,),
               scan=lambda s: tuple(float(s.peak * f) for f in np.geomspace(0.0003, 0.8, 48))),
    EffectKind("input_rate_limit", INPUT, "limit", ("rate",), ("effort/s",), lambda s: (0.01 * _rates(s)[2][0],),
               _rates, lower=(1e-30,), remembers=True, scan=_all_rates),
    EffectKind("input_quantisation", INPUT, "resolution", ("step",), ("effort",), lambda s: (0.01 * s.peak,),
               _shares((0.05, 0.1, 0.2, 0.4), "peak"), lower=(0.0,), scan=_all_quanta),
    EffectKind("output_gain", OUTPUT, "gain", ("gain",), ("1",), lambda s: (0.003,)),
    EffectKind("output_offset", OUTPUT, "constant", ("offset",), ("flow",), lambda s: (s.noise,)),
    EffectKind("output_delay", OUTPUT, "timing", ("delay",), ("s",), lambda s: (0.02 * s.h,), _delays, lower=(0.0,)),
    EffectKind("output_lag", OUTPUT, "timing", ("time_constant",), ("s",), lambda s: (0.02 * s.h,), _lags,
               lower=(0.0,)),
    EffectKind("output_quantisation", OUTPUT, "resolution", ("step",), ("flow",), lambda s: (s.noise,),
               _shares((6.0, 15.0, 40.0, 100.0), "noise"), lower=(0.0,)),
)  # fmt: skip

_FEEDBACK = (
    EffectKind("coulomb_friction", PORT, "friction", ("level", "distance"), ("effort", "flow"),
               lambda s: (0.01 * s.size, 0.2 * s.speed * s.h),
               lambda s: tuple((0.0, f * (s.speed * s.h)) for f in (0.1, 0.6, 3.0, 12.0, 60.0)), 1, laws.COULOMB,
               (0.0, 1e-300), True, plausible=lambda v, s: 0.0 < v[0] < 3.0 * s.peak and v[1] < 0.5 * s.span),
    EffectKind("stribeck_friction", PORT, "friction", ("sliding", "breakaway", "speed", "distance"),
               ("effort", "effort", "flow/s", "flow"),
               lambda s: (0.01 * s.size, 0.01 * s.size, 0.02 * s.speed, 0.2 * s.speed * s.h), _speeds_and_walks, 2,
               laws.STRIBECK, (0.0, 0.0, 1e-300, 1e-300), True, "coulomb_friction",
               plausible=lambda v, s: v[1] > max(1.03 * v[0], 0.0)),
    EffectKind("quadratic_drag", PORT, "speed", ("coefficient",), ("effort.s2/flow2",),
               lambda s: (0.01 * s.size / s.speed**2,), law=laws.QUADRATIC, positive=True, plausible=_positive),
    EffectKind("viscous_drag", PORT, "speed", ("coefficient",), ("effort.s/flow",),
               lambda s: (0.01 * s.size / s.speed,), law=laws.VISCOUS, positive=True, plausible=_positive),
    EffectKind("spring", PORT, "position", ("stiffness",), ("effort/flow",), lambda s: (0.01 * s.size / s.position,),
               law=laws.SPRING, positive=True, plausible=_positive),
    EffectKind("hardening_spring", PORT, "position", ("cubic",), ("effort/flow3",),
               lambda s: (0.01 * s.size / s.position**3,), law=laws.HARDENING),
    EffectKind("gravity", PORT, "position", ("sine", "cosine"), ("effort", "effort"),
               lambda s: (0.01 * s.size, 0.01 * s.size), law=laws.GRAVITY),
    EffectKind("ripple", PORT, "wave", ("sine", "cosine", "wavenumber"), ("effort", "effort", "1/flow"),
               lambda s: (0.01 * s.size, 0.01 * s.size, 0.02 / s.span),
               lambda s: tuple((0.0, 0.0, cycle) for cycle in s.cycles[:1]), 2, laws.RIPPLE, plausible=_repeats),
    EffectKind("hysteresis", PORT, "memory", ("level", "distance"), ("effort", "flow"),
               lambda s: (0.01 * s.size, 0.02 * s.span),
               lambda s: tuple((0.0, f * s.span) for f in (0.08, 0.25, 0.8)), 1, laws.HYSTERESIS, (0.0, 1e-300), True,
               plausible=lambda v, s: 0.0 < v[0] < 10.0 * s.peak and LONG * s.span < v[1] < 3.0 * s.span),
    EffectKind("load", PORT, "constant", ("effort",), ("effort",), lambda s: (0.01 * s.size,), law=laws.LOAD),
    EffectKind("directional_friction", PORT, "speed", ("difference",), ("effort.s/flow",),
               lambda s: (0.01 * s.size / s.speed,), law=laws.DIRECTIONAL),
    EffectKind("added_inertia", PORT, "inertia", ("inertia",), ("effort.s2/flow",),
               lambda s: (0.003 * s.size / s.acceleration,), law=laws.INERTIA),
)  # fmt: skip

_ELSEWHERE = (
    EffectKind("parameter_drift", PARAMETER, "parameter", ("rate",), ("effort/s",),
               lambda s: (0.05 * s.size / s.span,)),
    EffectKind("parameter_dependence", PARAMETER, "parameter", ("slope",), ("effort/signal",),
               lambda s: (0.05 * s.size / s.span,)),
    EffectKind("backlash", CUT, "gap", ("width",), ("flow",), lambda s: (0.02 * s.size,),
               _shares((0.1, 0.4, 1.5, 6.0, 25.0), "size"), law=laws.BACKLASH, lower=(0.0,),
               plausible=lambda v, s: 0.0 < v[0] < 0.5 * s.span),
    EffectKind("compliance", CUT, "resonance", ("compliance",), ("flow/effort",), lambda s: (0.01 * s.size / s.effort,),
               law=laws.COMPLIANCE, positive=True, plausible=_positive),
)  # fmt: skip

BANK: Mapping[str, EffectKind] = {kind.name: kind for kind in (*_SERIES, *_FEEDBACK, *_ELSEWHERE)}


@dataclass(frozen=True)
class FmuEffect:
    """An effect of the bank at a place: the name of an input, an output, a parameter, a port or a cut of the map.

    ``at_rest``: a signal with memory was zero before the record, and not what it was at first. ``signal``: what a
    parameter depends on.
    """

    kind: EffectKind
    place: str
    scales: PlaceScales = field(compare=False, repr=False)
    at_rest: bool = False
    signal: str = ""

    @property
    def label(self) -> str:
        """Return name and place."""
        return f"{self.kind.name}@{self.place}" + (f"({self.signal})" if self.signal else "")

    @property
    def remembers(self) -> bool:
        """Whether it matters what the signal was before the record."""
        return self.kind.remembers and abs(self.scales.signal[0]) > STARTS_OFF * self.scales.size

    def at(self, values: Values) -> tuple["FmuEffect", Array]:
        """Return effect and values as a run takes them, of values as the analysis has them."""
        count = len(self.kind.parameters)
        given = np.array(values[:count])
        given = np.maximum(given, self.kind.lower) if self.kind.lower else given
        return replace(self, at_rest=len(values) > count and values[count] > 0.5), given

    def values_by_name(self, values: Values) -> dict[str, float]:
        """Return values by name; a gain, which is fitted by what it has more than 1, is the factor."""
        more = 1.0 if self.kind.name.endswith("_gain") else 0.0
        return {name: more + value for name, value in zip(self.kind.parameters, values, strict=False)}
