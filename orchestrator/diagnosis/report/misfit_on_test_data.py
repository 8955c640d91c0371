"""How the models do on test data: the motion of free runs, and the torque that they leave."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from orchestrator.diagnosis.data.signals import smooth
from orchestrator.diagnosis.inference.fitting import ScoreComparison, compare_residuals, value_covariance
from orchestrator.diagnosis.model.interface import ModelPoint
from orchestrator.diagnosis.model.plant_effects import in_metres
from orchestrator.diagnosis.model.torque_balance import balance_of
from orchestrator.diagnosis.report.free_run import drift_variance, free_runs, run_parts
from orchestrator.diagnosis.report.open_test_data import open_test_data, signals_for_runs, signals_of_test_data
from orchestrator.diagnosis.report.simulation import RunSignals
from orchestrator.diagnosis.result import Diagnosis, SignalMisfit, TestMisfit, Workings
from orchestrator.diagnosis.settings import DiagnosisSettings, ReportSettings
from orchestrator.effects.effect import rms
from orchestrator.plants.description import Plant
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record
from orchestrator.shared.arrays import Array

LEAST_TORQUE_ROWS = 200
LEAST_TRAVEL = 20.0  # in deviations of the noise, from which a test part moves
LEAST_TEST_ROWS = 16  # whitened, about independent: four in each of four blocks


def torque_left(part: Record, workings: Workings, model: Model, settings: DiagnosisSettings) -> tuple[float, ...]:
    """Return the share (rms) of the torque that (nominal, parameters, final) leave at the driven body.

    Empty of two bodies, where the noise of encoders is most of it, and where the part is too short.
    """
    if part.size < LEAST_TORQUE_ROWS or len(model.plant.bodies) > 1:
        return ()
    balance = balance_of(part, model, settings)
    inner = slice(balance.size // 20, -(balance.size // 20))
    shares = []
    for p in (workings.nominal, workings.base, workings.final):
        missing = smooth(balance.balance(p)[0], balance.step, balance.cutoffs[0])[inner]
        shares.append(rms(missing) / rms(balance.drive_torque(p)[inner]))
    return tuple(shares)


def misfit_on_test_data(workings: Workings, model: Model, settings: DiagnosisSettings) -> tuple[TestMisfit, ...]:
    """Return the misfit of the nominal, the re-fitted and the final model on test data."""
    return tuple(
        _misfit(workings, model, record, first, settings) for record, first in open_test_data(workings.test_data)
    )


def _misfit(workings: Workings, model: Model, record: Record, first: int, settings: DiagnosisSettings) -> TestMisfit:
    plant, signals = model.plant, signals_for_runs(record, workings.balances[0])
    nominal, refitted, final = (
        run_misfit(plant, p, signals, first, settings.report) for p in (workings.nominal, workings.base, workings.final)
    )
    parts = run_parts(first, signals.size, settings.report)
    variance = np.mean([np.var(signals.angles[part], axis=0) for part in parts], axis=0)
    explained = 1.0 - final**2 / np.maximum(variance, 1e-300)
    unit = "m" if in_metres(model) else "rad"
    rows = tuple(
        SignalMisfit(
            name, unit, float(signals.noise[n]), float(nominal[n]), float(refitted[n]), float(final[n]),
            float(explained[n]),
        )
        for n, name in enumerate(plant.encoders[: signals.channels])
    )  # fmt: skip
    still = bool(np.all(np.ptp(signals.angles[first:], axis=0) < LEAST_TRAVEL * signals.noise))
    torque = () if still else torque_left(record.part(first, record.size), workings, model, settings)
    return TestMisfit(record.source, signals.size - first, rows, torque, still)


def with_drift(
    test: Sequence[TestMisfit], workings: Workings, model: Model, settings: ReportSettings
) -> tuple[TestMisfit, ...]:
    """Return misfits with how far the uncertainty of the final model's values lets free runs drift, where they miss."""
    moved = _move_values(workings)

    def drifting(misfit: TestMisfit, signals: RunSignals, first: int) -> TestMisfit:
        if not any(signal.is_missed for signal in misfit.signals):
            return misfit
        parts = run_parts(first, signals.size, settings)
        variance = drift_variance(model.plant, workings.final, moved, signals, parts)
        pairs = zip(misfit.signals, np.sqrt(variance).tolist(), strict=True)
        return replace(misfit, signals=tuple(replace(one, drift=drift) for one, drift in pairs))

    records = signals_of_test_data(workings.test_data, workings.balances[0])
    return tuple(drifting(one, signals, first) for one, (_, signals, first) in zip(test, records, strict=True))


def _move_values(workings: Workings) -> list[Array]:
    """Return the final model's values, moved along each axis of their uncertainty by one standard deviation."""
    problem, fitted = workings.search.problem, workings.search.final
    sizes, axes = np.linalg.eigh(value_covariance(fitted))
    moved = []
    for size, axis in zip(sizes, axes.T, strict=True):
        point = problem.move_point(fitted.point, fitted.coordinates, np.sqrt(max(size, 0.0)) * axis)
        moved.append(workings.values_at(point))
    return moved


def misfit_on_record(diagnosis: Diagnosis, record: Record) -> TestMisfit:
    """Return the misfit of a diagnosis's models on another record of the machine, and the torque that each leaves."""
    return _misfit(diagnosis.workings, diagnosis.model, record, 0, diagnosis.settings)


def misses_of(workings: Workings, model: Model, settings: DiagnosisSettings) -> Callable[[ModelPoint], float]:
    """Return a model's values -> squares that its free runs miss of the test data, in units of encoders' noise."""
    parts = signals_of_test_data(workings.test_data, workings.balances[0])

    def misses_at(point: ModelPoint) -> float:
        p = workings.values_at(point)
        misfits = (
            run_misfit(model.plant, p, signals, first, settings.report) / signals.noise for _, signals, first in parts
        )
        return sum(float(np.sum(one**2)) for one in misfits)

    return misses_at


def torque_comparison(
    workings: Workings, test: Sequence[TestMisfit], model: Model, settings: DiagnosisSettings
) -> Callable[[ModelPoint], ScoreComparison | None]:
    """Return what compares models with the final one by the whitened torque that they leave of test data.

    It counts what drifts as unknown torques: unlike free runs it forgets what lies long ago. None: too few rows.
    """
    records = [
        (number, balance_of(record, model, settings), first / record.size)
        for number, ((record, first), misfit) in enumerate(zip(open_test_data(workings.test_data), test, strict=True))
        if not misfit.still
    ]
    if not records:
        return lambda point: None
    _, models, fitted = zip(*records, strict=True)
    found = workings.search
    problem = replace(found.problem, models=models)

    def point_of_test_data(point: ModelPoint) -> ModelPoint:
        own, shared = found.problem.record_points(point), len(problem.shared)
        local: list[float] = []
        for number, balance, share in records:  # of a record that was not fitted nothing is known
            unknown = [entry.nominal for entry in balance.parameters[shared:]]
            local += own[number].parameters[shared:] if share else unknown
        return ModelPoint((*point.parameters[:shared], *local), point.effects)

    problem = problem.reweight(point_of_test_data(found.final.point))
    blocks, rows = problem.blocks_after(fitted)
    if rows.size < LEAST_TEST_ROWS:
        return lambda point: None
    final = problem.whiten_residuals([point_of_test_data(found.final.point)])[0][rows]
    return lambda point: compare_residuals(
        problem.whiten_residuals([point_of_test_data(point)])[0][rows], final, blocks
    )


def run_misfit(plant: Plant, p: Array, signals: RunSignals, first: int, settings: ReportSettings) -> Array:
    """Return the rms (channels,) of free runs over the test part of a record against the measurement."""
    runs = free_runs(plant, p, signals, run_parts(first, signals.size, settings))
    return np.asarray(np.sqrt(np.mean([run.rms**2 for run in runs], axis=0)))
