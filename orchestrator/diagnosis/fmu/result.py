"""What a diagnosis of any FMU says: plain immutable values."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from orchestrator.diagnosis.data.test_data import TestData
from orchestrator.diagnosis.fmu.mapping import Map
from orchestrator.diagnosis.fmu.model import BoxModel, Data
from orchestrator.diagnosis.fmu.probing import Probe
from orchestrator.diagnosis.fmu.problem import BoxProblem
from orchestrator.diagnosis.fmu.residual_model import FmuResiduals
from orchestrator.diagnosis.result import GradedEffect, ParameterEstimate, TestMisfit
from orchestrator.diagnosis.selection.grading import Grade, RecordEvidence
from orchestrator.diagnosis.selection.remaining import Dependence
from orchestrator.diagnosis.selection.search import SearchResult
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.shared.trust import Trust


@dataclass(frozen=True)
class FmuWorkings:
    """What figures and the corrected system need of how a diagnosis was made.

    Attributes:
        test_data: which only the report opens.
        search: problem, steps and models.
        residuals: the FMU beside each record, without its test data.
        probe: what the FMU was found to be.
        nominal, base, final: the three models, as runs of the first record take them.
    """

    test_data: TestData[Data] = field(repr=False)
    search: SearchResult = field(repr=False)
    residuals: tuple[FmuResiduals, ...] = field(repr=False)
    probe: Probe = field(repr=False)
    nominal: BoxModel = field(repr=False)
    base: BoxModel = field(repr=False)
    final: BoxModel = field(repr=False)

    @property
    def problem(self) -> BoxProblem:
        """FMU and first record."""
        return self.residuals[0].problem

    def close(self) -> None:
        """End the FMU's processes."""
        self.problem.runner.close()


@dataclass(frozen=True)
class FmuDiagnosis:
    """The outcome of a diagnosis of any FMU; docs/any-fmu.md says what each word means.

    Attributes:
        verdict: "none", "parameters", "effects" or "unknown".
        effects: around the FMU, surest first.
        parameters: estimates by name.
        left: share of each output's power that no model explains, its noise included.
        remaining: what that follows, strongest first.
        test: misfits on test data.
        record: evidence of the records as a whole.
        trust: how far the corrected model can be trusted.
        notes: what to bear in mind, a sentence each.
        settings: that were used.
        map: that the records were read by.
        workings: how it was made.
    """

    verdict: str
    effects: tuple[GradedEffect, ...]
    parameters: Mapping[str, ParameterEstimate]
    left: Mapping[str, float]
    remaining: tuple[Dependence, ...]
    test: tuple[TestMisfit, ...]
    record: RecordEvidence
    trust: Trust
    notes: tuple[str, ...]
    settings: DiagnosisSettings
    map: Map
    workings: FmuWorkings = field(repr=False)

    def graded(self, least: Grade) -> tuple[GradedEffect, ...]:
        """Return the effects that are at least so sure.

        Args:
            least: grade.

        Returns:
            The effects.
        """
        return tuple(effect for effect in self.effects if effect.grade >= least)
