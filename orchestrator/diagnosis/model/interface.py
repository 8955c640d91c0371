"""The narrow interface between any model and the analysis: what is fitted, which effects may be missing, residuals,
noise.
"""

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from orchestrator.records.model_file import ModelParameter
from orchestrator.shared.arrays import Array

Values = tuple[float, ...]


@dataclass(frozen=True)
class UncertainParameter:
    """A parameter that is fitted with every model.

    Attributes:
        nominal: value before the record.
        spread: how far it may be off, as a share: the prior is log-normal with standard deviation ``log(1 + spread)``.
        local: it belongs to one record alone.
        minimum, maximum: limits of the fitted value, which no fit goes beyond.
        scale: of a value that may have either sign, what the fit moves in shares of; the prior is normal with
            standard deviation ``spread`` times that. None: ``nominal`` is, and the value keeps its sign.
        reported: False of what nobody named, such as the state that a record begins with.
    """

    name: str
    nominal: float
    spread: float
    unit: str = ""
    local: bool = False
    minimum: float = -np.inf
    maximum: float = np.inf
    scale: float | None = None
    reported: bool = True

    @property
    def unit_step(self) -> float:
        """Return what the fit moves in shares of, in the unit of the parameter."""
        return self.nominal if self.scale is None else self.scale

    @property
    def deviation(self) -> float:
        """Return the standard deviation of the prior, as a share."""
        return float(np.log1p(self.spread)) if self.scale is None else self.spread

    def limit(self, value: float) -> float:
        """Return a value within the limits, in the unit of the parameter."""
        return min(max(value, self.minimum), self.maximum)

    def stops(self, value: float, way: float) -> bool:
        """Tell whether a value stands at the limit that lies in the direction of the sign of ``way``."""
        return (way > 0.0 and value >= self.maximum) or (way < 0.0 and value <= self.minimum)


def as_uncertain(given: ModelParameter, local: bool = False) -> UncertainParameter:
    """Return what is fitted of a parameter that a model file or a map gives.

    A value at zero, or nearer to it than it may be off where its limits allow either sign, has a normal prior; so has
    one that belongs to one record alone (``local``), such as a start value.
    """
    near = abs(given.value) < given.uncertainty and given.minimum < 0.0 < given.maximum
    if local or near or given.value == 0.0:
        return UncertainParameter(
            given.name, given.value, 1.0, given.unit, local, given.minimum, given.maximum, given.uncertainty
        )
    share = given.uncertainty / abs(given.value)
    return UncertainParameter(given.name, given.value, share, given.unit, False, given.minimum, given.maximum)


@dataclass(frozen=True, eq=False)
class WaveScan:
    """Where the cycles of a wave are looked for: all at once, by the residual's inner products with them.

    Attributes:
        phase: (n,) signal over which the wave repeats.
        channel: of the residual in which it acts.
        coordinate: place of the cycles in the effect's values.
        cycles: grid of cycles, in radians of the wave for each unit of ``phase``.
        through: where it acts on the residuals through a dynamic response: gradient (channels, n) by the residuals ->
            gradient (n,) by what it adds; None: on its channel directly.
    """

    phase: Array
    channel: int
    coordinate: int
    cycles: Array
    through: Callable[[Array], Array] | None = None


@dataclass(frozen=True, eq=False)
class CandidateEffect:
    """An effect that a model may lack, as the analysis sees it.

    Attributes:
        label: ``name@site``.
        kind: what sort of law it is: effects of one kind stand for each other ("friction", "timing", "limit", "wave",
            "constant", "position", "speed", "gap", "resonance", "memory").
        values: names of its values.
        scales: a small change of each.
        starts: values to try; those at ``amplitudes`` are found by regression.
        amplitudes: places of values in which the residual is linear; empty: the effect is tried at each start as it is.
        fitted: places of the values that a fit moves.
        unreported: how many of these are no values of the law, but of its analysis.
        sizes: places of values whose zero is no effect.
        lower, upper: bounds of each value.
        positive: places of amplitudes that must be positive.
        prior: place -> (mean, standard deviation).
        wave: how its cycles are looked for; None: it repeats with nothing.
        comb: times that its best start is looked for anew between the neighbours, each time more finely: an effect that
            acts in steps has so many minima that no derivative leads to its value.
        contains: labels of simpler effects that it stands for, which leave a model that it enters.
        excludes: labels that it is not tried beside.
        takes_drive: it takes torque away from the drive.
        of_log: a property of the log, not of the machine.
    """

    label: str
    kind: str
    values: tuple[str, ...]
    scales: Values
    starts: tuple[Values, ...]
    amplitudes: tuple[int, ...] = ()
    fitted: tuple[int, ...] = ()
    unreported: int = 0
    sizes: tuple[int, ...] = (0,)
    lower: Values = ()
    upper: Values = ()
    positive: tuple[int, ...] = ()
    prior: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    wave: WaveScan | None = None
    comb: int = 0
    contains: tuple[str, ...] = ()
    excludes: tuple[str, ...] = ()
    takes_drive: bool = False
    of_log: bool = False

    @property
    def name(self) -> str:
        """Return the name without the site."""
        return self.label.partition("@")[0]

    @property
    def site(self) -> str:
        """Return the part of the machine at which it acts."""
        return self.label.partition("@")[2]

    def clip_value(self, place: int, value: float) -> float:
        """Return a value within its bounds."""
        low = self.lower[place] if self.lower else -np.inf
        high = self.upper[place] if self.upper else np.inf
        return min(max(value, low), high)


@dataclass(frozen=True)
class ModelPoint:
    """Values of a model: of its uncertain parameters, in order, and of each effect that it has."""

    parameters: Values
    effects: Mapping[str, Values] = field(default_factory=dict)

    @staticmethod
    def nominal(parameters: Sequence["UncertainParameter"]) -> "ModelPoint":
        """Return the nominal values of parameters, those of one record last, without effects."""
        return ModelPoint(tuple(entry.nominal for entry in parameters))

    def with_effect(self, label: str, values: Values) -> "ModelPoint":
        """Return the point with an effect added or moved."""
        return ModelPoint(self.parameters, {**self.effects, label: values})

    def without_effects(self, labels: Sequence[str]) -> "ModelPoint":
        """Return the point without some effects, of which it may lack some."""
        return ModelPoint(self.parameters, {name: v for name, v in self.effects.items() if name not in labels})


@dataclass(frozen=True, eq=False)
class NoiseSources:
    """White sources of noise and how residuals answer to them, at some frequencies.

    Attributes:
        measurement: (f, channels, m) transfer from each encoder's or output's noise to the residuals.
        levels: (m,) one-sided spectral densities of these, as read off the record.
        process: (f, channels, k) transfer from unknown torques or inputs to the residuals.
        floors: (k,) least spectral densities of these.
    """

    measurement: NDArray[np.complex128]
    levels: Array
    process: NDArray[np.complex128]
    floors: Array


@dataclass(frozen=True, eq=False)
class LawArgument:
    """A signal that a torque which no effect explains may follow.

    Attributes:
        site: where the torque then acts.
        unit, torque_unit: of the signal and of the torque.
        values: (n,) of each record.
        respond: of each record: torque (n,) against the motion -> change (channels, n) of the residuals.
        drives: it is the torque that drives. Beside a curve of that, free parameters go with it to nothing, where
            nothing is left either.
    """

    name: str
    site: str
    unit: str
    torque_unit: str
    values: tuple[Array, ...]
    respond: tuple[Callable[[Array], Array], ...]
    drives: bool = False


class ResidualModel(Protocol):
    """A model beside one record.

    Attributes:
        channels: names of the residuals.
        step: sample time [s] of the residuals.
        cutoffs: (channels,) highest frequency [Hz] at which each residual says something.
        parameters: uncertain parameters; local ones last.
        effects: by label, in the order in which they are tried.
        active: (channels, n) weights between zero and one: rows at zero say nothing.
        edges: share of the rows over which the record fades in and out before it is whitened.
    """

    channels: tuple[str, ...]
    step: float
    size: int
    cutoffs: tuple[float, ...]
    parameters: tuple[UncertainParameter, ...]
    effects: Mapping[str, CandidateEffect]
    active: Array
    edges: float

    def residuals(self, points: Sequence[ModelPoint]) -> list[Array]:
        """Return the residuals (channels, n) at each of some points."""

    def noise_sources(self, frequencies: Array) -> NoiseSources:
        """Return what makes noise in the residuals at the nominal values, at frequencies (f,) [Hz]."""

    def approximate_changes(self, point: ModelPoint, trials: Sequence[tuple[str, Values]]) -> list[Array | None]:
        """Return the change (channels, n) of the residuals by each effect that a point lacks.

        None: it is not known without working these out.
        """
        del point
        return [None] * len(trials)

    def is_possible(self, label: str, point: ModelPoint) -> bool:
        """Tell whether a machine can have an effect as a point has it, and the record can show it."""

    def reference_signals(self, point: ModelPoint) -> Array:
        """Return the signals (channels, n) that residuals are compared with: driving torques, or outputs."""

    def inertia_shares(self) -> Mapping[str, float]:
        """Return the inertias that a record must show: name -> share of the whole."""
        return {}

    def without_priors(self, spread: float) -> Self:
        """Return the model as a plain regression of torque on motion, with ``spread`` for that of each parameter."""
        other = copy(self)
        other.parameters = tuple(entry if entry.local else replace(entry, spread=spread) for entry in self.parameters)
        return other
