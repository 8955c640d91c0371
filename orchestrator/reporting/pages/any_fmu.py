"""The page of a diagnosis of any FMU: what is missing around it, how far the misfit shrinks, what is left."""

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.reporting.model import Badge, Cell, Facts, Picture, Report, Section, Text
from orchestrator.reporting.pages.generic import sections_of
from orchestrator.reporting.source import ResultDocument, table_of, words
from orchestrator.reporting.trust import trust_badge, trust_section
from orchestrator.shared.results import TrustFound, read

VERDICTS: Mapping[str, tuple[Badge, str]] = {
    "none": ("good", "nothing is missing"),
    "parameters": ("good", "some values are off"),
    "effects": ("neutral", "effects are missing"),
    "unknown": ("bad", "unexplained"),
}
MADE = {"walls": "walls", "runs": "runs of the FMU", "seconds": "time taken [s]"}
SAID = ("kind", "verdict", "statement", "trust", "where", "warnings")
SHOWN = ("effects", "suspects", "parameters", "misfit", "candidates")
PLACED = frozenset((*SAID, *SHOWN, *MADE, "settings", "delivery", "remainder", "model", "step_cost"))


def build(source: ResultDocument) -> Report:
    """Return the page.

    Args:
        source: results of `diagnose` for any FMU.

    Returns:
        The report.
    """
    results = source.results
    badge, label = VERDICTS[results["verdict"]]
    said = results.get("statement") or label  # files of older versions have none
    sentence = f"{said[:1].upper()}{said[1:]}."
    trust = read(results["trust"], TrustFound) if results.get("trust") else None
    sections: list[Section] = trust_section(trust)
    if results["effects"]:
        rows = [
            {
                "effect": words(effect["name"]),
                "at": effect["site"],
                "parameter": name,
                "value": value["value"],
                "95 % interval": f"{value['interval'][0]:.6g} to {value['interval'][1]:.6g}",
                "unit": value["unit"],
                "not told from": ", ".join(effect["family"]),
            }
            for effect in results["effects"]
            for name, value in effect["parameters"].items()
        ]
        sections.append(table_of("What is missing", rows))
    if results["suspects"]:
        sections.append(Text("Nearest, and not it", tuple(results["suspects"])))
    reasons = () if trust is None else trust.reasons
    for title, key in (("Where", "where"), ("Take note", "warnings")):
        lines = tuple(str(text) for text in results[key] if text not in reasons)
        if lines:
            sections.append(Text(title, lines))
    misfit = [{"output": name, **values} for name, values in results["misfit"].items()]
    sections.append(table_of("Misfit over noise on the held-out quarter", misfit))
    name = "diagnose_signals.png"
    if (source.directory / name).is_file():
        sections.append(Picture("Measured and simulated", source.directory / name, "Shaded: the held-out quarter."))
    parameters = [{"parameter": name, **values} for name, values in results["parameters"].items()]
    if parameters:
        sections.append(table_of("Parameters", parameters))
    tried = [
        {"on top of": ", ".join(step["on_top_of"]) or "parameters", "effect": c["effect"], "gain": c["gain"]}
        for step in results["candidates"]
        for c in step["tried"][:5]
    ]
    if tried:
        sections.append(table_of("Candidates", tried))
    sections += [*_left(results.get("remainder") or {}), *_delivered(results.get("delivery") or ())]
    sections += sections_of("More", {k: v for k, v in results.items() if k not in PLACED})
    found = ", ".join(f"{words(e['name'])} at {e['site']}" for e in results["effects"])
    return Report(
        title="Diagnosis of an FMU",
        summary=f"{sentence} It lacks {found}." if found else sentence,
        badge=trust_badge(trust, label, badge),
        sections=tuple(sections),
        origin=(
            *source.origin(),
            *((name, results[key]) for key, name in MADE.items() if results.get(key) is not None),
        ),
        downloads=source.downloads(),
    )


def _left(remainder: Mapping[str, Any]) -> list[Section]:
    """Return what the final model leaves, in the words of the statement above it."""
    if not remainder:
        return []
    if remainder["explained"]:
        return [Facts("What is left", (("kind", "measurement noise"),))]
    if remainder.get("disturbance"):
        share = ("disturbance, share of the drive [%]", 100.0 * remainder["disturbance"])
        return [Facts("What is left", (("kind", "measurement noise and a disturbance"), share))]
    why: list[tuple[str, Cell]] = [("why", "; ".join(remainder["reasons"]))] if remainder.get("reasons") else []
    return [Facts("What is left", (("kind", "more than noise"), *why))]


def _delivered(files: Sequence[Mapping[str, Any]]) -> list[Section]:
    """Return the corrected system, or why there is none."""
    rows = [
        {
            "file": one.get("file"),
            "effects": ", ".join(part["effect"] for part in one.get("parts") or ()),
            "differs from the fit by [noise]": one.get("difference_over_noise"),
            "note": one.get("note"),
        }
        for one in files
    ]
    return [table_of("Corrected system", rows)] if rows else []
