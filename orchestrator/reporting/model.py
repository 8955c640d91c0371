"""What a report consists of: small immutable parts that know nothing of HTML."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from orchestrator.shared.results.fields import Cell, ReportTable

Numbers = Sequence[float | None] | NDArray[np.float64]
Badge = Literal["good", "warn", "bad", "neutral"]
Kind = Literal["line", "steps", "points"]
Severity = Literal["error", "warning", "info"]

POINT_LIMIT = 4000


@dataclass(frozen=True)
class Text:
    """Paragraphs."""

    title: str
    paragraphs: tuple[str, ...]


@dataclass(frozen=True)
class Facts:
    """Named values, shown as a list of pairs."""

    title: str
    items: tuple[tuple[str, Cell], ...]


@dataclass(frozen=True)
class Series:
    """One curve or cloud of a plot; ``None`` or NaN leaves a gap.

    Attributes:
        name: as in the legend.
        kind: "line", "steps" (each value held to the next x), or "points".
        low, high: ends of an interval around each y; both or neither.
        labels: words for each point, shown when the reader hovers over it.
    """

    name: str
    x: Numbers
    y: Numbers
    kind: Kind = "line"
    low: Numbers | None = None
    high: Numbers | None = None
    labels: Sequence[str] | None = None


@dataclass(frozen=True)
class Span:
    """A shaded range of x; a moment, drawn as a line, where it ends as it starts."""

    start: float
    end: float
    name: str


@dataclass(frozen=True)
class Plot:
    """A plot in which the reader can hover and zoom."""

    title: str
    x_label: str
    y_label: str
    series: tuple[Series, ...]
    spans: tuple[Span, ...] = ()
    diagonal: bool = False  # draw the line y = x
    log_x: bool = False
    log_y: bool = False
    categories: tuple[str, ...] = ()  # names of x = 0, 1, 2, ... for an axis of named things
    note: str = ""


@dataclass(frozen=True)
class Remark:
    """One problem or remark; ``more`` says where else the same was found, one line each."""

    severity: Severity
    where: str
    text: str
    advice: str = ""
    more: tuple[str, ...] = ()


@dataclass(frozen=True)
class Findings:
    """Problems and remarks, worst first as given."""

    title: str
    items: tuple[Remark, ...]
    empty: str = "Nothing was found."


@dataclass(frozen=True)
class Fold:
    """Sections that are closed at first, under a title that says what they tell; folds hold no folds."""

    title: str
    sections: "tuple[Section, ...]"


Section = Text | Facts | ReportTable | Plot | Findings | Fold


@dataclass(frozen=True)
class Report:
    """A page."""

    title: str  # the page's heading
    summary: str  # the answer, in a sentence or two
    sections: tuple[Section, ...]  # in the order of the page
    badge: tuple[Badge, str] | None = None  # the answer's colour and its word, such as ("good", "3 of 3 FMUs comply")
    origin: tuple[tuple[str, Cell], ...] = ()  # what was run and with what (command, version, seed, arguments)
    # files to hand on with the page; small ones are embedded, others linked beside it
    downloads: tuple[Path, ...] = field(default=())
    angle_unit: str = "rad"  # in which angles are shown first: rad, deg, arcmin or turns
    about: tuple[str, ...] = ()  # what the title says besides: the files that went in, the day, and who made it

    def all_sections(self) -> Iterator[Section]:
        """Yield the sections in the order of the page, those of folds in their place."""
        for section in self.sections:
            yield from section.sections if isinstance(section, Fold) else (section,)

    def plots(self) -> tuple[Plot, ...]:
        """Return the plots in the order of the page."""
        return tuple(section for section in self.all_sections() if isinstance(section, Plot))
