"""The one place that reads test data."""

from orchestrator.diagnosis.data.records import R, TestData
from orchestrator.diagnosis.model.torque_balance import TorqueBalance
from orchestrator.diagnosis.report.simulation import RunSignals, run_signals
from orchestrator.records.record import Record


def open_test_data(data: TestData[R]) -> list[tuple[R, int]]:
    """Return each record with the first row of its test part."""
    return list(zip(data._records, data._first_rows, strict=True))


def signals_of_test_data(data: TestData[Record], balance: TorqueBalance) -> list[tuple[Record, RunSignals, int]]:
    """Return the records that hold test data, their signals for free runs, and the first row of the test part."""
    return [(record, signals_for_runs(record, balance), first) for record, first in open_test_data(data)]


def signals_for_runs(record: Record, balance: TorqueBalance) -> RunSignals:
    """Return the signals of a record for free runs, first guesses of speeds up to three times the balance's band."""
    return run_signals(record, len(balance.channels), 3.0 * max(balance.cutoffs))
