"""What results of a diagnosis have in common, be the model ours or any FMU."""

from abc import abstractmethod
from collections.abc import Iterator
from typing import ClassVar

from orchestrator.api.sampled import SampledResult
from orchestrator.api.shown import Block
from orchestrator.diagnosis.report.json_results import misfit_found
from orchestrator.diagnosis.result import DiagnosisOutcome, GradedEffect, TestMisfit
from orchestrator.shared.results.diagnose import misfit_tables, torque_tables
from orchestrator.shared.trust import Trust


class AnyDiagnosisResult(SampledResult):
    """Verdict, effects, misfits, trust and notes of a diagnosis."""

    command: ClassVar[str] = "diagnose"
    digits: ClassVar[int | None] = 9
    diagnosis: DiagnosisOutcome
    validation: TestMisfit | None

    @property
    def verdict(self) -> str:
        """One of "none", "parameters", "effects" and "unknown"."""
        return self.diagnosis.verdict

    @property
    def effects(self) -> tuple[GradedEffect, ...]:
        """The effects that the model misses, surest first: grade, and parameters with intervals and units."""
        return self.diagnosis.effects

    @property
    def test(self) -> tuple[TestMisfit, ...]:
        """Misfits on test data, which nothing was fitted to: of the nominal, the re-fitted and the final model."""
        return self.diagnosis.test

    @property
    def trust(self) -> Trust:
        """How far the corrected model can be trusted."""
        return self.diagnosis.trust

    @property
    def notes(self) -> tuple[str, ...]:
        """What to bear in mind, a sentence each."""
        return self.diagnosis.notes

    @abstractmethod
    def summary(self) -> Iterator[str]:
        """Yield what was found, one sentence a line.

        Yields:
            What is missing, how sure, what it does, what is left and what to do next; notes and trust.
        """

    def _closing_lines(self) -> Iterator[str]:
        yield from (f"Note: {note}" for note in self.notes)
        yield f"Trust: {self.trust.level.word}"
        yield from (f"  {reason}" for reason in self.trust.reasons)

    def _misfit_tables(self) -> Iterator[Block]:
        settings = self.diagnosis.settings
        tests = [misfit_found(test, settings) for test in self.test]
        other = None if self.validation is None else misfit_found(self.validation, settings)
        yield from misfit_tables(tests, other)
        yield from torque_tables([*tests, *([] if other is None else [other])])
