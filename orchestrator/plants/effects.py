"""One row of a bank of effects: its parameters in the plant's table, where a search starts, which values a machine
can have.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pyfmu_sources.parameter_rows import Parameter

Array = NDArray[np.float64]
Starts = Mapping[str, tuple[float, ...]]
Bounds = Mapping[str, tuple[float, float]]


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


def _any_values(values: Mapping[str, float], scales: SignalScales) -> bool:
    del values, scales
    return True


@dataclass(frozen=True)
class Effect:
    """One row of a bank.

    Attributes:
        site: part of the machine at which it acts.
        kind: what sort of law it is; effects of one kind may stand for each other.
        parameters: short name -> name in the plant's table.
        size: the parameter whose zero (or default) switches the effect off.
        scales: signal scales -> short name -> a small change of each parameter.
        starts: signal scales -> short name -> values to try, in all combinations.
        amplitudes: short names of parameters in which the torque balance is linear, found by regression.
        phase: short name of a phase; amplitude and phase are then found together from sine and cosine.
        signed: amplitudes may have either sign.
        bounds: signal scales -> short name -> (least, largest), narrower than the table's.
        priors: signal scales -> short name -> (mean, standard deviation).
        unreported: short name -> name in the plant's table: what is fitted beside its parameters and not reported.
        possible: (values by short name, signal scales) -> whether a machine can have them, and the record can show it;
            ``viscous`` [N.m.s/rad] among the values is the viscous friction that the site has beside them.
        contains: name of the simpler effect at the same site that it stands for.
        both_encoders: it can be seen only with an encoder on either side.
        angular: it makes sense for an angle only, not for a position in metres.
        wave_site: body over whose angle it repeats; "": it does not.
        takes_drive: it takes torque away from the drive.
        memory: it has a state of its own that no encoder shows.
        measurement: it is no physics of the machine but a property of its log.
        rare_torque: it can be only where the torque has rows of its own, rarer than the angles'.
        against: quantity against which its law is drawn: "speed", "angle" within a turn, or "position"; "": none.
    """

    name: str
    site: str
    kind: str
    parameters: dict[str, str]
    size: str
    scales: Callable[[SignalScales], Mapping[str, float]]
    starts: Callable[[SignalScales], Starts] = lambda scales: {}
    amplitudes: tuple[str, ...] = ()
    phase: str = ""
    signed: bool = True
    bounds: Callable[[SignalScales], Bounds] = lambda scales: {}
    priors: Callable[[SignalScales], Bounds] = lambda scales: {}
    unreported: dict[str, str] = field(default_factory=dict)
    possible: Callable[[Mapping[str, float], SignalScales], bool] = _any_values
    contains: str = ""
    both_encoders: bool = False
    angular: bool = False
    wave_site: str = ""
    takes_drive: bool = False
    memory: bool = False
    measurement: bool = False
    rare_torque: bool = False
    against: str = ""

    @property
    def label(self) -> str:
        """Return name and site, unique in a bank."""
        return f"{self.name}@{self.site}"

    def places(self, plant: ParameterTable) -> dict[str, int]:
        """Return the place of each parameter in the plant's tuple by short name, unreported ones last."""
        return {short: plant.index(name) for short, name in (self.parameters | self.unreported).items()}
