"""Results as pages that people look at: one self-contained HTML file per result directory. See ``docs/reports.md``."""

from orchestrator.reporting.directory import report_from_directory, write_report
from orchestrator.reporting.model import Facts, Findings, Fold, Plot, Remark, Report, Series, Span, Text
from orchestrator.reporting.page import render
from orchestrator.shared.results.fields import ReportTable, TableColumn

__all__ = [
    "Facts", "Findings", "Fold", "Plot", "Remark", "Report", "ReportTable", "Series", "Span",
    "TableColumn", "Text", "render", "report_from_directory", "write_report",
]  # fmt: skip
