"""One row of a bank of effects: its parameters, where a search starts, which values a machine can have."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pyfmu_sources.laws.parameter_rows import Parameter

Array = NDArray[np.float64]
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
    """Typical sizes of a record's signals, on which starts and small changes depend.

    Attributes:
        step: sample time of the analysis [s].
        cycle: sample time of the log [s], of the torque's own rows where these are rarer.
        cutoff: highest frequency of the balances [Hz].
        requests: (n,) requested torque [N.m].
        torque: rms of the drive's torque [N.m].
        angles: site -> (n,) angle of the body [rad].
        speeds: site -> (n,) its speed [rad/s].
        resolutions: site -> shortest distance [rad] that its encoder shows.
        acceleration: rms of the load's acceleration [rad/s2].
        inertia: of the load, or of the only body [kg.m2].
        stiffness: of the shaft [N.m/rad]; 0: there is none.
        twist: (n,) twist of the shaft [rad]; empty: there is no shaft.
        twist_is_measured: by an encoder on either side; else it is that of the nominal model.
        angular: positions are angles, not metres.
        torque_raster: step of the torque's own rows, where they are rarer than the angles' [s]; else 0.0.
    """

    step: float
    cycle: float
    cutoff: float
    requests: Array
    torque: float
    angles: Mapping[str, Array]
    speeds: Mapping[str, Array]
    resolutions: Mapping[str, float]
    acceleration: float
    inertia: float
    stiffness: float
    ratio: float
    twist: Array
    twist_is_measured: bool = True
    angular: bool = True
    torque_raster: float = 0.0

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
    """Typical sizes of what happens where an effect would act around an FMU.

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


def _any_values(values: Mapping[str, float], scales: Any) -> bool:
    del values, scales
    return True


@dataclass(frozen=True)
class Effect:
    """One row of a bank. Functions take the scales of a plant's signals, or those of a place around an FMU.

    Attributes:
        site: part of the machine at which it acts; around an FMU what sort of place: in series at an ``input`` or an
            ``output``, as feedback at a ``port``, in the value of a ``parameter``, or in a ``cut`` between two FMUs.
        kind: what sort of law it is; effects of one kind may stand for each other.
        parameters: short name -> name in the plant's table; around an FMU its unit, in which "effort", "flow" and
            "signal" stand for the units at the place where it acts.
        size: the parameter whose zero (or default) switches the effect off.
        scales: scales -> short name -> a small change of each parameter.
        starts: scales -> short name -> values to try, in all combinations; others start at zero or their default.
        amplitudes: short names of parameters in which the response is linear, found by regression.
        phase: short name of a phase; amplitude and phase are then found together from sine and cosine.
        signed: amplitudes may have either sign.
        bounds: scales -> short name -> (least, largest), narrower than the table's.
        priors: scales -> short name -> (mean, standard deviation).
        unreported: short name -> name in the plant's table: what is fitted beside its parameters and not reported.
        possible: (values by short name, scales) -> whether a machine can have them, and the record can show it.
        contains: name of the simpler effect at the same site that it stands for.
        both_encoders: it can be seen only with an encoder on either side.
        angular: it makes sense for an angle only, not for a position in metres.
        wave_site: body over whose angle it repeats; "": it does not.
        takes_drive: it takes torque away from the drive.
        memory: it has a state of its own that no encoder shows.
        measurement: it is no physics of the machine but a property of its log.
        shown: scales -> whether a record can show it at all.
        against: quantity against which its law is drawn: "speed", "angle" within a turn, or "position"; "": none.
        law: around an FMU, number of the law of feedback.
        remembers: it matters what the signal was before the record.
        scan: scales -> values in order, so close that the best of them leads a fit to the right one: more than an FMU
            is run for, looked through where it is linear.
        motion: what it does to the motion, in words of a drive engineer; "": nothing is said.
        plants: names of the plants on which it stands, whose tables have its parameters; around an FMU none count.
    """

    name: str
    site: str
    kind: str
    parameters: Mapping[str, str]
    size: str
    scales: Callable[[Any], Mapping[str, float]]
    starts: Callable[[Any], Starts] = lambda scales: {}
    amplitudes: tuple[str, ...] = ()
    phase: str = ""
    signed: bool = True
    bounds: Callable[[Any], Bounds] = lambda scales: {}
    priors: Callable[[Any], Bounds] = lambda scales: {}
    unreported: Mapping[str, str] = field(default_factory=dict)
    possible: Callable[[Mapping[str, float], Any], bool] = _any_values
    contains: str = ""
    both_encoders: bool = False
    angular: bool = False
    wave_site: str = ""
    takes_drive: bool = False
    memory: bool = False
    measurement: bool = False
    shown: Callable[[Any], bool] = lambda scales: True
    against: str = ""
    law: int = 0
    remembers: bool = False
    scan: Callable[[Any], tuple[float, ...]] = lambda scales: ()
    motion: str = ""
    plants: tuple[str, ...] = (DRIVETRAIN,)

    @property
    def label(self) -> str:
        """Return name and site, unique in a bank."""
        return f"{self.name}@{self.site}"

    def places(self, plant: ParameterTable) -> dict[str, int]:
        """Return the place of each parameter in the plant's tuple by short name, unreported ones last."""
        return {short: plant.index(name) for short, name in {**self.parameters, **self.unreported}.items()}
