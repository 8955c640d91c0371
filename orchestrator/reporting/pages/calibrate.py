"""The page of ``calibrate``: the parameters of an FMU, what the record says of each, and the misfit."""

from orchestrator.reporting.model import Report, Section, Text
from orchestrator.reporting.source import ResultDocument
from orchestrator.reporting.trust import trust_badge, trust_section
from orchestrator.shared.results import read
from orchestrator.shared.results.any_fmu import FmuCalibrationFound, calibration_tables


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
    sections += calibration_tables(found)
    badge = trust_badge(found.trust, label, "good" if found.explained else "bad")
    origin = (("walls", found.walls), ("time taken [s]", found.seconds))
    return Report("Calibration of an FMU", summary, tuple(sections), badge, origin)
