"""The page of ``estimate``: the half-gap by each method, the fit behind it, and a proposed experiment."""

from collections.abc import Mapping, Sequence

import numpy as np

from orchestrator.effects.words import list_words, place_words
from orchestrator.reporting.model import Badge, Plot, Report, Section, Series, Text
from orchestrator.reporting.pages.generic import folds_of
from orchestrator.reporting.pages.location import build_location
from orchestrator.reporting.pages.meanings import fitted_parameters
from orchestrator.reporting.pages.record import measured_and_fitted
from orchestrator.reporting.quantities import interval_words
from orchestrator.reporting.source import ResultDocument, words
from orchestrator.reporting.trust import trust_badge, trust_section
from orchestrator.shared.results import TrustFound, read
from orchestrator.shared.results.estimate import (
    EstimateFound,
    ExcitationFound,
    MethodFound,
    methods_table,
)
from orchestrator.shared.results.fields import ReportTable, TableColumn, fields_table

Methods = Mapping[str, MethodFound]
CURVE_POINTS = 121
FLANK_POINTS = 2000
CHI_SQUARE_95 = 3.841458820694124  # of one degree of freedom
UNEXPLAINED = "The model does not explain what was measured"


def build(source: ResultDocument) -> Report:
    """Return the page."""
    results = read(source.results, EstimateFound)
    if results.location is not None:
        return build_location(source, results, results.location)
    found = {name: e for name, e in results.estimates.items() if e.not_applicable is None}
    sections: list[Section] = [*([methods_table("Estimates", found)] if results.estimates else [])]
    sections += [*trust_section(results.trust), *_diagnosis_sections(results), *_remarks(results.estimates)]
    sections += [*_repeats(results), *_flanks(source), *_online(source), *_design(source, results.design or ())]
    diagnostics = results.diagnostics or {}
    fitted = diagnostics.get("parameters")
    sections += folds_of(
        {
            "Measured and fitted": measured_and_fitted(source, "estimate.csv"),
            "How sharp the estimate is": _profile(source, diagnostics.get("profile_limit") or CHI_SQUARE_95),
            "Values of the fit": fitted_parameters(fitted, results.live),
        }
    )
    badge, summary = _answer(results)
    unit = results.record.angle_unit if results.record else "rad"
    return Report("Backlash estimate", summary, tuple(sections), badge, angle_unit=unit)


def _diagnosis_sections(results: EstimateFound) -> list[Section]:
    """Return what the model lacks, or why no diagnosis tells, where it does not explain the records."""
    diagnosis, why = results.diagnosis, results.undiagnosed
    if diagnosis is None:
        return [Text(UNEXPLAINED, (f"No diagnosis was possible: {why}.",))] if why else []
    named = [place_words(e.name, e.site) for e in diagnosis.effects]
    said = f"It lacks {list_words(named)}." if named else f"The diagnosis says: {diagnosis.verdict}."
    place = "The folder diagnosis beside this page has its report and the corrected FMU."
    return [Text(UNEXPLAINED, (said, place))]


def _repeats(results: EstimateFound) -> list[Section]:
    """Return what repeats of one experiment differ by, beside the encoders' noise."""
    repeats = results.repeats
    if repeats is None:
        return []
    noise = (results.diagnostics or {}).get("measurement_noise") or []
    rows = tuple(
        (words(name), value, noise[n] if n < len(noise) else None)
        for n, (name, value) in enumerate(repeats.floor.items())
    )
    columns = (
        TableColumn("signal"),
        TableColumn("what does not repeat", "rad", 3),
        TableColumn("encoder's noise as fitted", "rad", 3),
    )
    note = f"{', '.join(repeats.sources)} have the same torque. No model explains more than they have in common."
    return [ReportTable("Repeats", columns, rows, note)]


def _answer(results: EstimateFound) -> tuple[tuple[Badge, str] | None, str]:
    if results.method is None:
        if results.estimates:
            return ("bad", "no estimate"), "No method can be applied to this record."
        return None, "An excitation that shows the gap."
    alpha, low, high = interval_words(results.alpha, *(results.interval or (None, None)))
    interval = f"with 95 % confidence between {low} and {high} rad"
    record = results.record
    source = f" (record {record.source}, {record.rows} rows)" if record and record.source else ""
    message = results.message or ""
    if not results.visible:
        said = f"{message[:1].upper()}{message[1:]}"
        if "confidence" not in message and results.alpha is not None:
            said = f"No gap is seen: it is {interval}. {said}".strip()
        return trust_badge(results.trust, "no gap is seen"), f"{said}{source}."
    summary = f"The half-gap is {alpha} rad, {interval}{source}."
    return trust_badge(results.trust, "the gap is seen", "good"), " ".join(filter(None, [summary, message]))


def _remarks(estimates: Methods) -> list[Section]:
    """Return what is to be said of single methods: messages, what keeps them from green, why they do not apply."""
    said = []
    for name, e in estimates.items():
        if e.not_applicable is not None:
            said.append(f"{words(name)} does not apply: {e.not_applicable}.")
            continue
        message = e.message or ""
        said += [f"{words(name)}: {message}."] if message else []
        trust = e.trust or TrustFound("")
        reasons = [reason for reason in trust.reasons if reason not in message]
        said += [f"{words(name)} is {trust.level}: {'; '.join(reasons)}."] if reasons else []
    return [Text("Remarks", tuple(text[:1].upper() + text[1:] for text in said))] if said else []


def _profile(source: ResultDocument, limit: float) -> list[Section]:
    """Return the profile; between its points the root of the drop, with its side's sign, is interpolated linearly."""
    table = source.signals("profile.csv")
    if not {"alpha", "drop"} <= set(table):
        return []
    known = np.isfinite(table["alpha"]) & np.isfinite(table["drop"])
    alpha, drop = table["alpha"][known], table["drop"][known]
    signed = np.sign(alpha - alpha[np.argmin(drop)]) * np.sqrt(np.maximum(drop, 0.0))
    fine = np.linspace(signed[0], signed[-1], CURVE_POINTS)
    series = (
        Series("profile", np.interp(fine, signed, alpha).tolist(), (fine**2).tolist()),
        Series("computed", alpha.tolist(), drop.tolist(), "points"),
        Series("95 % limit", [float(alpha[0]), float(alpha[-1])], [limit, limit]),
    )
    note = "Twice the drop of the log-likelihood, maximised over all else. The interval is where it is below the limit."
    if limit != CHI_SQUARE_95:
        note += f" The limit is widened from {CHI_SQUARE_95:.3g}, since the model is not exact."
    return [Plot("Profile likelihood", "half-gap [rad]", "twice the drop", series, note=note)]


def _online(source: ResultDocument) -> list[Section]:
    table = source.signals("online.csv")
    if not {"time", "alpha", "low", "high"} <= set(table):
        return []
    time = table["time"]
    names = {"alpha": "estimate", "low": "lower end (95 %)", "high": "upper end (95 %)"}
    curves = tuple(Series(label, time, table[name]) for name, label in names.items())
    return [Plot("Online estimate", "time [s]", "half-gap [rad]", curves, log_y=True)]


def _flanks(source: ResultDocument) -> list[Section]:
    """Return the load's distance from mid-gap, as two encoders without a torque show it."""
    table = source.signals("flanks.csv")
    if not {"time", "twist", "flank"} <= set(table):
        return []
    every = slice(None, None, max(1, table["time"].size // FLANK_POINTS))
    time, twist, flank = (table[name][every] for name in ("time", "twist", "flank"))
    sides = ((-1.0, "lower flank"), (0.0, "between"), (1.0, "upper flank"))
    series = tuple(
        Series(label, time[flank == side], twist[flank == side], "points")
        for side, label in sides
        if np.any(flank == side)
    )
    note = (
        "The motor's angle over the ratio, less the load's, at the same moment: plus or minus the half-gap at a flank."
    )
    return [Plot("Which flank the teeth touch", "time [s]", "load from mid-gap [rad]", series, note=note)]


def _design(source: ResultDocument, candidates: Sequence[ExcitationFound]) -> list[Section]:
    if not candidates:
        return []
    note = "Best first: the smallest standard error of the half-gap that any estimator can have."
    table = source.signals("design.csv")
    made: list[Section] = [fields_table("Proposed excitations", candidates, note)]
    if {"time", "u"} <= set(table):
        torque = Series("requested torque", table["time"], table["u"], "steps")
        made.append(Plot("The best excitation", "time [s]", "u [N.m]", (torque,)))
    return made
