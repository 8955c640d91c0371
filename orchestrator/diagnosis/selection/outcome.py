"""What a search ends with, and what speaks for each of its effects: plain immutable values."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np

from orchestrator.diagnosis.inference.fitting import FittedModel, ScoreComparison
from orchestrator.diagnosis.inference.problem import FitProblem


@dataclass(frozen=True, eq=False)
class TriedEffect:
    """An effect that was fitted on top of a model."""

    label: str
    comparison: ScoreComparison
    fitted: FittedModel


@dataclass(frozen=True, eq=False)
class SearchStep:
    """A model, what was tried on top of it, and what the final model has of that ("": nothing)."""

    before: FittedModel
    tried: tuple[TriedEffect, ...]  # the effects, by gain
    taken: str = ""  # label of the effect that the final model has
    family: tuple[str, ...] = ()  # labels of those that are not told from it

    @property
    def entry(self) -> TriedEffect | None:
        """Return the effect that was taken."""
        return next((one for one in self.tried if one.label == self.taken), None)


@dataclass(frozen=True, eq=False)
class SearchResult:
    """What the search ended with."""

    problem: FitProblem  # with the whitening and the prior's weight of the final model
    base: FittedModel  # the model with re-fitted parameters alone, as the problem of its own time had it
    final: FittedModel
    alone: tuple[TriedEffect, ...] = ()  # effects that were fitted alone on top of the base, by gain
    # label -> the step that it makes in the final model, with the family that it has there
    reviews: Mapping[str, SearchStep] = field(default_factory=dict)
    # label -> the model of those effects alone that take more than it, and what it does on top of that
    entries: Mapping[str, tuple[FittedModel, TriedEffect]] = field(default_factory=dict)
    searched: bool = False  # whether effects were looked for
    complete: bool = True  # False when time ran out
    # labels of effects that were asked for: they stay, whatever they gain
    asked: frozenset[str] = field(default_factory=frozenset)

    @property
    def steps(self) -> tuple[SearchStep, ...]:
        """Return what was tried on top of re-fitted parameters, then in the place of each effect."""
        taken = next((one.label for one in self.alone if one.label in self.final.labels), "")
        first = (SearchStep(self.base, self.alone, taken),) if self.alone else ()
        return (*first, *self.reviews.values())


class Grade(IntEnum):
    """How sure a name is, the surest last."""

    POSSIBLE = 0
    LIKELY = 1
    CERTAIN = 2

    @property
    def word(self) -> str:
        """The grade in results: "possible", "likely" or "certain"."""
        return self.name.lower()


@dataclass(frozen=True)
class RecordEvidence:
    """What a record says of the final model as a whole."""

    left: float  # share of the torque that is left, of the body where it is largest
    inertia: float  # that the record asks for by itself, in units of the nominal one; 1.0: the model has none
    inertia_error: float  # its standard error, in the same unit
    inertia_spread: float  # how far the model file lets it be off, as a share
    follows: float = 0.0  # share of the squared error of what is left that the strongest curve of one signal takes
    noise: float = 0.0  # share of what is left that is noise
    # largest misfit of free runs on test data, over what noise and the values' uncertainty account for
    missed: float = 0.0

    @property
    def shows_inertia(self) -> bool:
        """Whether the inertia is more than its error."""
        return self.inertia_error <= self.inertia

    @property
    def highest_inertia(self) -> float:
        """The inertia and twice its error, in units of the nominal one."""
        return self.inertia + 2.0 * self.inertia_error

    def inertia_is_off(self, deviations: float) -> bool:
        """Tell whether the inertia and twice its error lie outside so many deviations of the model file."""
        width = deviations * np.log1p(self.inertia_spread)
        lowest = self.inertia - 2.0 * self.inertia_error
        return bool(np.log(max(self.highest_inertia, 1e-6)) < -width or np.log(max(lowest, 1e-6)) > width)


@dataclass(frozen=True)
class EffectEvidence:
    """What speaks for one effect: beside those that take more than it, or beside all others, whichever is more."""

    label: str
    kind: str
    t: float  # paired gain over its standard error
    gain: float  # share of the squared error that it takes of what is left without it
    share: float  # share of the missing torque that it explains: what comes back without it, all of it at most
    size_t: float  # its sizes over their errors
    family: tuple[str, ...]  # labels that the record does not tell from it
    foreign_family: bool  # one of them is of another kind
    possible: bool  # a machine can have such values
    # share of the misfit of free runs on test data that comes back without it; nan: not run
    motion_share: float = np.nan
    # the same of what the torque balance leaves of test data, block by block; None: not worked out
    test_torque: ScoreComparison | None = None
    # free runs of the final model stay by the test data; else they drift, and the torque decides
    runs_hold: bool = True
    asked: bool = False  # it was asked for, and stays in the model whatever its grade
    # of a limit, what is left there over its own torque (rms), if it is more than elsewhere
    left_where_it_acts: float = 0.0


@dataclass(frozen=True)
class Dependence:
    """What is left at a body follows a signal.

    Attributes:
        site: where the torque acts.
        argument_unit, unit: of knots and values.
        knots, values: (k,) of the curve, a torque against the motion.
        errors: (k,) standard errors of the values.
        comparison: gain on blocks left out, and its paired error.
        share: of what is left at the body that it explains.
        formula: of at most two simple terms that run within the band; empty: none does.
    """

    argument: str
    site: str
    argument_unit: str
    unit: str
    knots: tuple[float, ...]
    values: tuple[float, ...]
    errors: tuple[float, ...]
    comparison: ScoreComparison
    share: float
    formula: str = ""

    @property
    def words(self) -> str:
        """Return the dependence as part of a sentence."""
        share = f"{100.0 * self.share:.0f} % of it"
        if self.formula and "x" not in self.formula:
            return f"{share} is a constant, {self.formula} {self.unit}"
        text = f"{share} follows the {self.argument}"
        return text + (f", like {self.formula} with x in {self.argument_unit}" if self.formula else "")
