"""The page of any command that has none of its own: facts and tables, as the JSON has them."""

from collections.abc import Mapping, Sequence
from typing import Any

from orchestrator.reporting.model import Facts, Fold, Report, Section
from orchestrator.reporting.source import ResultDocument, plain, table_of, words


def build(source: ResultDocument) -> Report:
    """Return the page."""
    return Report(
        title=source.command.capitalize(),
        summary=f"Results of `{source.command}`.",
        sections=tuple(sections_of("Results", source.results)),
    )


def sections_of(title: str, value: Mapping[str, Any]) -> list[Section]:
    """Return an object's plain values as facts, its lists of objects as tables, its objects as further sections.

    What is absent (null) is left out.
    """
    facts: list[tuple[str, Any]] = []
    further: list[Section] = []
    for name, item in value.items():
        heading = words(name)
        if _is_records(item):
            further.append(table_of(sentence(heading), item))
        elif _is_keyed_records(item):
            further.append(table_of(sentence(heading), [{"name": key, **inner} for key, inner in item.items()]))
        elif isinstance(item, Mapping):
            further += sections_of(sentence(heading), item)
        elif item is not None and not (isinstance(item, Sequence) and not isinstance(item, str) and len(item) > 12):
            facts.append((heading, plain(item)))
    return [*([Facts(title, tuple(facts))] if facts else []), *further]


def folds_of(folds: Mapping[str, Sequence[Section]]) -> list[Section]:
    """Return sections that are closed at first, by title; none that is empty."""
    return [Fold(title, tuple(inside)) for title, inside in folds.items() if inside]


def sentence(text: str) -> str:
    """Return text with a capital first letter, the rest as it is."""
    return text[:1].upper() + text[1:]


def _is_records(item: Any) -> bool:
    return isinstance(item, list) and bool(item) and all(isinstance(entry, Mapping) for entry in item)


def _is_keyed_records(item: Any) -> bool:
    """Whether an object's values are all objects of plain values."""
    return (
        isinstance(item, Mapping)
        and bool(item)
        and all(
            isinstance(v, Mapping) and not any(isinstance(w, (Mapping, list)) for w in v.values())
            for v in item.values()
        )
    )
