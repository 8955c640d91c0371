"""What a diagnosis of any FMU says: plain immutable values."""

from dataclasses import dataclass, field

from orchestrator.diagnosis.data.records import TestData
from orchestrator.diagnosis.fmu.mapping import Map
from orchestrator.diagnosis.fmu.model import BoxModel, Data
from orchestrator.diagnosis.fmu.probing import Probe
from orchestrator.diagnosis.fmu.problem import BoxProblem
from orchestrator.diagnosis.fmu.residual_model import FmuResiduals
from orchestrator.diagnosis.result import DiagnosisOutcome
from orchestrator.diagnosis.selection.outcome import SearchResult


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
class FmuDiagnosis(DiagnosisOutcome):
    """The outcome of a diagnosis of any FMU; docs/any-fmu.md says what each word means.

    Attributes:
        map: that the records were read by.
        workings: how it was made.
    """

    map: Map
    workings: FmuWorkings = field(repr=False)
