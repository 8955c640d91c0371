"""The page of ``calibrate``: the parameters of an FMU, what the record says of each, and the misfit."""

from orchestrator.reporting.model import Report, ReportTable, Section, TableColumn, Text
from orchestrator.reporting.source import ResultDocument
from orchestrator.reporting.trust import trust_badge, trust_section
from orchestrator.shared.results import read
from orchestrator.shared.results.any_fmu import FmuCalibrationFound


def build(source: ResultDocument) -> Report:
    """Return the page."""
    found = read(source.results, FmuCalibrationFound)
    label = "the parameters explain the record"
    summary = "With these parameters the FMU explains the record to its noise."
    if not found.explained:
        label = "the parameters do not explain the record"
        summary = "No parameters make the FMU explain the record: something else is missing, so the values are biased."
    sections: list[Section] = trust_section(found.trust)
    reasons = () if found.trust is None else found.trust.reasons
    notes = tuple(f"{text[:1].upper()}{text[1:]}." for text in found.notes if text not in reasons)
    if notes:
        sections.append(Text("Take note", notes))
    sections += [_parameters(found), _misfit(found)]
    badge = trust_badge(found.trust, label, "good" if found.explained else "bad")
    origin = source.origin(("walls", found.walls), ("time taken [s]", found.seconds))
    return Report("Calibration of an FMU", summary, tuple(sections), badge, origin, source.downloads())


def _parameters(results: FmuCalibrationFound) -> ReportTable:
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
        (
            name,
            p.nominal,
            p.value,
            p.standard_error,
            *(p.interval or (None, None)),
            p.unit,
            None if p.learned is None else 100.0 * p.learned,
        )
        for name, p in results.parameters.items()
    )
    note = "Lower and upper: ends of the 95 % interval. Learned: how much of its stated uncertainty the record removes."
    return ReportTable("Parameters", columns, rows, note)


def _misfit(results: FmuCalibrationFound) -> ReportTable:
    columns = tuple(TableColumn(head) for head in ("record", "output", "nominal", "calibrated", "noise", "unit"))
    rows = tuple(
        (test.source, name, m.nominal, m.final, m.noise, m.unit)
        for test in results.test
        for name, m in test.misfit.items()
    )
    note = "Nominal and calibrated: root mean square that runs miss on test data, to which nothing was fitted."
    return ReportTable("Misfit on test data", columns, rows, note)
