"""Results as pages that people look at: one self-contained HTML file per result directory. See ``docs/reports.md``."""

from orchestrator.reporting.directory import report_from_directory, write_report
from orchestrator.reporting.model import (
    Bar,
    Bars,
    Column,
    Facts,
    Finding,
    Findings,
    Picture,
    Plot,
    Report,
    Series,
    Span,
    Table,
    Text,
)
from orchestrator.reporting.page import render

__all__ = [
    "Bar",
    "Bars",
    "Column",
    "Facts",
    "Finding",
    "Findings",
    "Picture",
    "Plot",
    "Report",
    "Series",
    "Span",
    "Table",
    "Text",
    "render",
    "report_from_directory",
    "write_report",
]
