"""What a diagnosis says: plain immutable values."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from orchestrator.diagnosis.data.records import TestData
from orchestrator.diagnosis.model.interface import ModelPoint
from orchestrator.diagnosis.model.torque_balance import TorqueBalance
from orchestrator.diagnosis.selection.outcome import Dependence, EffectEvidence, Grade, RecordEvidence, SearchResult
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.arrays import Array
from orchestrator.shared.trust import Trust

NOTABLE = 3.0  # times the noise: a misfit of free runs that an engineer sees


@dataclass(frozen=True)
class ValueEstimate:
    """A value with its standard error, 95 % interval and unit."""

    value: float
    standard_error: float
    interval: tuple[float, float]
    unit: str


@dataclass(frozen=True)
class ParameterEstimate(ValueEstimate):
    """The same of a parameter of the model, beside its nominal value."""

    nominal: float


@dataclass(frozen=True)
class GradedEffect:
    """An effect that the model lacks."""

    name: str
    site: str
    grade: Grade  # certain, likely or possible
    lowered_by: tuple[str, ...]  # names of the rules that lowered the grade
    parameters: Mapping[str, ValueEstimate]  # estimate of each parameter, by short name
    evidence: EffectEvidence  # gain, shares and family
    # short name -> (blocks,) its value when each block in turn decides by its share
    block_values: Mapping[str, tuple[float, ...]]
    of_log: bool = False  # a property of the log, not of the machine
    in_model: bool = True  # the corrected model has it

    @property
    def label(self) -> str:
        """Return name and site."""
        return f"{self.name}@{self.site}"


@dataclass(frozen=True)
class Nuisance:
    """A property of the log: a late encoder, an early torque, the gain of the drive."""

    name: str
    grade: Grade  # certain, likely or possible
    parameters: Mapping[str, ValueEstimate]  # estimate of each parameter, by short name
    lowered_by: tuple[str, ...] = ()  # names of the rules that lowered the grade


@dataclass(frozen=True)
class SignalMisfit:
    """Rms of free runs against the measurement of one signal.

    Attributes:
        noise: standard deviation of its noise.
        nominal, parameters, final: rms of the model as given, re-fitted, and with its effects.
        r_squared: of the final model's free runs.
        drift: rms by which the uncertainty of its values lets them drift; worked out where they miss.
    """

    signal: str
    unit: str
    noise: float
    nominal: float
    parameters: float
    final: float
    r_squared: float = float("nan")
    drift: float = 0.0

    @property
    def miss(self) -> float:
        """Misfit of the final model over the noise."""
        return self.final / self.noise

    @property
    def is_missed(self) -> bool:
        """Whether the final model misses the signal by more than its noise, as an engineer sees it."""
        return self.miss > NOTABLE

    @property
    def excess(self) -> float:
        """Misfit of the final model over what noise and the uncertainty of its values account for."""
        return self.final / math.hypot(self.noise, self.drift)

    @property
    def tells(self) -> bool:
        """Whether it is missed by more than these account for."""
        return self.excess > NOTABLE


@dataclass(frozen=True)
class TestMisfit:
    """The misfit on test data of one record."""

    __test__ = False

    source: str
    rows: int  # of its test part
    signals: tuple[SignalMisfit, ...]  # misfit of each encoder
    # (nominal, parameters, final): share of the torque that each leaves; empty: not worked out
    torque: tuple[float, ...] = ()
    still: bool = False  # nothing moves in it: it tests nothing

    def is_worse(self, settings: DiagnosisSettings) -> bool:
        """Tell whether the final model predicts test data worse than re-fitted parameters do.

        Free runs that drift tell little of it; the torque that either leaves decides then, where it is worked out.
        """
        more = np.sqrt(1.0 + settings.grades.confirmed_share)  # in rms
        if self.torque and not self.still and any(one.is_missed for one in self.signals):
            return bool(self.torque[2] > more * self.torque[1])
        before, after = (
            np.array([getattr(one, stage) / one.noise for one in self.signals]) for stage in ("parameters", "final")
        )
        if self.still or not np.all(np.isfinite(before)):
            return False
        may_be = more * np.sqrt(np.mean(before**2)) + settings.report.of_noise
        return not np.sqrt(np.mean(after**2)) <= may_be


@dataclass(frozen=True)
class Workings:
    """What figures and exports need of how a diagnosis was made.

    Attributes:
        records: as they were fitted.
        test_data: which only the report opens.
        search: problem, steps and models.
        balances: torque balances of each record.
        nominal, base, final: parameters of the plant (n,) of the three models.
    """

    records: tuple[Record, ...]
    test_data: TestData[Record] = field(repr=False)
    search: SearchResult = field(repr=False)
    balances: tuple[TorqueBalance, ...] = field(repr=False)
    nominal: Array = field(repr=False)
    base: Array = field(repr=False)
    final: Array = field(repr=False)

    def values_at(self, point: ModelPoint) -> Array:
        """Return the parameters of the plant (n,) of a model of the search."""
        return self.balances[0].physical_values(self.search.problem.record_points(point)[0])


@dataclass(frozen=True)
class DiagnosisOutcome:
    """What a diagnosis of a plant of ours and of any FMU have in common."""

    # "none" (the model explains the record), "parameters" (re-fitted, it does), "effects" (one at least is likely) or
    # "unknown" (something is missing, and nothing is likely)
    verdict: str
    effects: tuple[GradedEffect, ...]  # of the machine, surest first
    parameters: Mapping[str, ParameterEstimate]
    left: Mapping[str, float]  # share of each residual's power that no law explains, by body or output
    remaining: tuple[Dependence, ...]  # what that follows, strongest first
    test: tuple[TestMisfit, ...]  # misfits on test data
    record: RecordEvidence  # evidence of the records as a whole
    trust: Trust  # how far the corrected model can be trusted
    notes: tuple[str, ...]  # what to bear in mind, a sentence each
    settings: DiagnosisSettings
    searched: bool  # effects were looked for

    @property
    def largest_miss(self) -> float:
        """Largest misfit of the final model on test data, over the noise of its signal."""
        return max((signal.miss for test in self.test for signal in test.signals), default=0.0)

    @property
    def misses_test_data(self) -> bool:
        """Whether the final model misses a signal of the test data by more than its noise."""
        return any(signal.is_missed for test in self.test for signal in test.signals)

    def graded(self, least: Grade) -> tuple[GradedEffect, ...]:
        """Return the effects of the machine that are at least so sure."""
        return tuple(effect for effect in self.effects if effect.grade >= least)


@dataclass(frozen=True)
class Diagnosis(DiagnosisOutcome):
    """The outcome of a diagnosis of a plant of ours; docs/diagnosis.md says what each word means."""

    nuisances: tuple[Nuisance, ...]
    # the strongest dependence of what is left, as a curve, where it may be used; None: there is none
    law: Dependence | None
    model: Model  # that the record was compared with
    workings: Workings = field(repr=False)  # how it was made
