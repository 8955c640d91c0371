"""The page of ``inspect``: what a record holds, what it would show, and what was assumed."""

from typing import Any

from orchestrator.reporting.model import Badge, Facts, Plot, Report, ReportTable, Section, Series, TableColumn, Text
from orchestrator.reporting.pages.record import record_plots
from orchestrator.reporting.source import ResultDocument
from orchestrator.shared.results import read
from orchestrator.shared.results.inspect import InspectFound

RECORD = "inspect_record.npz"


def build(source: ResultDocument) -> Report:
    """Return the page."""
    results = read(source.results, InspectFound)
    sections: list[Section] = [Text("What the record would show", results.verdict)]
    if results.assumed:
        sections.append(Text("Assumed: put right in the model file", results.assumed))
    sections.append(Text("How the file was read", results.record.notes))
    sections += record_plots(source, RECORD)
    sections += _spectrum(results)
    tables = (_excitation(results), _gaps(results), _effects(results))
    sections += [_facts(results), _channels(results), *(t for t in tables if t.rows)]
    sections += _better(results)
    return Report(
        "Inspection of a record",
        results.verdict[0],
        tuple(sections),
        _badge(results),
        source.origin(),
        source.downloads(),
        results.record.angle_unit,
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


def _channels(results: InspectFound) -> ReportTable:
    names = ("channel", "unit", "least", "most", "rounded to", "noise", "at an end [%]", "missing")
    rows = tuple(
        (c.name, c.unit, c.least, c.most, c.count or None, c.noise, 100.0 * c.saturated, c.missing)
        for c in results.channels
    )
    return ReportTable("Channels", tuple(TableColumn(name) for name in names), rows)


def _excitation(results: InspectFound) -> ReportTable:
    columns = (
        TableColumn("band", "Hz"),
        TableColumn("share of the torque's power", "%", 3),
        TableColumn("coherence of the motor"),
    )
    rows = tuple((f"{b.low:g} to {b.high:g}", round(100.0 * b.share, 2), b.coherence) for b in results.excitation)
    return ReportTable(
        "Excitation", columns, rows, "Coherence: how far the motor's motion follows the torque in the band."
    )


def _spectrum(results: InspectFound) -> list[Section]:
    """Return the torque's power by frequency."""
    bands = results.excitation
    if not bands:
        return []
    shares = Series("share of the torque's power", list(range(len(bands))), [100.0 * b.share for b in bands], "bars")
    names = tuple(f"{b.low:g} to {b.high:g}" for b in bands)
    return [Plot("Excitation by frequency", "band [Hz]", "share of the power [%]", (shares,), categories=names)]


def _gaps(results: InspectFound) -> ReportTable:
    columns = (TableColumn("half-gap", "rad"), TableColumn("bound", "rad", 3), TableColumn("seen"))
    rows = tuple((g.half_gap, g.bound, g.seen) for g in results.gaps)
    return ReportTable("Half-gaps that would show", columns, rows, "Bound: the least standard error of any estimator.")


def _effects(results: InspectFound) -> ReportTable:
    rows = tuple((e.name, e.smallest, e.unit) for e in results.effects)
    return ReportTable(
        "Effects that would show",
        (TableColumn("effect"), TableColumn("clearly from", "", 2), TableColumn("unit")),
        rows,
    )


def _better(results: InspectFound) -> list[Section]:
    columns = (
        TableColumn("experiment"),
        TableColumn("bound on the half-gap", "rad", 3),
        TableColumn("peak torque", "N.m"),
        TableColumn("peak motor speed", "rad/s"),
    )
    rows = tuple((b.name, b.bound, b.peak_torque, b.peak_motor_speed) for b in results.better_experiments)
    return [ReportTable("Experiments of the same length, torque and speed", columns, rows)] if rows else []
