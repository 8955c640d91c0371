"""How the models do on test data: the motion of free runs, and the torque that they leave."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.data.signals import smooth
from orchestrator.diagnosis.inference.fitting import ScoreComparison, compare_residuals
from orchestrator.diagnosis.inference.problem import fit_problem
from orchestrator.diagnosis.model.interface import ModelPoint
from orchestrator.diagnosis.model.torque_balance import balance_of
from orchestrator.diagnosis.model.units import in_metres
from orchestrator.diagnosis.report.motion_misfit import motion_misfit, run_misfit
from orchestrator.diagnosis.report.open_test_data import open_test_data
from orchestrator.diagnosis.report.run_signals import RunSignals, run_signals
from orchestrator.diagnosis.result import Diagnosis, TestMisfit, Workings
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.plants.effects import rms
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record

Array = NDArray[np.float64]
LEAST_TORQUE_ROWS = 200


def test_signals(workings: Workings) -> list[tuple[Record, RunSignals, int]]:
    """Return the records that hold test data, their signals for free runs, and the first row of the test part."""
    return [(record, _signals_of(workings, record), first) for record, first in open_test_data(workings.test_data)]


def _signals_of(workings: Workings, record: Record) -> RunSignals:
    balance = workings.balances[0]
    return run_signals(record, len(balance.channels), 3.0 * max(balance.cutoffs))


def torque_left(part: Record, workings: Workings, model: Model, settings: DiagnosisSettings) -> tuple[float, ...]:
    """Return the share of the torque that each model leaves at the driven body: rms of the balance over that of the
    torque.

    Returns:
        (nominal, parameters, final); empty of two bodies, where the noise of encoders
        is most of it, and where the part is too short.
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
    models = (workings.nominal, workings.base, workings.final)
    unit, signals = "m" if in_metres(model) else "rad", _signals_of(workings, record)
    found = motion_misfit(model.plant, models, signals, first, record.source, unit, settings.report)
    if found.still:
        return found
    return replace(found, torque=torque_left(record.part(first, record.size), workings, model, settings))


def misfit_on_record(diagnosis: Diagnosis, record: Record) -> TestMisfit:
    """Return the misfit of a diagnosis's models on another record of the machine, and the torque that each leaves."""
    w, model, settings = diagnosis.workings, diagnosis.model, diagnosis.settings
    return _misfit(w, model, record, 0, settings)


def misses_of(workings: Workings, model: Model, settings: DiagnosisSettings) -> Callable[[ModelPoint], float]:
    """Return what says how much free runs of a model miss of the test data.

    Returns:
        A model's values -> the sum of squares over the encoders, in units of their noise.
    """
    parts = test_signals(workings)

    def missed(point: ModelPoint) -> float:
        p = workings.balances[0].physical_values(workings.search.problem.record_points(point)[0])
        misfits = (
            run_misfit(model.plant, p, signals, first, settings.report) / signals.noise for _, signals, first in parts
        )
        return sum(float(np.sum(one**2)) for one in misfits)

    return missed


def torque_comparison(
    workings: Workings, test: Sequence[TestMisfit], model: Model, settings: DiagnosisSettings
) -> Callable[[ModelPoint], ScoreComparison | None]:
    """Return what compares models with the final one by the whitened torque that they leave of test data.

    Args:
        test: misfits; what lies still is left out.

    Returns:
        A model's values -> how much less the final one leaves; None: the test part is too short to tell.
    """
    parts = [
        record.part(first, record.size)
        for (record, first), misfit in zip(open_test_data(workings.test_data), test, strict=True)
        if record.size - first >= LEAST_TORQUE_ROWS and not misfit.still
    ]
    if not parts:
        return lambda point: None
    found = workings.search
    problem = fit_problem([balance_of(part, model, settings) for part in parts], settings.fit)

    def seen(point: ModelPoint) -> ModelPoint:
        count = len(problem.shared)
        return ModelPoint((*point.parameters[:count], *problem.start.parameters[count:]), point.effects)

    problem = problem.reweighted(seen(found.final.point))
    (final,) = problem.whitened([seen(found.final.point)])

    def compared(point: ModelPoint) -> ScoreComparison:
        return compare_residuals(problem.whitened([seen(point)])[0], final, problem.blocks)

    return compared
