"""What the page shows of a file, in a child process behind walls: the channels of a log, the interface of an FMU.

Of a channel the smallest and the largest value of each stretch of ``STRETCH`` rows are kept, not its rows. A large
log is drawn as far as it is read, and read on: ``SLICE`` seconds a request.
"""

import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import RecordError
from orchestrator.fmi.preview import preview_fmu
from orchestrator.records.columns import Column
from orchestrator.records.formats import open_source
from orchestrator.records.formats.source import RecordSource
from orchestrator.records.formats.text import TextSource
from orchestrator.records.preview import LogPreview, preview_opened, raw_lines
from orchestrator.scenarios.ssp.preview import preview_ssp
from orchestrator.shared.arrays import Array, plain_numbers

STRETCH = 64  # rows
SLICE = 0.1  # s of a request that go into reading on


class CurveShown(msgspec.Struct, frozen=True):
    """A channel in view: stretches of rows, and what is known of all of it.

    Attributes:
        rows: first row of each stretch.
        low, high: its smallest and largest value; None where all are missing.
        least, most: of the channel; None where it has no numbers.
        at_least, at_most: share of its rows that have exactly these values: what is cut off shows there.
        missing: share of its rows without a number.
        whole: whether all rows were read.
        problem: why there is no curve.
    """

    place: int
    rows: tuple[int, ...] = ()
    low: tuple[float | None, ...] = ()
    high: tuple[float | None, ...] = ()
    least: float | None = None
    most: float | None = None
    at_least: float = 0.0
    at_most: float = 0.0
    missing: float = 0.0
    whole: bool = False
    problem: str = ""


class CurvesShown(msgspec.Struct, frozen=True):
    """Curves of channels, the share of the log that was read for them, and the rows that it has."""

    share: float
    rows: int
    curves: tuple[CurveShown, ...]


class LookAsked(msgspec.Struct, frozen=True):
    """What is stated of the columns; the answer is a ``LogPreview``."""

    columns: Mapping[str, Column]
    header: int | None


class InterfaceAsked(msgspec.Struct, frozen=True):
    """What an FMU or SSP file offers; the answer is an ``FmuPreview`` or a ``SystemPreview``."""


class CurvesAsked(msgspec.Struct, frozen=True):
    """Places of channels, first and last row in view, and how many stretches a curve may have; see ``CurvesShown``."""

    places: Annotated[tuple[int, ...], msgspec.Meta(max_length=100)]
    header: int | None = None
    first: Annotated[int, msgspec.Meta(ge=0)] = 0
    last: int = 2**50
    stretches: Annotated[int, msgspec.Meta(ge=1, le=2000)] = 300


class Trace:
    """A channel as stretches of rows."""

    def __init__(self) -> None:
        self._parts: list[tuple[NDArray[np.int64], Array, Array]] = []
        self._rest, self.rows, self.missing = np.zeros(0), 0, 0
        self.least, self.most, self.at_least, self.at_most = np.inf, -np.inf, 0, 0
        self.problem, self.whole = "", False

    def add(self, values: Array) -> None:
        """Take the next rows."""
        self._count(values)
        start = self.rows - self._rest.size
        self.rows += values.size
        self._rest = np.concatenate([self._rest, values])
        whole = self._rest.size // STRETCH * STRETCH
        self._keep(start, self._rest[:whole].reshape(-1, STRETCH))
        self._rest = self._rest[whole:].copy()

    def finish(self) -> None:
        """Take what is left as a stretch of its own."""
        if self._rest.size:
            self._keep(self.rows - self._rest.size, self._rest[None, :])
            self._rest = np.zeros(0)
        self.whole = True

    def _keep(self, start: int, table: Array) -> None:
        starts = start + STRETCH * np.arange(len(table))
        self._parts.append((starts, np.fmin.reduce(table, axis=1), np.fmax.reduce(table, axis=1)))

    def _count(self, values: Array) -> None:
        known = values[~np.isnan(values)]
        self.missing += values.size - known.size
        if not known.size:
            return
        low, high = float(known.min()), float(known.max())
        if low < self.least:
            self.least, self.at_least = low, 0
        if high > self.most:
            self.most, self.at_most = high, 0
        self.at_least += int(np.count_nonzero(known == self.least))
        self.at_most += int(np.count_nonzero(known == self.most))

    def show(self, place: int, first: int, last: int, stretches: int) -> CurveShown:
        """Return what lies in view."""
        if not self._parts:
            return CurveShown(place, whole=self.whole, problem=self.problem)
        starts, low, high = (np.concatenate([part[k] for part in self._parts]) for k in range(3))
        self._parts = [(starts, low, high)]
        begin = max(int(np.searchsorted(starts, first, side="right")) - 1, 0)
        end = int(np.searchsorted(starts, last, side="right"))
        edges, least, most = _reduce(low, high, begin, end, stretches)
        found = self.most >= self.least
        count = max(self.rows, 1)
        return CurveShown(
            place, tuple(starts[edges].tolist()), _plain(least), _plain(most),
            self.least if found else None, self.most if found else None,
            self.at_least / count if self.whole else 0.0, self.at_most / count if self.whole else 0.0,
            self.missing / count if self.whole else 0.0, self.whole, self.problem,
        )  # fmt: skip


def _reduce(low: Array, high: Array, begin: int, end: int, stretches: int) -> tuple[NDArray[np.int64], Array, Array]:
    """Return where at most so many parts of [begin, end) begin, and the smallest and largest value of each."""
    edges = np.unique(np.linspace(begin, max(end, begin), stretches + 1).astype(np.int64)[:-1])
    if end <= begin:
        return edges[:0], low[:0], high[:0]
    return edges, np.fmin.reduceat(low[:end], edges), np.fmax.reduceat(high[:end], edges)


def _plain(values: Array) -> tuple[float | None, ...]:
    return tuple(plain_numbers(values, 7))


class LogReader:
    """A log that was opened for the page."""

    def __init__(self, path: Path) -> None:
        self._path, self._lines = path, raw_lines(path)
        self._files = ExitStack()
        self._source: RecordSource | None = None
        self._header: int | None = None
        self._forget()

    def _forget(self) -> None:
        self._traces: dict[int, Trace] = {}
        self._pass: Iterator[float] | None = None
        self._share = 1.0

    def answer(self, asked: Any) -> Any:
        """Answer a request of the page."""
        if isinstance(asked, LookAsked):
            return self._look(asked)
        return self._curves(asked)

    def _open(self, header: int | None) -> RecordSource:
        if self._source is None or header != self._header:
            self._files.close()
            self._forget()
            self._source, self._header = None, header
            self._source = self._files.enter_context(open_source(self._path, header, apart=False))
        return self._source

    def _look(self, asked: LookAsked) -> LogPreview:
        return preview_opened(lambda: self._open(asked.header), self._path, asked.columns, asked.header, self._lines)

    def _curves(self, asked: CurvesAsked) -> CurvesShown:
        source = self._open(asked.header)
        heads, stretches = source.heads, asked.stretches
        places = [place for place in asked.places if 0 <= place < len(heads) and heads[place].kind == "number"]
        unread = [place for place in places if place not in self._traces]
        if self._pass is None and unread:
            self._pass, self._share = self._read(source, unread), 0.0
        self._read_on()
        shown = {}
        for place in places:
            shown[place] = self._traces.get(place, Trace()).show(place, asked.first, asked.last, stretches)
        close = [n for n, one in shown.items() if one.whole and 0 < self._rows_in_view(n, asked) < STRETCH * stretches]
        for group in _groups(source, close):
            shown |= _closer(shown, source, group, asked)
        rows = max((trace.rows for trace in self._traces.values()), default=0)
        return CurvesShown(self._share, rows, tuple(shown.values()))

    def _rows_in_view(self, place: int, asked: CurvesAsked) -> int:
        """Return how many rows of a channel that was read lie in view."""
        return min(self._traces[place].rows, asked.last + 1) - asked.first

    def _read(self, source: RecordSource, places: list[int]) -> Iterator[float]:
        """Read channels to their end; yield the share that is done, piece by piece."""
        groups = _groups(source, places)
        for n, group in enumerate(groups):
            traces = {place: Trace() for place in group}
            self._traces |= traces
            try:
                for first, count, values in source.pieces(group):
                    for place, part in zip(group, values, strict=True):
                        traces[place].add(part)
                    yield (n + first / max(count, 1)) / len(groups)
            except RecordError as error:
                for trace in traces.values():
                    trace.problem = str(error)
            for trace in traces.values():
                trace.finish()

    def _read_on(self) -> None:
        end = time.monotonic() + SLICE
        while self._pass is not None and time.monotonic() < end:
            self._share = next(self._pass, 1.0)
            if self._share == 1.0:
                self._pass = None


def _groups(source: RecordSource, places: list[int]) -> list[list[int]]:
    """Return which channels are read together: those of a text, whose rows are passed through once."""
    together = isinstance(source, TextSource)
    return [places] if together and places else [[place] for place in places]


def _closer(
    shown: Mapping[int, CurveShown], source: RecordSource, places: list[int], asked: CurvesAsked
) -> dict[int, CurveShown]:
    """Return curves of the rows themselves, which are few in view."""
    part = source.within(slice(asked.first, asked.last + 1), source.heads[places[0]].raster)
    pieces = [values for _, _, values in part.pieces(places)]
    found = {}
    for n, place in enumerate(places):
        values = np.concatenate([np.zeros(0), *(piece[n] for piece in pieces)])
        edges, low, high = _reduce(values, values, 0, values.size, asked.stretches)
        if edges.size:
            rows = tuple((asked.first + edges).tolist())
            found[place] = msgspec.structs.replace(shown[place], rows=rows, low=_plain(low), high=_plain(high))
    return found


def reader(folder: str) -> Callable[[tuple[str, Any]], Any]:
    """Return what answers requests, in the child: the name of a log in its folder, and what is asked of it.

    What the first log needs is imported here, while nobody waits.
    """
    opened: dict[str, LogReader] = {}
    Path("warm.csv").write_text("time [s],u [N.m],theta_m [rad]\n" + "0.0,1,2\n0.1,3,4\n" * 30)
    LogReader(Path("warm.csv")).answer(LookAsked({}, None))
    os.chdir(folder)  # logs go by their names, in messages too

    def answer(request: tuple[str, Any]) -> Any:
        name, asked = request
        if isinstance(asked, InterfaceAsked):
            return preview_ssp(Path(name)) if name.lower().endswith(".ssp") else preview_fmu(Path(name))
        if name not in opened:
            opened[name] = LogReader(Path(name))
        return opened[name].answer(asked)

    return answer
