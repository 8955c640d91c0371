"""The page of a diagnosis of any FMU: what is missing around it, how far the misfit shrinks, what is left."""

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.reporting.model import Badge, Cell, Facts, Picture, Report, Section, Text
from orchestrator.reporting.pages.generic import sections_of
from orchestrator.reporting.source import ResultDocument, table_of, words

VERDICTS: Mapping[str, tuple[Badge, str, str]] = {
    "none": ("good", "nothing is missing", "The FMU explains the record to its noise."),
    "parameters": ("good", "some values are off", "The FMU explains the record once its parameters are re-fitted."),
    "effects": ("neutral", "effects are missing", "Effects attached around the FMU explain the record."),
    "unknown": ("bad", "unexplained", "Something is missing that no effect at an input, an output or a port explains."),
}
MADE = {"walls": "walls", "runs": "runs of the FMU", "seconds": "time taken [s]"}
SHOWN = ("kind", "verdict", "effects", "suspects", "parameters", "misfit", "where", "warnings", "candidates")
PLACED = frozenset((*SHOWN, *MADE, "settings", "delivery", "remainder", "model", "step_cost"))


def build(source: ResultDocument) -> Report:
    """Return the page.

    Args:
        source: results of `diagnose` for any FMU.

    Returns:
        The report.
    """
    results = source.results
    badge, label, sentence = VERDICTS[results["verdict"]]
    sections: list[Section] = []
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
    for title, key in (("Where", "where"), ("Take note", "warnings")):
        if results[key]:
            sections.append(Text(title, tuple(str(text) for text in results[key])))
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
        badge=(badge, label),
        sections=tuple(sections),
        origin=(
            *source.origin(),
            *((name, results[key]) for key, name in MADE.items() if results.get(key) is not None),
        ),
        downloads=source.downloads(),
    )


def _left(remainder: Mapping[str, Any]) -> list[Section]:
    """Return whether noise alone is left."""
    if not remainder:
        return []
    facts: list[tuple[str, Cell]] = [("nothing but measurement noise", remainder["explained"])]
    if remainder.get("disturbance"):
        facts.append(("disturbance, share of the drive [%]", 100.0 * remainder["disturbance"]))
    reasons = [("why it counts as unexplained", "; ".join(remainder["reasons"]))] if remainder.get("reasons") else []
    return [Facts("What is left", (*facts, *reasons))]


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
