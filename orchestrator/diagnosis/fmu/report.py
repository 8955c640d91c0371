"""What is reported of a diagnosis of any FMU: the misfit of its models on test data, and a figure."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from orchestrator.diagnosis.data.records import TestData
from orchestrator.diagnosis.fmu.mapping import Map
from orchestrator.diagnosis.fmu.problem import FmuModel, FmuProblem
from orchestrator.diagnosis.fmu.record import FmuRecord
from orchestrator.diagnosis.fmu.residual_model import FmuResiduals
from orchestrator.diagnosis.fmu.stepping import delay_outputs
from orchestrator.diagnosis.model.interface import ModelPoint
from orchestrator.diagnosis.report.open_test_data import open_test_data
from orchestrator.diagnosis.result import DiagnosisOutcome, SignalMisfit, TestMisfit
from orchestrator.diagnosis.selection.outcome import SearchResult
from orchestrator.shared.arrays import Array

STAGES = ("nominal", "refitted", "corrected")


@dataclass(frozen=True)
class FmuWorkings:
    """What figures and the corrected system need of how a diagnosis was made."""

    test_data: TestData[FmuRecord] = field(repr=False)  # which only the report opens
    search: SearchResult = field(repr=False)  # problem, steps and models
    residuals: tuple[FmuResiduals, ...] = field(repr=False)  # the FMU beside each record, without its test data

    @property
    def problem(self) -> FmuProblem:
        """FMU and first record."""
        return self.residuals[0].problem

    def problem_with(self, data: FmuRecord) -> FmuProblem:
        """Return the FMU beside another record."""
        return replace(self.problem, data=delay_outputs(data, self.problem.late))

    @property
    def points(self) -> tuple[ModelPoint, ...]:
        """Values of the nominal, the re-fitted and the final model."""
        return self.search.problem.start, self.search.base.point, self.search.final.point

    @property
    def models(self) -> tuple[FmuModel, ...]:
        """The three models, as runs of the first record take them."""
        return tuple(self.residuals[0].fmu_model(self.search.problem.record_points(point)[0]) for point in self.points)

    @property
    def final(self) -> FmuModel:
        """The final model."""
        return self.models[-1]

    def close(self) -> None:
        """End the FMU's processes."""
        self.problem.runner.close()


@dataclass(frozen=True)
class FmuDiagnosis(DiagnosisOutcome):
    """The outcome of a diagnosis of any FMU; docs/any-fmu.md says what each word means."""

    map: Map  # that the records were read by
    workings: FmuWorkings = field(repr=False)  # how it was made


def _test_problems(workings: FmuWorkings) -> list[tuple[FmuProblem, int]]:
    """Return the FMU beside each record that holds test data, and the first row of the test part."""
    return [(workings.problem_with(data), first) for data, first in open_test_data(workings.test_data)]


def misfit_on_test_data(workings: FmuWorkings) -> tuple[TestMisfit, ...]:
    """Return the misfit of the nominal, the re-fitted and the final model on test data."""
    return tuple(_misfit(workings, *one, number) for number, one in enumerate(_test_problems(workings)))


def misfit_on_record(workings: FmuWorkings, data: FmuRecord) -> TestMisfit:
    """Return the misfit of the three models on another record, to which nothing was fitted."""
    return _misfit(workings, workings.problem_with(data), 0, 0)


def _misfit(workings: FmuWorkings, problem: FmuProblem, first: int, number: int) -> TestMisfit:
    stages = [_misses(workings, point, problem, first, number) for point in workings.points]
    signals = tuple(
        SignalMisfit(name, problem.units.get(name, ""), float(problem.noise[k]), *(float(one[k]) for one in stages))
        for k, name in enumerate(problem.outputs)
    )
    return TestMisfit(problem.data.source, problem.n - first, signals)


def misses_of(workings: FmuWorkings) -> Callable[[ModelPoint], float]:
    """Return a model's values -> squares that its runs miss of the test data, in units of the outputs' noise."""
    problems = _test_problems(workings)

    def total(point: ModelPoint) -> float:
        misses = (
            _misses(workings, point, problem, first, number) / problem.noise
            for number, (problem, first) in enumerate(problems)
        )
        return sum(float(np.sum(one**2)) for one in misses)

    return total


def _misses(workings: FmuWorkings, point: ModelPoint, problem: FmuProblem, first: int, number: int) -> Array:
    """Return the rms (outputs,) that a run misses from a row on; nan where it fails."""
    fitted = first > 0  # the record's own start is known from the rows before
    residuals = workings.residuals[number if fitted else 0]
    seen = workings.search.problem.record_points(point)[number if fitted else 0]
    y = problem.simulate([residuals.fmu_model(seen)])[0]
    if y is None:
        return np.full(len(problem.outputs), np.nan)
    if fitted:
        change = residuals.start_change(seen, problem.n).T
        y[: len(change)] += change
    return np.asarray(np.sqrt(np.mean((problem.data.outputs - y)[first:] ** 2, axis=0)))


def first_test(workings: FmuWorkings) -> tuple[FmuProblem, int]:
    """Return the first record with a test part, and its first row of that; without one the first record and its end."""
    first = next(((problem, row) for problem, row in _test_problems(workings) if row > 0), None)
    return (workings.problem, workings.problem.n) if first is None else first


def stage_runs(workings: FmuWorkings) -> tuple[FmuProblem, dict[str, Array], int]:
    """Return the first record, outputs (n, outputs) over it by the model's name, and the test part's first row."""
    problem, row = first_test(workings)
    runs = problem.simulate(workings.models)
    empty = np.full(problem.data.outputs.shape, np.nan)
    return problem, {name: empty if y is None else y for name, y in zip(STAGES, runs, strict=True)}, row
