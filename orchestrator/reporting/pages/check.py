"""The page of ``check``: each FMU, and what was found in it."""

from orchestrator.reporting.model import Findings, Remark, Report, Section, Severity
from orchestrator.reporting.source import ResultDocument, plain, words
from orchestrator.shared.results import CheckedFmu, CheckFound, FindingFound, read
from orchestrator.shared.results.fields import ReportTable, TableColumn


def build(source: ResultDocument) -> Report:
    """Return the page."""
    results = read(source.results, CheckFound)
    fmus, counts = results.fmus, results.counts
    good = sum(fmu.ok for fmu in fmus)
    sections: list[Section] = [_overview(fmus), *(_findings(fmu) for fmu in fmus if _new(fmu)), *_facts(fmus)]
    return Report(
        title="FMI compliance check",
        summary=(
            f"{good} of {len(fmus)} FMUs pass. In all: {_count(counts['error'], 'error')}, "
            f"{_count(counts['warning'], 'warning')}, {_count(counts['info'], 'remark')}."
        ),
        badge=("good", "passed") if good == len(fmus) else ("bad", f"{len(fmus) - good} failed"),
        sections=tuple(sections),
        origin=source.origin(),
        downloads=source.downloads(),
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
    facts = list(dict.fromkeys(name for fmu in fmus for name in fmu.facts))
    rows = tuple((_name(fmu), *(plain(fmu.facts.get(name)) for name in facts)) for fmu in fmus)
    columns = (TableColumn("FMU"), *(TableColumn(words(name)) for name in facts))
    return [ReportTable("What they are", columns, rows)] if facts else []


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
