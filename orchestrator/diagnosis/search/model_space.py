"""The models that a search chooses from: which effects may be added, and which parameters each model fits."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fit.fitting import Fit, Parts
from orchestrator.diagnosis.fit.record_likelihood import RecordLikelihood
from orchestrator.diagnosis.fit.slope import Free
from orchestrator.diagnosis.search.candidate import Candidate
from orchestrator.diagnosis.settings import SearchSettings
from orchestrator.plants.description import Plant
from orchestrator.plants.effects import Effect, Scene
from orchestrator.records.model_file import Model

Array = NDArray[np.float64]

# In one direction dry friction and a constant torque that holds back are the same, and so are viscous friction and its
# difference between the directions: what machines have is tried, and what is not tried stands beside its name.
ALIKE_ONE_WAY = {"load_torque": ("coulomb_friction",)}
TWO_WAYS = ("directional_friction",)


@dataclass
class ModelSpace:
    """The models of one record.

    Attributes:
        likelihood, model, parts: what is searched.
        as_given: the torque counts as it stands in the record: what may change it on its way is not looked for.
        barred: labels of effects that are not looked for.
    """

    likelihood: RecordLikelihood
    model: Model
    parts: Parts
    as_given: bool = field(default=False, kw_only=True)
    barred: frozenset[str] = field(default=frozenset(), kw_only=True)

    @property
    def plant(self) -> Plant:
        """Return the plant that is searched."""
        return self.likelihood.plant

    @property
    def settings(self) -> SearchSettings:
        """Return the settings of the search."""
        return self.likelihood.settings.search

    def eligible(self, current: Candidate) -> Iterable[Effect]:
        """Return the effects that could be added to ``current``.

        Args:
            current: the model to build on.

        Yields:
            Each effect.
        """
        present = {effect.label for effect in current.effects} | self.barred
        replaced = {effect.needs for effect in current.effects}
        one_way = self.one_way
        timed = any(is_of_torques_time(self.plant, effect) for effect in current.effects)
        for effect in self.plant.bank:
            if effect.needs or (effect.angular and in_metres(self.model)):
                continue
            if self.as_given and changes_the_torque(effect):
                continue
            blind = effect.both_encoders and self.likelihood.signals.channels < 2
            alike = one_way and effect.name in TWO_WAYS
            alike = alike or (timed and is_of_torques_time(self.plant, effect))  # early or late, never both
            if effect.label not in present | replaced and not blind and not alike:
                yield effect

    def not_tried(self, effect: Effect) -> tuple[str, ...]:
        """Return the labels of effects that were not tried beside ``effect``, as this record cannot tell them from it.

        Args:
            effect: of the bank.

        Returns:
            The labels.
        """
        kin = [one.label for one in self.plant.bank if effect.name in ALIKE_ONE_WAY.get(one.name, ())]
        return tuple(kin) if kin and self.one_way else ()

    @property
    def one_way(self) -> bool:
        """Tell whether the motor turns in one direction only, in all that may be looked at."""
        return bool(self.likelihood.signals.way(self.parts.seen, self.settings.one_way))

    @property
    def refitted(self) -> list[int]:
        """Return the places of the plant's own parameters that every model re-fits."""
        return [entry.place for entry in self.linear()]

    def linear(self) -> tuple[Free, ...]:
        """Return the uncertain parameters of the model file; a gear ratio cannot be seen from one side.

        Returns:
            Their places, scales, bounds and priors.
        """
        shaft, both = self.plant.shaft, self.likelihood.signals.channels == len(self.plant.bodies)
        unseen = "" if both or shaft is None else shaft.ratio
        return tuple(
            Free(self.plant.index(u.name), u.standard_deviation, u.minimum, u.maximum, (u.value, u.standard_deviation))
            for u in self.model.uncertain
            if u.name != unseen
        )

    def free(self, effects: Sequence[Effect], scene: Scene) -> tuple[Free, ...]:
        """Return the uncertain parameters and those of ``effects``.

        Args:
            effects: of the model.
            scene: sizes of the record's signals.

        Returns:
            Their places, scales, bounds and priors.
        """
        free = list(self.linear())
        taken = {entry.place for entry in free}
        for effect in effects:
            unit, scales = effect.unit_of_size(scene), effect.scales(scene)
            for short, place in effect.places(self.plant).items():
                if place not in taken:  # effects may share one: the stiffness of two end stops
                    taken.add(place)
                    entry = self.plant.entry(place)
                    low, high = effect.bounds(scene).get(short, (entry.minimum, entry.maximum))
                    prior = effect.priors(scene).get(short)
                    free.append(Free(place, scales.get(short, unit), low, high, prior))
        return tuple(free)

    def wrapped(self, p: Array, effect: Effect) -> Array:
        """Return ``p`` with the amplitude of a wave positive, and its phase within half a turn of zero.

        Args:
            p: (parameters,) of the predictor.
            effect: a wave of the bank.

        Returns:
            A copy; the motion is the same.
        """
        places, p = effect.places(self.plant), p.copy()
        size, phase = places[effect.size], places[effect.phase]
        turned = p[phase] + (math.pi if p[size] < 0.0 else 0.0)
        p[size], p[phase] = abs(p[size]), math.remainder(turned, 2.0 * math.pi)
        return p

    def without(self, p: Array, effect: Effect) -> Array:
        """Return ``p`` with one effect switched off.

        Args:
            p: (parameters,) of the predictor.
            effect: of the bank.

        Returns:
            A copy.
        """
        return effect.taken_out(self.plant, p, self.plant.extended(self.model.values), self.refitted)

    def candidate(self, effects: tuple[Effect, ...], fitted: Fit) -> Candidate:
        """Return a fitted model as a candidate.

        Args:
            effects: of the model.
            fitted: its fit.

        Returns:
            The candidate.
        """
        return Candidate(effects, fitted, self.settings)


def is_of_torques_time(plant: Plant, effect: Effect) -> bool:
    """Tell whether an effect says by how much torques act before their stamps, or after them.

    Args:
        plant: the plant.
        effect: of its bank.

    Returns:
        True when it does.
    """
    stamped = effect.measurement and not effect.both_encoders
    return stamped or plant.drive.delay in effect.parameters.values()


def in_metres(model: Model) -> bool:
    """Tell whether the model's position is a length.

    Args:
        model: that the record is compared with.

    Returns:
        True when it is.
    """
    column = model.columns.get("theta_m")
    return column is not None and column.unit in ("m", "mm")


def changes_the_torque(effect: Effect) -> bool:
    """Tell whether an effect changes the torque of the record on its way to the machine.

    Args:
        effect: of a bank.

    Returns:
        True when it does.
    """
    return effect.site in ("actuator", "log")
