"""What result files say for runs beside the record: the model, and from where on it runs."""

from orchestrator.estimation.protocol import Estimate
from orchestrator.records.record import Record
from orchestrator.shared.results import LiveFound
from pyfmu_sources.drivetrain.equations import PARAMETERS

SPAN = 2.0
"""Seconds after which the fitted model starts anew from the fit: as long as the free runs of a diagnosis."""
LEAST_ROWS = 100
STARTS = ("theta_m_start", "omega_m_start", "theta_l_start", "omega_l_start", "T_m_start")


def live_fitted_model(record: Record, fit: Estimate) -> LiveFound:
    """Return the fitted model, which starts anew from the fitted states every two seconds.

    ``record``: with every sample of its grid, missing ones filled.
    """
    rows = list(range(0, record.size - 1, max(round(SPAN / record.step), LEAST_ROWS)))
    states, p = fit.curves["states"], fit.curves["model"]
    starts = [dict(zip(STARTS, states[row, : len(STARTS)].tolist(), strict=True)) for row in rows]
    values = {
        entry.name: float(value) + (1.0 if entry.name == "backlash_model" else 0.0)
        for entry, value in zip(PARAMETERS, p, strict=True)
        if value != entry.default
    }
    return LiveFound("Drivetrain", record.step, values, rows, starts)
