"""The page of ``inspect``: what a record holds, what it would show, and what was assumed."""

from typing import Any

from orchestrator.reporting.model import Badge, Facts, Report, Section, Text
from orchestrator.reporting.pages.record import signal_plots
from orchestrator.reporting.source import ResultDocument
from orchestrator.shared.results import read
from orchestrator.shared.results.fields import fields_table
from orchestrator.shared.results.inspect import InspectFound, inspect_tables

RECORD = "inspect_record.npz"


def build(source: ResultDocument) -> Report:
    """Return the page."""
    results = read(source.results, InspectFound)
    sections: list[Section] = [Text("What the record can show", results.verdict[1:])] if results.verdict[1:] else []
    if results.assumed:
        sections.append(Text("Assumed: put right in the model file", results.assumed))
    sections.append(Text("How the file was read", results.record.notes))
    sections += signal_plots(source.signals(RECORD))
    sections += [_facts(results), *inspect_tables(results)]
    if results.better_experiments:
        sections.append(fields_table("Experiments of the same length, torque and speed", results.better_experiments))
    return Report(
        "Inspection of a record",
        results.verdict[0],
        tuple(sections),
        _badge(results),
        angle_unit=results.record.angle_unit,
    )


def _badge(results: InspectFound) -> tuple[Badge, str]:
    """Return the badge: what was assumed may be wrong, so it is green only where nothing was."""
    smallest, assumed, angles = results.smallest_gap, bool(results.assumed), results.two_angles
    if angles is not None and angles.visible:
        return "warn", "the two angles show a gap"
    if smallest is None:
        return "bad", "shows no gap"
    if assumed:
        return "warn", f"shows gaps from {smallest:.2g} rad on, if the assumptions hold"
    return "good", f"shows gaps from {smallest:.2g} rad on"


def _facts(results: InspectFound) -> Facts:
    record = results.record
    facts: list[tuple[str, Any]] = [
        ("rows", record.rows),
        ("rate [Hz]", 1.0 / record.step),
        ("rows with missing samples", record.missing),
        ("sign changes of the torque", results.reversals.torque),
        ("sign changes of the motor's speed", results.reversals.motor_speed),
    ]
    delay = results.delay
    if delay is not None:
        lag = f"{1e3 * delay.value:.3g} ± {1e3 * delay.standard_error:.2g}"
        facts.append(("lag of the load's angle [ms]", lag))
    return Facts("The record in numbers", tuple(facts))
