"""Continuous loops with events to a tolerance: windows that end at events, with rollback and error control.

The error of a window is estimated as in ``adaptive``, by sweeping it as a whole and then its two halves, which are
kept. Slaves say themselves where their events are, so that nothing is bisected: a window ends there, all slaves go
through the event together, and the next window begins with what they show then.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import ConvergenceError, SlaveError
from orchestrator.master.adaptive import (
    GROW,
    check_adaptive,
    largest_difference,
    next_length,
    source_nodes,
    window_end,
)
from orchestrator.master.algorithms import Adaptive
from orchestrator.master.event_stage import slack
from orchestrator.master.event_sweeps import BRIEF, Sweeper, Swept, UnsettledError
from orchestrator.master.events import EventIteration
from orchestrator.master.protocol import RunEndedError, StepDiscardedError
from orchestrator.master.result import Statistics
from orchestrator.master.rollback import rollback
from orchestrator.master.signals import Signal
from orchestrator.master.tracks import JoinedTracks, Track
from orchestrator.master.wiring import Stage, gather
from orchestrator.shared.arrays import Array

Slots = NDArray[np.int64]

CUBIC_GAIN = 16.0
"""How much better cubics are between nodes over half the length."""

QUARTIC_SHARE = 0.03
"""Largest error of a polynomial between five nodes as a share of the differences of the next order."""


@dataclass(frozen=True)
class _Window:
    """A window that was tried."""

    parts: tuple[Track, ...]  # what the signals do in it, part by part
    end: float | None  # where the slaves are [s]; ``None``: at its begin, for it was undone
    error: float  # as a multiple of the tolerance
    length: float  # that was tried [s]
    event: bool = False  # a slave has an event at its end
    rates: Array | None = None  # derivatives at its end


class EventWindows:
    """A run of a system with events under ``adaptive``.

    Args:
        events: the slaves and their event mode; they are after their first instants.
        signals: signals in place of those of ``System.sources``, by index.
        start: [s].
        stop: [s].
        settings: tolerance and bounds of the step.
    """

    def __init__(
        self, events: EventIteration, signals: Mapping[int, Signal], start: float, stop: float, settings: Adaptive
    ) -> None:
        self.events, self.wiring, self.settings = events, events.wiring, settings
        self.start, self.stop = start, stop
        layout = self.wiring.layout
        check_adaptive(layout)
        self.signals = [signals.get(k, source.signal) for k, source in enumerate(layout.system.sources)]
        self.breaks = sorted({t for s in self.signals for t in s.breaks(start, stop)} | {stop})
        self.sweeper = Sweeper(events, self._sources, self._difference)
        outputs = [k for stage in events.stages for k in range(stage.outputs.start, stage.outputs.stop)]
        self.outputs = np.array([k for k in outputs if not self.sweeper.held[k]], dtype=np.int64)
        self.accepted = self.rejected = 0

    def run(self, rows: Array, record: Slots) -> Statistics:
        """Run; a row holds the values after the events at its time.

        ``rows``: results, shape (grid points, recorded); row 0 is already there.
        """
        time, length, row = self.start, min(self.settings.first, self.settings.largest), 1
        guess: Track | None = None
        rates, longest = self.events.rates(), self.settings.largest / GROW
        while time < self.stop - slack(self.stop):
            jump = next(t for t in self.breaks if t > time + slack(time))
            target = min(jump, self.events.next_time())
            window = self._attempt(time, window_end(time, length, target), rates, guess, record)
            if window.end is not None:
                assert window.rates is not None
                self.accepted += 1
                time, rates = window.end, window.rates
                self.events.raise_end(time)
                guess = window.parts[-1] if window.parts else guess
                row = self._write(window.parts, rows, record, row)
            else:
                self.rejected += 1
            length = next_length(window.length, window.error, self.settings.largest)
            if self._take_events(time, window, jump):
                guess, rates, length = None, self.events.rates(), min(length, longest)
                if row and abs(self._grid(row - 1) - time) <= slack(time):
                    np.take(self.wiring.values, record, out=rows[row - 1], mode="clip")
            elif window.end is None and length < self.settings.smallest:
                raise ConvergenceError(
                    f"t = {time:.9g} s: a tolerance of {self.settings.tolerance:g} would take a step below "
                    f"{self.settings.smallest:g} s; use a larger tolerance, or another algorithm"
                )
        calls = {stage.name: stage.steps for stage in self.events.stages}
        return Statistics(self.accepted, self.rejected, calls, self.sweeper.sweeps, events=self.events.statistics())

    def _grid(self, row: int) -> float:
        return self.start + row * self.settings.step

    def _take_events(self, time: float, window: _Window, jump: float) -> bool:
        """Take what is due at ``time`` [s]; return whether there was anything."""
        if window.end is None:
            return False
        column = source_nodes(self.wiring.layout, self.signals, np.array([time]), False, self.stop)

        def fill(stage: Stage) -> None:
            gather(stage, self.wiring.view, column, 0)

        jumps = jump - time <= slack(time) and jump < self.stop
        if jumps and not window.event:
            self.events.jump(time, fill)
        return self.events.catch_up(time, fill, window.event) or jumps

    def _sources(self, times: Array) -> Array:
        jumps = min(abs(t - times[-1]) for t in self.breaks) <= slack(times[-1])
        return source_nodes(self.wiring.layout, self.signals, times, jumps, self.stop)

    def _difference(self, values: Array, reference: Array) -> float:
        return largest_difference(values, reference, self.outputs, self.settings.tolerance)

    def _attempt(self, begin: float, end: float, rates: Array, guess: Track | None, record: Slots) -> _Window:
        """Try a window; leave the slaves at its end when its error is within the tolerance, else at its begin."""
        length = end - begin
        with rollback(self.wiring) as restore:
            try:
                return self._sweep_whole_and_halves(begin, end, rates, guess, record, restore)
            except RunEndedError as error:
                raise SlaveError(f"{error}: it wants the run to end, which `adaptive` does not do") from None
            except (UnsettledError, StepDiscardedError) as error:
                restore()
                if isinstance(error, StepDiscardedError) and length < self.settings.smallest:
                    raise SlaveError(str(error)) from None
                return _Window((), None, math.inf, length)
            except _RefusedError as refused:
                restore()
                return _Window((), None, refused.error, length)

    def _sweep_whole_and_halves(
        self, begin: float, end: float, rates: Array, guess: Track | None, record: Slots, restore: Callable[[], None]
    ) -> _Window:
        whole = self.sweeper.sweep(begin, end, rates, guess)
        track, length = whole.track, whole.end - begin
        if length <= 1.01 * BRIEF * slack(begin):
            parts: tuple[Track, ...] = (track,) if length > 0.0 else ()
            return _Window(parts, whole.end, 0.0, end - begin, whole.event, whole.rates)
        restore()
        middle = 0.5 * (begin + whole.end)
        first = self.sweeper.sweep(begin, middle, rates, track)
        error, halves = self._compare(track, first), [first]
        if not first.event and first.end == middle:
            halves.append(self.sweeper.sweep(middle, whole.end, first.rates, track))
            read = np.union1d(self._recorded(track, record), self.events.exchanged if whole.event else record[:0])
            error = max(error, self._compare(track, halves[1]), self._between(track, halves, read))
        if error > 1.0:
            raise _RefusedError(error)
        last = halves[-1]
        parts = tuple(half.track for half in halves if half.end > half.track.start)
        return _Window(parts, last.end, error, length, last.event, last.rates)

    def _compare(self, track: Track, half: Swept) -> float:
        """Return how far a half is from the whole at its end."""
        if half.end == half.track.start:
            return 0.0
        return self._difference(track.at(np.array([half.end]))[0], half.track.values[2])

    def _recorded(self, track: Track, record: Slots) -> Slots:
        """Return the recorded slots where a recorded point is within the window."""
        step = self.settings.step
        inside = math.floor((track.end - self.start) / step) > math.floor((track.start - self.start) / step)
        return record if inside else record[:0]

    def _between(self, track: Track, halves: Sequence[Swept], read: Slots) -> float:
        """Return the error of slots between nodes as a multiple of the tolerance.

        Between nodes recorded points are read, and the inputs by which a slave has placed the event at the end.
        """
        if not len(read):
            return 0.0
        rated, held = self.sweeper.rated[read], self.sweeper.held[read]
        rough = JoinedTracks(tuple(half.track for half in halves)).roughness()[read]
        worst = 0.0
        for half in halves:
            time, values = 0.5 * (half.track.start + half.track.end), half.track.values[1, read]
            cubic = np.abs(track.at(np.array([time]))[0, read] - values) / CUBIC_GAIN
            error = np.where(rated, cubic, QUARTIC_SHARE * rough)
            scale = self.settings.tolerance * np.maximum(1.0, np.abs(values))
            worst = max(worst, float(np.max((error / scale)[~held], initial=0.0)))
        return worst

    def _write(self, parts: tuple[Track, ...], rows: Array, record: Slots, row: int) -> int:
        """Fill in the recorded points up to the end of the window; return the next one's number."""
        first = row
        end = parts[-1].end if parts else -math.inf
        while row < len(rows) and self._grid(row) <= end + slack(end):
            row += 1
        if row > first:
            tracks = JoinedTracks(parts)
            times = np.minimum(self._grid(0) + self.settings.step * np.arange(first, row), end)
            held = self.sweeper.held
            rows[first:row] = np.where(held, tracks.values_before(times), tracks.at(times))[:, record]
        return row


class _RefusedError(Exception):
    """A window's error is too large."""

    def __init__(self, error: float) -> None:
        super().__init__()
        self.error = error
