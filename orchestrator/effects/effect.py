"""One row of a bank of effects: its parameters, where a search starts, which values a machine can have."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from orchestrator.shared.arrays import Array
from pyfmu_sources.laws.parameter_rows import Parameter

Starts = Mapping[str, tuple[float, ...]]
Bounds = Mapping[str, tuple[float, float]]
DRIVETRAIN, AXIS = "Drivetrain", "ServoAxis"  # plants
BOTH_PLANTS = (DRIVETRAIN, AXIS)


class ParameterTable(Protocol):
    """What an effect asks of the plant that it belongs to."""

    def index(self, name: str) -> int:
        """Return the place of a parameter in the plant's tuple, from 0."""

    def entry(self, place: int) -> Parameter:
        """Return the table row of a parameter."""


@dataclass(frozen=True, eq=False)
class SignalScales:
    """Typical sizes of a record's signals, on which starts and small changes depend."""

    step: float  # sample time of the analysis [s]
    cycle: float  # sample time of the log [s], of the torque's own rows where these are rarer
    cutoff: float  # highest frequency of the balances [Hz]
    requests: Array  # (n,) requested torque [N.m]
    torque: float  # rms of the drive's torque [N.m]
    angles: Mapping[str, Array]  # site -> (n,) angle of the body [rad]
    speeds: Mapping[str, Array]  # site -> (n,) its speed [rad/s]
    resolutions: Mapping[str, float]  # site -> shortest distance [rad] that its encoder shows
    acceleration: float  # rms of the load's acceleration [rad/s2]
    inertia: float  # of the load, or of the only body [kg.m2]
    stiffness: float  # of the shaft [N.m/rad]; 0: there is none
    ratio: float
    twist: Array  # (n,) twist of the shaft [rad]; empty: there is no shaft
    twist_is_measured: bool = True  # by an encoder on either side; else it is that of the nominal model
    angular: bool = True  # positions are angles, not metres
    torque_raster: float = 0.0  # step of the torque's own rows, where they are rarer than the angles' [s]; else 0.0

    def rms_speed(self, site: str) -> float:
        """Return the rms speed [rad/s] of a body."""
        return rms(self.speeds[site])

    def torque_at(self, site: str) -> float:
        """Return the rms of the drive's torque as a body behind the gear feels it [N.m]."""
        return self.torque * (1.0 if site == "motor" else self.ratio)

    @property
    def turns(self) -> float:
        """Return the travel of the motor in revolutions."""
        return float(np.ptp(self.angles["motor"])) / (2.0 * np.pi) + 1e-12

    @property
    def typical_twist(self) -> float:
        """Return the rms of the twist [rad]; 1.0 where there is no shaft."""
        return rms(self.twist) if self.twist.size else 1.0


def rms(values: Array) -> float:
    """Return the root of the mean square of values of any shape, never zero."""
    return float(np.sqrt(np.mean(values * values))) + 1e-300


@dataclass(frozen=True, eq=False)
class PlaceScales:
    """Typical sizes of what happens where an effect would act around an FMU."""

    h: float  # sample time [s]
    size: float  # rms of the signal (at a port: of the effort that drives it)
    peak: float
    signal: Array  # its samples (rows,)
    noise: float = 0.0  # standard deviation of the measurement, for outputs
    position: float = 1.0  # rms of the position about zero; span: from the smallest to the largest
    span: float = 1.0
    speed: float = 1.0  # rms of the speed
    acceleration: float = 1.0
    angular: bool = False  # the position is an angle
    effort: float = 1.0  # rms of what goes through a cut, negative where it acts against the twist
    cycles: tuple[float, ...] = ()  # wavenumbers of ripples over the position, in order, told apart within its span


def _any_values(values: Mapping[str, float], scales: Any) -> bool:
    del values, scales
    return True


@dataclass(frozen=True)
class Effect:
    """One row of a bank. Functions take the scales of a plant's signals, or those of a place around an FMU."""

    name: str
    # part of the machine at which it acts; around an FMU what sort of place: in series at an ``input`` or an
    # ``output``, as feedback at a ``port``, in the value of a ``parameter``, or in a ``cut`` between two FMUs
    site: str
    kind: str  # what sort of law it is; effects of one kind may stand for each other
    # short name -> name in the plant's table; around an FMU its unit, in which "effort", "flow" and "signal" stand for
    # the units at the place where it acts
    parameters: Mapping[str, str]
    size: str  # the parameter whose zero (or default) switches the effect off
    scales: Callable[[Any], Mapping[str, float]]  # scales -> short name -> a small change of each parameter
    # scales -> short name -> values to try, in all combinations; others start at zero or their default
    starts: Callable[[Any], Starts] = lambda scales: {}
    amplitudes: tuple[str, ...] = ()  # short names of parameters in which the response is linear, found by regression
    phase: str = ""  # short name of a phase; amplitude and phase are then found together from sine and cosine
    signed: bool = True  # amplitudes may have either sign
    # scales -> short name -> (least, largest), narrower than the table's
    bounds: Callable[[Any], Bounds] = lambda scales: {}
    priors: Callable[[Any], Bounds] = lambda scales: {}  # scales -> short name -> (mean, standard deviation)
    # short name -> name in the plant's table: what is fitted beside its parameters and not reported
    unreported: Mapping[str, str] = field(default_factory=dict)
    # (values by short name, scales) -> whether a machine can have them, and the record can show it
    possible: Callable[[Mapping[str, float], Any], bool] = _any_values
    contains: str = ""  # name of the simpler effect at the same site that it stands for
    both_encoders: bool = False  # it can be seen only with an encoder on either side
    angular: bool = False  # it makes sense for an angle only, not for a position in metres
    wave_site: str = ""  # body over whose angle it repeats; "": it does not
    takes_drive: bool = False  # it takes torque away from the drive
    memory: bool = False  # it has a state of its own that no encoder shows
    measurement: bool = False  # it is no physics of the machine but a property of its log
    shown: Callable[[Any], bool] = lambda scales: True  # scales -> whether a record can show it at all
    # quantity against which its law is drawn: "speed", "angle" within a turn, or "position"; "": none
    against: str = ""
    law: int = 0  # around an FMU, number of the law of feedback
    remembers: bool = False  # it matters what the signal was before the record
    # scales -> values in order, so close that the best of them leads a fit to the right one: more than an FMU is run
    # for, looked through where it is linear
    scan: Callable[[Any], tuple[float, ...]] = lambda scales: ()
    motion: str = ""  # what it does to the motion, in words of a drive engineer; "": nothing is said
    # names of the plants on which it stands, whose tables have its parameters; around an FMU none count
    plants: tuple[str, ...] = (DRIVETRAIN,)

    @cached_property
    def label(self) -> str:
        """Return name and site, unique in a bank."""
        return f"{self.name}@{self.site}"

    def places(self, plant: ParameterTable) -> dict[str, int]:
        """Return the place of each parameter in the plant's tuple by short name, unreported ones last."""
        return {short: plant.index(name) for short, name in {**self.parameters, **self.unreported}.items()}
