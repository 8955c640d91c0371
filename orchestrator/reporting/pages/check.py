"""The page of ``check``: each FMU, and what was found in it."""

from collections.abc import Mapping
from typing import Any

from orchestrator.reporting.model import Column, Finding, Findings, Report, Section, Severity, Table
from orchestrator.reporting.source import Source, plain, words


def build(source: Source) -> Report:
    """Return the page."""
    fmus: list[Mapping[str, Any]] = list(source.results.get("fmus", []))
    good = sum(bool(fmu["ok"]) for fmu in fmus)
    counts = {s: sum(fmu["counts"][s] for fmu in fmus) for s in ("error", "warning", "info")}
    sections: list[Section] = [_overview(fmus)]
    sections += [_findings(fmu) for fmu in fmus if fmu["findings"]]
    return Report(
        title="FMI compliance check",
        summary=(
            f"{good} of {len(fmus)} FMUs have no error. In all: {_count(counts['error'], 'error')}, "
            f"{_count(counts['warning'], 'warning')}, {_count(counts['info'], 'remark')}."
        ),
        badge=("good", "no errors") if good == len(fmus) else ("bad", _count(counts["error"], "error")),
        sections=tuple(sections),
        origin=source.origin(),
        downloads=source.downloads(),
    )


def _overview(fmus: list[Mapping[str, Any]]) -> Table:
    facts = list(dict.fromkeys(name for fmu in fmus for name in fmu.get("facts", {})))
    columns = ("FMU", "result", "errors", "warnings", "remarks", "executed", *facts)
    rows = tuple(
        (
            _name(fmu),
            "no error" if fmu["ok"] else "errors",
            *(fmu["counts"][s] for s in ("error", "warning", "info")),
            fmu["executed"],
            *(plain(fmu.get("facts", {}).get(name)) for name in facts),
        )
        for fmu in fmus
    )
    return Table("FMUs", tuple(Column(words(c)) for c in columns), rows)


def _findings(fmu: Mapping[str, Any]) -> Findings:
    """Return the findings of an FMU, those of one rule together."""
    alike: dict[tuple[Severity, str, str], list[Mapping[str, Any]]] = {}
    for f in fmu["findings"]:
        alike.setdefault((f["severity"], f["rule"], f.get("advice", "")), []).append(f)
    items = tuple(
        Finding(
            severity,
            f"{rule}  {first['path']}".strip(),
            first["message"],
            advice,
            tuple(f"{f['path']}: {f['message']}" for f in others),
        )
        for (severity, rule, advice), (first, *others) in alike.items()
    )
    return Findings(_name(fmu), items)


def _name(fmu: Mapping[str, Any]) -> str:
    return str(fmu["fmu"]).rstrip("/").rsplit("/", maxsplit=1)[-1]


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}{'' if number == 1 else 's'}"
