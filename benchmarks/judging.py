"""What is true of a record, and which names of a diagnosis are right, allowed or wrong."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.verdicts import GRADES, NAMED, Outcome

ANY = "*"  # allows every name


@dataclass(frozen=True)
class Truth:
    """What is true of a record. Labels without a site hold for every site.

    Attributes:
        expected: one tuple of labels for each effect that must be named, each label as good as the others.
        allowed: labels that are neither right nor wrong.
        sizes: label -> parameter -> true value, and its own standard error.
        tested: names that the reference could have found; empty: all.
        parameters: true values of the model's own parameters.
    """

    expected: tuple[tuple[str, ...], ...] = ()
    allowed: tuple[str, ...] = ()
    sizes: dict[str, dict[str, tuple[float, float]]] = field(default_factory=dict)
    tested: tuple[str, ...] = ()
    parameters: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Judgement:
    """What of an outcome is right.

    Attributes:
        verdicts: label -> "right", "allowed", "wrong", or "untested" (wrong, but no reference could have found it).
        found: best grade under which each expected effect is named; "": not.
        sizes: (label, parameter, relative error, within the 95 % interval).
        parameters: the same of the model's own parameters, name first.
    """

    verdicts: dict[str, str]
    found: tuple[str, ...]
    sizes: tuple[tuple[str, str, float, bool], ...]
    parameters: tuple[tuple[str, float, bool], ...] = ()


@dataclass(frozen=True)
class Row:
    """One record of a benchmark: which, what was said of it, and what of that is right."""

    key: str
    group: str
    kind: str
    outcome: Outcome
    judgement: Judgement
    hidden: str = ""

    def wrong(self, grades: tuple[str, ...] = NAMED) -> list[str]:
        """Return the wrong labels of some grades.

        Args:
            grades: of the names.

        Returns:
            The labels.
        """
        return [n for n in self.outcome.labels(grades) if self.judgement.verdicts[n] in ("wrong", "untested")]

    def is_false_alarm(self) -> bool:
        """Tell whether a record in which nothing is hidden is said to lack something, if only by possible names."""
        return self.group == "none" and self.outcome.alarms

    def is_right(self) -> bool:
        """Tell whether every expected effect is named at least as likely, and nothing wrong is said."""
        named = all(grade in NAMED for grade in self.judgement.found)
        return named and not self.wrong() and not self.is_false_alarm()


def judge(outcome: Outcome, truth: Truth) -> Judgement:
    """Return what of an outcome is right.

    Args:
        outcome: of a diagnosis.
        truth: of the record.

    Returns:
        The judgement.
    """
    verdicts: dict[str, str] = {}
    found = [""] * len(truth.expected)
    for label, effect in outcome.names.items():
        group = (label, *effect.family)
        hits = [n for n, right in enumerate(truth.expected) if any(_is_among(one, right) for one in group)]
        for n in hits:
            found[n] = min((effect.grade, found[n]), key=_rank)
        if hits:
            verdicts[label] = "right"
        elif ANY in truth.allowed or any(_is_among(one, truth.allowed) for one in group):
            verdicts[label] = "allowed"
        else:
            verdicts[label] = "wrong" if not truth.tested or _is_among(label, truth.tested) else "untested"
    values = tuple(
        (name, one.value / truth.parameters[name] - 1.0, bool(one.low <= truth.parameters[name] <= one.high))
        for name, one in outcome.parameters.items()
        if name in truth.parameters
    )
    return Judgement(verdicts, tuple(found), tuple(_sizes(outcome, truth)), values)


def _rank(grade: str) -> int:
    return GRADES.index(grade) if grade in GRADES else len(GRADES)


def _is_among(label: str, labels: Iterable[str]) -> bool:
    return any(label == one or label.partition("@")[0] == one for one in labels)


def _sizes(outcome: Outcome, truth: Truth) -> Iterable[tuple[str, str, float, bool]]:
    for label, effect in outcome.names.items():
        for known, values in truth.sizes.items():
            if effect.grade not in NAMED or not _is_among(label, (known,)):
                continue
            for name, (value, error) in values.items():
                if name in effect.values:
                    one, reach = effect.values[name], 2.0 * error
                    # A sign may be in the phase.
                    inside = any(one.low - reach <= sign * value <= one.high + reach for sign in (1.0, -1.0))
                    yield label, name, (abs(one.value) - abs(value)) / abs(value), inside


def grade_table(rows: Sequence[Row]) -> str:
    """Return a Markdown table: names of each grade, how many are right, allowed and wrong, and the share that is right.

    Allowed names count in neither direction.

    Args:
        rows: of records.

    Returns:
        The table.
    """
    counts = Counter(
        (effect.grade, row.judgement.verdicts[label]) for row in rows for label, effect in row.outcome.names.items()
    )
    lines = [
        "| grade | names | right | allowed | wrong | of them untested | share right |",
        "|---|---|---|---|---|---|---|",
    ]
    for grade in GRADES:
        right, allowed, untested = (counts[grade, verdict] for verdict in ("right", "allowed", "untested"))
        wrong = counts[grade, "wrong"] + untested
        share = f"{100.0 * right / (right + wrong):.1f} %" if right + wrong else ""
        lines.append(f"| {grade} | {right + allowed + wrong} | {right} | {allowed} | {wrong} | {untested} | {share} |")
    return "\n".join(lines)


def size_line(rows: Sequence[Row]) -> str:
    """Return in words how far sizes are off, and how many of their 95 % intervals hold the true value.

    Args:
        rows: of records.

    Returns:
        The line.
    """
    return _intervals("sizes", [size[2:] for row in rows for size in row.judgement.sizes])


def parameter_line(rows: Sequence[Row]) -> str:
    """Return the same of the model's own parameters.

    Args:
        rows: of records.

    Returns:
        The line.
    """
    return _intervals("parameters", [value[1:] for row in rows for value in row.judgement.parameters])


def _intervals(title: str, values: Sequence[tuple[float, bool]]) -> str:
    if not values:
        return f"{title}: none"
    off, inside = np.abs([value[0] for value in values]), np.array([value[1] for value in values])
    return (
        f"{title}: {len(values)}, off by {100.0 * np.median(off):.1f} % (median), "
        f"{100.0 * np.quantile(off, 0.9):.1f} % (90 %), "
        f"within their 95 % interval {100.0 * inside.mean():.1f} %"
    )


def seconds_line(rows: Sequence[Row]) -> str:
    """Return the processor time of a record in words.

    Args:
        rows: of records.

    Returns:
        The line.
    """
    seconds = [row.outcome.seconds for row in rows]
    return (
        f"processor time of a record: median {np.median(seconds):.1f} s, longest {max(seconds):.1f} s, "
        f"total {sum(seconds):.0f} s"
    )
