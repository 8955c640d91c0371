"""The one place that reads test data."""

from orchestrator.diagnosis.data.records import R, TestData


def open_test_data(data: TestData[R]) -> list[tuple[R, int]]:
    """Return each record with the first row of its test part."""
    return list(zip(data._records, data._first_rows, strict=True))
