"""What may be attached around an FMU: one row each, with where a fit starts from."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pyfmu_sources import port_laws as laws

Array = NDArray[np.float64]
INPUT, OUTPUT, PORT, PARAMETER, CUT = "input", "output", "port", "parameter", "cut"


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Typical sizes of what happens where an effect would act; starting values depend on them.

    Attributes:
        h: sample time [s].
        size: rms of the signal (at a port: of the effort that drives it).
        signal: its samples.
        noise: standard deviation of the measurement, for outputs.
        position: rms of the position about zero; span: from the smallest to the largest.
        speed: rms of the speed.
        angular: the position is an angle.
        effort: rms of what goes through a cut, negative where it acts against the twist.
        cycles: wavenumbers of ripples over the position, in order, told apart within its span.
        once, long: thresholds that tell ripples from gravity, and hysteresis from friction.
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
    once: float = 0.0
    long: float = 0.0


Values = tuple[float, ...]
REMEMBERS = ("input_delay", "input_lag", "input_rate_limit")
"""Effects in series with an input for which it matters what the signal was before the record."""


@dataclass(frozen=True)
class Kind:
    """One row of the bank.

    Attributes:
        where: in series at an ``input`` or an ``output``, as feedback at a ``port``, in the value of a ``parameter``,
            or in the ``cut`` between two FMUs.
        parameters: their names, in the order of the values.
        units: of each: "effort", "flow", "signal" and "s" stand for the units at the place where it acts.
        scales: scene -> what counts as a small change of each.
        starts: scene -> values to try.
        linear: the response is proportional to all values (found from one small change of each).
        law: number of the law, for feedback.
        lower: smallest value of each.
        amplitudes: in how many of the values, the first ones, the response is linear, where it is not in all.
        needs: the simpler effect that it contains.
        plausible: values -> False where the fit has left what the effect means.
        scan: scene -> values of the last parameter, in order and so close that the best of them leads a fit to the
            right one: more than the FMU is run for, looked through with its surrogate.
    """

    name: str
    where: str
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    scales: Callable[[Surroundings], Values]
    starts: Callable[[Surroundings], tuple[Values, ...]]
    linear: bool = False
    law: int = 0
    lower: Values = ()
    amplitudes: int = 0
    needs: str = ""
    plausible: Callable[[Values, Surroundings], bool] = lambda values, scene: True
    angular: bool = False
    scan: Callable[[Surroundings], tuple[float, ...]] = lambda scene: ()


def _delays(s: Surroundings) -> tuple[Values, ...]:
    return tuple((f * s.h,) for f in (0.15, 0.5, 1.0, 1.7, 2.5, 4.0, 6.0, 9.0, 14.0))


def _lags(s: Surroundings) -> tuple[Values, ...]:
    return tuple((f * s.h,) for f in (0.3, 1.0, 3.0, 8.0, 20.0))


def _limits(s: Surroundings) -> tuple[Values, ...]:
    return tuple((f * s.peak,) for f in (0.3, 0.5, 0.65, 0.75, 0.83, 0.89, 0.93, 0.96, 0.985, 0.996))


def _widths(s: Surroundings) -> tuple[Values, ...]:
    return tuple((f * s.peak,) for f in (0.01, 0.03, 0.08, 0.16, 0.3))


def _rates(s: Surroundings) -> tuple[Values, ...]:
    steps = np.abs(np.diff(s.signal))
    top = float(steps.max()) / s.h if len(steps) else 1.0
    return tuple((f * top,) for f in (0.02, 0.05, 0.12, 0.25, 0.5, 0.8))


def _quanta(s: Surroundings) -> tuple[Values, ...]:
    return tuple((f * s.peak,) for f in (0.05, 0.1, 0.2, 0.4))


def _all_limits(s: Surroundings) -> tuple[float, ...]:
    return tuple(float(s.peak * (1.0 - f)) for f in np.geomspace(0.9, 0.001, 48))


def _all_widths(s: Surroundings) -> tuple[float, ...]:
    return tuple(float(s.peak * f) for f in np.geomspace(0.0003, 0.8, 48))


def _all_rates(s: Surroundings) -> tuple[float, ...]:
    """Return rates up to many times what the samples show: a jump between two of them takes its time all the same."""
    return tuple(float(f * _rates(s)[-1][0]) for f in np.geomspace(0.003, 60.0, 64))


def _all_quanta(s: Surroundings) -> tuple[float, ...]:
    """Return quanta of which the peak holds 60 to a half, a quarter more or less each time: no threshold is passed."""
    return tuple(float(s.peak / count) for count in np.arange(60.0, 0.5, -0.25))


def _friction(s: Surroundings) -> tuple[Values, ...]:
    walk = s.speed * s.h
    return tuple((0.05 * s.size, f * walk) for f in (0.1, 0.6, 3.0, 12.0, 60.0))


def _small(share: float) -> Callable[[Surroundings], Values]:
    return lambda s: (share * s.size,)


def _once_a_turn(values: Values, scene: Surroundings) -> bool:
    return scene.angular and abs(values[2] - 1.0) < scene.once


def _repeats(values: Values, scene: Surroundings) -> bool:
    """Tell whether a ripple comes back within the motion, more than once a turn: else it is a spring, or gravity."""
    slow = bool(scene.cycles) and abs(values[2]) < 0.5 * scene.cycles[0]
    return not slow and not _once_a_turn(values, scene)


def _positive(values: Values, scene: Surroundings) -> bool:
    del scene
    return values[0] > 0.0


_SERIES = (
    Kind("input_gain", INPUT, ("gain",), ("1",), lambda s: (0.01,), lambda s: ((0.01,),), True),
    Kind("input_offset", INPUT, ("offset",), ("effort",), _small(0.01), lambda s: ((0.01 * s.size,),), True),
    Kind("input_delay", INPUT, ("delay",), ("s",), lambda s: (0.02 * s.h,), _delays, lower=(0.0,)),
    Kind("input_lag", INPUT, ("time_constant",), ("s",), lambda s: (0.02 * s.h,), _lags, lower=(0.0,)),
    Kind("input_saturation", INPUT, ("limit",), ("effort",), lambda s: (0.003 * s.peak,), _limits, lower=(0.0,),
         scan=_all_limits),
    Kind("input_dead_zone", INPUT, ("width",), ("effort",), lambda s: (0.003 * s.peak,), _widths, lower=(0.0,),
         scan=_all_widths),
    Kind("input_rate_limit", INPUT, ("rate",), ("effort/s",), lambda s: (0.01 * _rates(s)[2][0],), _rates,
         lower=(1e-30,), scan=_all_rates),
    Kind("input_quantisation", INPUT, ("step",), ("effort",), lambda s: (0.01 * s.peak,), _quanta, lower=(0.0,),
         scan=_all_quanta),
    Kind("output_gain", OUTPUT, ("gain",), ("1",), lambda s: (0.003,), lambda s: ((0.01,),), True),
    Kind("output_offset", OUTPUT, ("offset",), ("flow",), lambda s: (s.noise,), lambda s: ((s.noise,),), True),
    Kind("output_delay", OUTPUT, ("delay",), ("s",), lambda s: (0.02 * s.h,), _delays, lower=(0.0,)),
    Kind("output_lag", OUTPUT, ("time_constant",), ("s",), lambda s: (0.02 * s.h,), _lags, lower=(0.0,)),
    Kind("output_quantisation", OUTPUT, ("step",), ("flow",), lambda s: (s.noise,),
         lambda s: tuple((f * s.noise,) for f in (6.0, 15.0, 40.0, 100.0)), lower=(0.0,)),
)  # fmt: skip

_FEEDBACK = (
    Kind("coulomb_friction", PORT, ("level", "distance"), ("effort", "flow"),
         lambda s: (0.01 * s.size, 0.2 * s.speed * s.h), _friction, law=laws.COULOMB, lower=(0.0, 1e-300), amplitudes=1,
         plausible=lambda v, s: 0.0 < v[0] < 3.0 * s.peak and v[1] < 0.5 * s.span),
    Kind("stribeck_friction", PORT, ("sliding", "breakaway", "speed", "distance"),
         ("effort", "effort", "flow/s", "flow"),
         lambda s: (0.01 * s.size, 0.01 * s.size, 0.02 * s.speed, 0.2 * s.speed * s.h), lambda s: (),
         law=laws.STRIBECK, lower=(0.0, 0.0, 1e-300, 1e-300), needs="coulomb_friction",
         plausible=lambda v, s: v[1] > max(1.03 * v[0], 0.0)),
    Kind("quadratic_drag", PORT, ("coefficient",), ("effort.s2/flow2",), lambda s: (0.01 * s.size / s.speed**2,),
         lambda s: ((0.01 * s.size / s.speed**2,),), True, laws.QUADRATIC, plausible=_positive),
    Kind("viscous_drag", PORT, ("coefficient",), ("effort.s/flow",), lambda s: (0.01 * s.size / s.speed,),
         lambda s: ((0.01 * s.size / s.speed,),), True, laws.VISCOUS, plausible=_positive),
    Kind("spring", PORT, ("stiffness",), ("effort/flow",), lambda s: (0.01 * s.size / s.position,),
         lambda s: ((0.01 * s.size / s.position,),), True, laws.SPRING, plausible=_positive),
    Kind("hardening_spring", PORT, ("cubic",), ("effort/flow3",), lambda s: (0.01 * s.size / s.position**3,),
         lambda s: ((0.01 * s.size / s.position**3,),), True, laws.HARDENING),
    Kind("gravity", PORT, ("sine", "cosine"), ("effort", "effort"), lambda s: (0.01 * s.size, 0.01 * s.size),
         lambda s: ((0.01 * s.size, 0.01 * s.size),), True, laws.GRAVITY, angular=True),
    Kind("ripple", PORT, ("sine", "cosine", "wavenumber"), ("effort", "effort", "1/flow"),
         lambda s: (0.01 * s.size, 0.01 * s.size, 0.02 / s.span),
         lambda s: tuple((0.01 * s.size, 0.01 * s.size, n) for n in s.cycles[:: max(len(s.cycles) // 24, 1)]),
         law=laws.RIPPLE, scan=lambda s: s.cycles, amplitudes=2,
         plausible=_repeats),
    Kind("hysteresis", PORT, ("level", "distance"), ("effort", "flow"),
         lambda s: (0.01 * s.size, 0.02 * s.span),
         lambda s: tuple((0.05 * s.size, f * s.span) for f in (0.08, 0.25, 0.8)),
         law=laws.HYSTERESIS, lower=(0.0, 1e-300), amplitudes=1,
         plausible=lambda v, s: 0.0 < v[0] < 10.0 * s.peak and s.long * s.span < v[1] < 3.0 * s.span),
    Kind("load", PORT, ("effort",), ("effort",), _small(0.01), lambda s: ((0.01 * s.size,),), True, laws.LOAD),
    Kind("directional_friction", PORT, ("difference",), ("effort.s/flow",), lambda s: (0.01 * s.size / s.speed,),
         lambda s: ((0.01 * s.size / s.speed,),), True, laws.DIRECTIONAL),
    Kind("added_inertia", PORT, ("inertia",), ("effort.s2/flow",), lambda s: (0.003 * s.size / s.acceleration,),
         lambda s: ((0.003 * s.size / s.acceleration,),), True, laws.INERTIA),
)  # fmt: skip

_INSIDE = (
    Kind("parameter_drift", PARAMETER, ("rate",), ("effort/s",), lambda s: (0.05 * s.size / s.span,),
         lambda s: ((0.1 * s.size / s.span,),), True),
    Kind("parameter_dependence", PARAMETER, ("slope",), ("effort/signal",), lambda s: (0.05 * s.size / s.span,),
         lambda s: ((0.1 * s.size / s.span,),), True),
)  # fmt: skip

_BETWEEN = (
    Kind("backlash", CUT, ("width",), ("flow",), lambda s: (0.02 * s.size,),
         lambda s: tuple((f * s.size,) for f in (0.1, 0.4, 1.5, 6.0, 25.0)), law=laws.BACKLASH, lower=(0.0,),
         plausible=lambda v, s: 0.0 < v[0] < 0.5 * s.span),
    Kind("compliance", CUT, ("compliance",), ("flow/effort",), lambda s: (0.01 * s.size / s.effort,),
         lambda s: ((0.01 * s.size / s.effort,),), True, law=laws.COMPLIANCE, plausible=_positive),
)  # fmt: skip

BANK: Mapping[str, Kind] = {kind.name: kind for kind in (*_SERIES, *_FEEDBACK, *_INSIDE, *_BETWEEN)}


@dataclass(frozen=True)
class BoxEffect:
    """An effect of the bank at a place: the name of an input, an output, a parameter, a port or a cut of the map.

    ``at_rest``: a signal with memory was zero before the record, and not what it was at first. ``signal``: what a
    parameter depends on.
    """

    kind: Kind
    place: str
    scene: Surroundings = field(compare=False, repr=False)
    at_rest: bool = False
    signal: str = ""

    @property
    def label(self) -> str:
        """Return name and place."""
        return f"{self.kind.name}@{self.place}" + (f"({self.signal})" if self.signal else "")

    @property
    def amplitudes(self) -> int:
        """Return in how many of its leading values the response to it is linear."""
        return len(self.kind.parameters) if self.kind.linear else self.kind.amplitudes

    def bounded(self, values: Array) -> Array:
        """Return values no smaller than what the law allows."""
        return np.maximum(values, self.kind.lower) if self.kind.lower else values
