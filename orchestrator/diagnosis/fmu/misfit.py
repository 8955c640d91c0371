"""How models of an FMU do on test data: free runs over whole records, and what they miss of their test parts."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.fmu.clock import compared_later
from orchestrator.diagnosis.fmu.model import Data
from orchestrator.diagnosis.fmu.problem import BoxProblem
from orchestrator.diagnosis.fmu.result import FmuWorkings
from orchestrator.diagnosis.model.interface import ModelPoint
from orchestrator.diagnosis.report.open_test_data import open_test_data
from orchestrator.diagnosis.result import SignalMisfit, TestMisfit

Array = NDArray[np.float64]


def test_problems(workings: FmuWorkings) -> list[tuple[BoxProblem, int]]:
    """Return the FMU beside each record that holds test data, and the first row of the test part."""
    problem = workings.problem
    return [
        (replace(problem, data=compared_later(data, problem.late)), first)
        for data, first in open_test_data(workings.test_data)
    ]


def misfit_on_test_data(workings: FmuWorkings) -> tuple[TestMisfit, ...]:
    """Return the misfit of the nominal, the re-fitted and the final model on test data."""
    found, search = [], workings.search
    points = (search.problem.start, search.base.point, search.final.point)
    for number, (problem, first) in enumerate(test_problems(workings)):
        stages = [_misses(workings, point, problem, first, number) for point in points]
        found.append(_misfit(problem, first, stages))
    return tuple(found)


def _misfit(problem: BoxProblem, first: int, stages: Sequence[Array]) -> TestMisfit:
    signals = tuple(
        SignalMisfit(name, problem.units.get(name, ""), float(problem.noise[k]), *(float(one[k]) for one in stages))
        for k, name in enumerate(problem.outputs)
    )
    return TestMisfit(problem.data.source, problem.n - first, signals)


def misfit_on_record(workings: FmuWorkings, data: Data) -> TestMisfit:
    """Return the misfit of the three models on another record, to which nothing was fitted."""
    problem, search = replace(workings.problem, data=compared_later(data, workings.problem.late)), workings.search
    points = (search.problem.start, search.base.point, search.final.point)
    return _misfit(problem, 0, [_misses(workings, point, problem, 0, 0) for point in points])


def stage_runs(workings: FmuWorkings) -> tuple[BoxProblem, dict[str, Array], int]:
    """Return the runs of the three models over the first record as a whole, for figures.

    Returns:
        FMU and record, outputs (n, outputs) by the model's name, and the first row of the test part.
    """
    first = next(((problem, row) for problem, row in test_problems(workings) if row > 0), None)
    problem, row = (workings.problem, workings.problem.n) if first is None else first
    models = {"nominal": workings.nominal, "refitted": workings.base, "corrected": workings.final}
    runs = problem.simulate(list(models.values()))
    empty = np.full(problem.data.outputs.shape, np.nan)
    return problem, {name: empty if y is None else y for name, y in zip(models, runs, strict=True)}, row


def misses_of(workings: FmuWorkings) -> Callable[[ModelPoint], float]:
    """Return what says how much runs of a model miss of the test data.

    Returns:
        A model's values -> the sum of squares over the outputs, in units of their noise.
    """
    problems = test_problems(workings)

    def missed(point: ModelPoint) -> float:
        misses = (
            _misses(workings, point, problem, first, number) / problem.noise
            for number, (problem, first) in enumerate(problems)
        )
        return sum(float(np.sum(one**2)) for one in misses)

    return missed


def _misses(workings: FmuWorkings, point: ModelPoint, problem: BoxProblem, first: int, number: int) -> Array:
    """Return the rms (outputs,) that a run misses from a row on; nan where it fails."""
    fitted = first > 0  # the record's own start is known from the rows before
    residuals = workings.residuals[number if fitted else 0]
    seen = workings.search.problem.record_points(point)[number if fitted else 0]
    y = problem.simulate([residuals.box_model(seen)])[0]
    if y is None:
        return np.full(len(problem.outputs), np.nan)
    if fitted:
        change = residuals.start_change(seen, problem.n).T
        y[: len(change)] += change
    return np.asarray(np.sqrt(np.mean((problem.data.outputs - y)[first:] ** 2, axis=0)))
