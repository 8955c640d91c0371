"""The page of ``check``: each FMU, and what was found in it."""

from orchestrator.reporting.model import Facts, Findings, Fold, Remark, Report, Section, Severity
from orchestrator.reporting.source import ResultDocument, plain, words
from orchestrator.shared.results import CheckedFmu, CheckFound, FindingFound, read
from orchestrator.shared.results.fields import ReportTable, TableColumn

HASH = "sha256"


def build(source: ResultDocument) -> Report:
    """Return the page."""
    results = read(source.results, CheckFound)
    fmus, counts = results.fmus, results.counts
    good = sum(fmu.ok for fmu in fmus)
    findings = (_findings(fmu) for fmu in fmus if _new(fmu))
    sections: list[Section] = [_overview(fmus), *findings, *_facts(fmus), *_unrun(fmus)]
    return Report(
        title="FMI compliance check",
        summary=(
            f"{good} of {len(fmus)} FMUs pass. In all: {_count(counts['error'], 'error')}, "
            f"{_count(counts['warning'], 'warning')}, {_count(counts['info'], 'remark')}."
        ),
        badge=("good", "passed") if good == len(fmus) else ("bad", f"{len(fmus) - good} failed"),
        sections=tuple(sections),
    )


def _overview(fmus: list[CheckedFmu]) -> ReportTable:
    columns = (
        *("FMU", "result", "errors", "warnings", "remarks", "executed"),
        *("rules passed", "rules failed", "rules not run"),
    )
    rows = tuple(
        (
            _name(fmu),
            "passed" if fmu.ok else "failed",
            *(fmu.counts[s] for s in ("error", "warning", "info")),
            f"no: {fmu.not_executed}" if fmu.not_executed else fmu.executed,
            *(sum(rule.outcome == outcome for rule in fmu.rules) for outcome in ("passed", "failed", "not run")),
        )
        for fmu in fmus
    )
    return ReportTable("FMUs", tuple(TableColumn(c) for c in columns), rows)


def _facts(fmus: list[CheckedFmu]) -> list[Section]:
    """Return what the FMUs say of themselves, and the walls that they ran behind."""
    facts = list(dict.fromkeys(name for fmu in fmus for name in fmu.facts if name != HASH))
    rows = tuple((_name(fmu), *(plain(fmu.facts.get(name)) for name in facts)) for fmu in fmus)
    columns = (TableColumn("FMU"), *(TableColumn(words(name)) for name in facts))
    hashes = tuple((_name(fmu), plain(fmu.facts[HASH])) for fmu in fmus if HASH in fmu.facts)
    return [
        *([ReportTable("What they are", columns, rows)] if facts else []),
        *([Facts("SHA-256 of the files", hashes)] if hashes else []),
    ]


def _unrun(fmus: list[CheckedFmu]) -> list[Section]:
    """Return the rules that were not run, with the reason and the FMUs."""
    found: dict[tuple[str, str], list[str]] = {}
    for fmu in fmus:
        for rule in fmu.rules:
            if rule.outcome == "not run":
                found.setdefault((rule.rule, rule.reason), []).append(_name(fmu))
    if not found:
        return []
    rows = tuple((*why, "all" if len(names) == len(fmus) else ", ".join(names)) for why, names in sorted(found.items()))
    columns = (TableColumn("rule"), TableColumn("why"), TableColumn("FMUs"))
    return [Fold("Rules that were not run", (ReportTable("Rules and reasons", columns, rows),))]


def _findings(fmu: CheckedFmu) -> Findings:
    """Return the findings of an FMU, those of one rule together."""
    alike: dict[tuple[Severity, str, str], list[FindingFound]] = {}
    for f in _new(fmu):
        alike.setdefault((f.severity, f.rule, f.advice), []).append(f)
    items = tuple(
        Remark(
            severity,
            f"{rule}  {first.path}".strip(),
            first.message,
            advice,
            tuple(f"{f.path}: {f.message}" for f in others),
        )
        for (severity, rule, advice), (first, *others) in alike.items()
    )
    return Findings(_name(fmu), items)


def _new(fmu: CheckedFmu) -> list[FindingFound]:
    return [f for f in fmu.findings if not f.known]


def _name(fmu: CheckedFmu) -> str:
    return fmu.fmu.rstrip("/").rsplit("/", maxsplit=1)[-1]


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}{'' if number == 1 else 's'}"
