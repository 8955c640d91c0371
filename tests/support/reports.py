"""What tests of report pages share."""

from typing import TypeVar

from orchestrator.reporting import Report

T = TypeVar("T")


def sections(report: Report, kind: type[T]) -> list[T]:
    """Return the sections of one kind, in the order of the page."""
    return [section for section in report.all_sections() if isinstance(section, kind)]
