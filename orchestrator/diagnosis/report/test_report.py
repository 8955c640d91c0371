"""How the models do on test data: the motion of free runs, and the torque that they leave."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from orchestrator.diagnosis.inference.fitting import fit_model
from orchestrator.diagnosis.report.motion_misfit import motion_misfit, run_misfit
from orchestrator.diagnosis.report.open_test_data import open_test_data
from orchestrator.diagnosis.report.run_signals import RunSignals, run_signals
from orchestrator.diagnosis.report.units import in_metres
from orchestrator.diagnosis.result import TestMisfit, Workings
from orchestrator.diagnosis.settings import DiagnosisSettings
from orchestrator.records.model_file import Model
from orchestrator.records.record import Record

Array = NDArray[np.float64]


def test_signals(workings: Workings) -> list[tuple[Record, RunSignals, int]]:
    """Return the records that hold test data, their signals for free runs, and the first row of the test part.

    Args:
        workings: of the diagnosis.

    Returns:
        One entry for each record.
    """
    balance = workings.balances[0]
    return [
        (record, run_signals(record, len(balance.channels), 3.0 * max(balance.cutoffs)), first)
        for record, first in open_test_data(workings.test_data)
    ]


def misfit_on_test_data(workings: Workings, model: Model, settings: DiagnosisSettings) -> tuple[TestMisfit, ...]:
    """Return the misfit of the nominal, the re-fitted and the final model on test data.

    Args:
        workings: of the diagnosis.
        model: nominal.
        settings: of the report.

    Returns:
        One for each record.
    """
    models = (workings.nominal, workings.base, workings.final)
    unit = "m" if in_metres(model) else "rad"
    return tuple(
        motion_misfit(model.plant, models, signals, first, record.source, unit, settings.report)
        for record, signals, first in test_signals(workings)
    )


def motion_shares(
    workings: Workings, model: Model, test: Sequence[TestMisfit], labels: Sequence[str], settings: DiagnosisSettings
) -> dict[str, float]:
    """Return the share of the misfit on test data that comes back when one effect is left out and the rest re-fitted.

    Args:
        workings: of the diagnosis.
        model: nominal.
        test: misfits of the final model.
        labels: of the effects.
        settings: of the report.

    Returns:
        Label -> one minus final over without, in squares and in units of the noise; nan where runs go astray.
    """
    found, shares = workings.search, {}
    final = sum((one.final / one.noise) ** 2 for record in test for one in record.signals)
    for label in labels:
        without = fit_model(found.problem, found.final.point.without_effects([label]), 3)
        p = workings.balances[0].physical_values(found.problem.record_points(without.point)[0])
        left_out = sum(
            float(np.sum((run_misfit(model.plant, p, signals, first, settings.report) / signals.noise) ** 2))
            for _, signals, first in test_signals(workings)
        )
        shares[label] = 1.0 - final / left_out if np.isfinite(left_out) and left_out > 0.0 else float("nan")
    return shares
