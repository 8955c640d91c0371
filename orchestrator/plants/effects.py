"""What an effect is to a diagnosis: its parameters, what a fit starts from, how large it may be."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pyfmu_sources.drivetrain_parameters import Parameter

Array = NDArray[np.float64]
LEAST_CYCLES = 0.7  # of a wave in the travel: what comes round less than that is told from no spring


class Places(Protocol):
    """What an effect asks of the plant that it belongs to."""

    def index(self, name: str) -> int:
        """Return the place of a parameter in the predictor's tuple.

        Args:
            name: in the plant's table.

        Returns:
            The place, from 0.
        """

    def entry(self, place: int) -> Parameter:
        """Return what is known of the parameter at a place.

        Args:
            place: in the predictor's tuple.

        Returns:
            Name, default, bounds and unit.
        """


@dataclass(frozen=True)
class Scene:
    """What starting values depend on: typical sizes of the record's signals.

    Attributes:
        h: sample time [s].
        torque: rms of the drive's torque [N.m].
        u: (n,) requested torque [N.m].
        speed_m, speed_l: rms speeds [rad/s].
        twist: largest twist of the fitted model [rad].
        inertia: of the load [kg.m2].
        stiffness: of the shaft [N.m/rad].
        ratio: gear ratio.
        turns: travel of the motor in revolutions.
        lowest, highest: angles [rad] between which the load moves.
        cycles: name of a periodic effect -> cycles per revolution at the peaks of its frequency scan.
        angles: (n,) of the load [rad], sample by sample; empty: not known.
        way: 1 or -1: the motor turns that way only; 0: it turns back.
    """

    h: float
    torque: float
    u: Array
    speed_m: float
    speed_l: float
    twist: float
    inertia: float
    stiffness: float
    ratio: float
    turns: float
    lowest: float
    highest: float
    cycles: dict[str, tuple[float, ...]] = field(default_factory=dict)
    angles: Array = field(default_factory=lambda: np.empty(0))
    way: float = 0.0

    @property
    def middle(self) -> float:
        """Return the angle of the load in the middle of its travel [rad]."""
        return 0.5 * (self.lowest + self.highest)


Start = dict[str, tuple[float, ...]]


@dataclass(frozen=True)
class Effect:
    """One row of the bank.

    Attributes:
        name: of the effect, as in the report.
        site: part of the machine at which it acts.
        parameters: short name -> name in the plant's table.
        size: the parameter whose zero (or ``off``) value switches the effect off.
        unit_of_size: scene -> a small amount of ``size``, used for differences and as the scale of the fit.
        starts: scene -> values to try of every parameter that is not found by regression (all combinations).
        amplitudes: short names of parameters in which the response is linear, found by regression.
        phase: short name of a phase; amplitude and phase are then found together from sine and cosine.
        scales: scene -> scale of the other parameters.
        family: effects with the same family look alike when the experiment is poor.
        needs: label of an effect that this one contains; it is tried only when that one pays, from
        refine: (values of that one, scene) -> starting values.
        plausible: values -> False when the fit has left what the effect means.
        bounds: scene -> short name -> (least, largest), narrower than the table's.
        nuisances: parameters of the predictor alone that are fitted with the effect, and not reported as its own.
        priors: scene -> short name -> (mean, standard deviation).
        shape: parameters by which laws of this kind differ; each has a prior, which speaks where a record does not.
        angular: True if it makes sense for an angle only, not for a position in metres.
        both_encoders: True if it can be seen only with an encoder on either side.
        leaves: share of what the effect gains that its law, not being exact, may leave for other effects to gain.
        least_noise: level of process noise, as a share of the drive's torque, below which no model with this effect is
            trusted: impacts amplify what their law leaves out, and a predictor that is hardly corrected goes astray.
        taken_from: short name -> parameter of the plant that holds as much already, if it has been re-fitted: it is
            lowered by as much when the effect is put into a model.
        tries: how many starts, of different values of the first parameter in ``starts``, are fitted in full.
        tolerance: name in the plant's table -> share of its value to which laws of this kind, of which none is exact,
            leave the parameter undefined (standard deviation; measured on records made with other laws).
        against: quantity against which its law is drawn: "speed", "angle" of the load within a turn, its
            "position" over all turns; "": that of its site.
        shared: parameters that another effect may need: they stay as they are when this one is taken out.
        memory: it has a state of its own that no encoder shows: a stretch of a record cannot be begun in its middle.
        measurement: it is no physics of the machine but a property of its log.
    """

    name: str
    site: str
    parameters: dict[str, str]
    size: str
    unit_of_size: Callable[[Scene], float]
    starts: Callable[[Scene], Start] = lambda scene: {}
    amplitudes: tuple[str, ...] = ()
    phase: str = ""
    scales: Callable[[Scene], dict[str, float]] = lambda scene: {}
    family: str = ""
    needs: str = ""
    refine: Callable[[dict[str, float], Scene], tuple[dict[str, float], ...]] = lambda values, scene: ()
    plausible: Callable[[dict[str, float]], bool] = lambda values: True
    bounds: Callable[[Scene], dict[str, tuple[float, float]]] = lambda scene: {}
    both_encoders: bool = False
    angular: bool = False
    nuisances: dict[str, str] = field(default_factory=dict)
    priors: Callable[[Scene], dict[str, tuple[float, float]]] = lambda scene: {}
    shape: tuple[str, ...] = ()
    leaves: float = 0.01
    least_noise: float = 0.0
    taken_from: dict[str, str] = field(default_factory=dict)
    tries: int = 1
    tolerance: dict[str, float] = field(default_factory=dict)
    against: str = ""
    shared: tuple[str, ...] = ()
    memory: bool = False
    measurement: bool = False

    @property
    def label(self) -> str:
        """Return name and site, unique in the bank."""
        return f"{self.name}@{self.site}"

    def put(self, plant: Places, p: Array, values: Mapping[str, float], refitted: Collection[int]) -> Array:
        """Return parameters ``p`` of a model without the effect with ``values`` of it put in, within their bounds.

        ``refitted`` are the places of the plant's own parameters that have been fitted without the effect.

        Args:
            plant: to which the effect belongs.
            p: the predictor's parameters, (n,).
            values: by short name.
            refitted: places of the plant's own parameters that have been fitted without the effect.

        Returns:
            A copy of ``p``.
        """
        moved = p.copy()
        for short, place in self.places(plant).items():
            if short in values:
                entry = plant.entry(place)
                moved[place] = min(max(values[short], entry.minimum), entry.maximum)
                if self._holder(plant, short) in refitted:
                    moved[self._holder(plant, short)] -= moved[place]
        return moved

    def taken_out(self, plant: Places, p: Array, default: Array, refitted: Collection[int]) -> Array:
        """Return parameters ``p`` with the effect switched off, its parameters but shared ones at their ``default``.

        Args:
            plant: to which the effect belongs.
            p: the predictor's parameters, (n,).
            default: the predictor's defaults, (n,).
            refitted: places of the plant's own parameters that have been fitted without the effect.

        Returns:
            A copy of ``p``.
        """
        moved = p.copy()
        for short, place in self.places(plant).items():
            if self._holder(plant, short) in refitted:
                moved[self._holder(plant, short)] += moved[place]
            if short not in self.shared:
                moved[place] = default[place]
        return moved

    def _holder(self, plant: Places, short: str) -> int:
        return plant.index(self.taken_from[short]) if short in self.taken_from else -1

    def places(self, plant: Places) -> dict[str, int]:
        """Return the place of each parameter in the predictor's tuple, by short name, nuisances last.

        Args:
            plant: to which the effect belongs.

        Returns:
            The places, from 0.
        """
        return {short: plant.index(name) for short, name in (self.parameters | self.nuisances).items()}
