"""The page of ``calibrate``: the parameters of an FMU, what the record says of each, and the misfit."""

from collections.abc import Mapping
from typing import Any

from orchestrator.reporting.model import Badge, Report, ReportTable, Section, TableColumn, Text
from orchestrator.reporting.source import ResultDocument

Json = Mapping[str, Any]


def build(source: ResultDocument) -> Report:
    """Return the page.

    Args:
        source: results of `calibrate`.

    Returns:
        The report.
    """
    results = source.results
    explained = bool(results["explained"])
    badge: tuple[Badge, str] = ("good", "the parameters explain the record")
    summary = "With these parameters the FMU explains the record to its noise."
    if not explained:
        badge = ("bad", "the parameters do not explain the record")
        summary = "No parameters make the FMU explain the record: something else is missing, so the values are biased."
    sections: list[Section] = []
    if results["warnings"]:
        sections.append(Text("Take note", tuple(f"{str(w)[:1].upper()}{str(w)[1:]}." for w in results["warnings"])))
    sections += [_parameters(results["parameters"]), _misfit(results["misfit"])]
    return Report("Calibration of an FMU", summary, tuple(sections), badge, source.origin(), source.downloads())


def _parameters(parameters: Json) -> ReportTable:
    columns = (
        TableColumn("parameter"),
        TableColumn("nominal", "", 6),
        TableColumn("value", "", 6),
        TableColumn("standard error", "", 3),
        TableColumn("lower", "", 6),
        TableColumn("upper", "", 6),
        TableColumn("unit"),
        TableColumn("learned", "%", 3),
    )
    rows = tuple(
        (name, p["nominal"], p["value"], p["standard_error"], *p["interval"], p["unit"], 100.0 * p["learned"])
        for name, p in parameters.items()
    )
    note = "Lower and upper: ends of the 95 % interval. Learned: how much of its stated uncertainty the record removes."
    return ReportTable("Parameters", columns, rows, note)


def _misfit(misfit: Json) -> ReportTable:
    columns = (TableColumn("output"), TableColumn("nominal"), TableColumn("calibrated"), TableColumn("noise"))
    rows = tuple((name, m["nominal"], m["calibrated"], m["noise"]) for name, m in misfit.items())
    note = "Nominal and calibrated: root mean square of the residual over the noise, on the held-out quarter."
    return ReportTable("Misfit over noise", columns, rows, note)
