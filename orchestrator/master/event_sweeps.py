"""All slaves of a system with events through one window, again and again until what they exchange settles.

A sweep restores all slaves to the begin of the window and steps them one after the other through its two cells; their
outputs at the three nodes, with derivatives where slaves know them, are the inputs of the next sweep. A slave that
takes inputs inside steps is fed their polynomials, any other one constant pieces with the right moments. Where a slave
stops at an event the window becomes shorter, and the sweeps go on until the event stays where it is.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orchestrator.master.event_stage import EventStage, is_discrete, slack
from orchestrator.master.events import EventIteration
from orchestrator.master.pieces import piece_times, piece_weights
from orchestrator.master.rollback import rollback
from orchestrator.master.tracks import Track, cell_coefficients, follow_cubics
from orchestrator.shared.arrays import Array

MOST_SWEEPS = 30
BRIEF = 100.0
"""Windows that are shorter than so many roundings of time are taken as they are."""

FAR = 40.0
"""Length of a window as a multiple of the one before, beyond which that one's polynomials tell nothing."""

SETTLED = 0.1
"""Change of an output in the last sweep, as a multiple of the tolerance."""


class UnsettledError(Exception):
    """A window is too long for what its slaves exchange to settle."""


@dataclass(frozen=True)
class Swept:
    """What came of the sweeps over a window."""

    track: Track  # all signals, up to ``end``; of no use where that is the begin of the window
    end: float  # of the window, or an event before it [s]
    event: bool  # a slave has an event there
    rates: Array


class Sweeper:
    """Sweeps the slaves of a wiring.

    ``sources``: what sources add to inputs at three nodes, shape (rows, 3), from their times [s]; ``difference``: of
    two sets of outputs, as a multiple of the tolerance.

    Attributes:
        sweeps: passes over all slaves.
        held: signals that do not change within a window.
        rated: see ``EventIteration``; derivatives make cubics of these signals.
    """

    def __init__(
        self,
        events: EventIteration,
        sources: Callable[[Array], Array],
        difference: Callable[[Array, Array], float],
    ) -> None:
        self.wiring, self._sources, self._difference = events.wiring, sources, difference
        self._stages = events.stages
        self.sweeps = 0
        system, slots = self.wiring.layout.system, self.wiring.layout.slots
        self.held = np.array([(v := system.variable(a)) is not None and is_discrete(v) for a in slots], dtype=bool)
        self.rated = events.rated

    def sweep(self, begin: float, end: float, rates: Array, guess: Track | None) -> Swept:
        """Take all slaves from ``begin`` to ``end`` [s], or to the first event before it."""
        with rollback(self.wiring) as restore:
            track = self._guess_track(begin, end, rates, guess)
            for sweep in range(MOST_SWEEPS):
                if sweep:
                    restore()
                found, stopped = self._pass(track)
                if stopped is not None:
                    stage, reached = stopped
                    brief = begin + BRIEF * slack(begin)
                    if reached - begin <= slack(begin) and track.end > brief:  # a poor guess may have brought it about
                        restore()
                        track = self._guess_track(begin, max(brief, begin + 0.1 * (track.end - begin)), rates, None)
                        continue
                    if reached - begin <= slack(begin):
                        restore()
                        self._pass(track, only=stage)
                        return Swept(track, begin, True, rates)
                    track = self._shorten_track(found.track, reached)
                    continue
                change = self._difference(track.values[1:], found.track.values[1:])
                track = found.track
                if change <= SETTLED:
                    return found
        raise UnsettledError

    def _guess_track(self, begin: float, end: float, rates: Array, guess: Track | None) -> Track:
        """Return what the signals may do: as before, moved to where they are now."""
        times, now = begin + 0.5 * (end - begin) * np.arange(3.0), self.wiring.values
        if guess is None or end - begin > FAR * (guess.end - guess.start):
            values, slopes = now + np.outer(times - begin, rates), np.tile(rates, (3, 1))
        else:
            values, slopes = guess.at(times), guess.rates_at(times)
            values += now - values[0]
            slopes[0] = rates
        values[:, self.held] = now[self.held]
        values[0] = now
        return Track(begin, end, values, slopes, self.rated)

    def _shorten_track(self, track: Track, end: float) -> Track:
        times = track.start + 0.5 * (end - track.start) * np.arange(3.0)
        values, rates = track.at(times), track.rates_at(times)
        values[0], rates[0] = track.values[0], track.rates[0]
        return Track(track.start, end, values, rates, self.rated)

    def _pass(self, track: Track, only: EventStage | None = None) -> tuple[Swept, tuple[EventStage, float] | None]:
        """Step all slaves once; return what they show, and the first one that stopped, with the time [s]."""
        self.sweeps += only is None
        begin, end = track.start, track.end
        values, rates = track.values.copy(), track.rates.copy()
        sources = self._sources(begin + 0.5 * (end - begin) * np.arange(3.0))
        event = False
        for stage in self._stages if only is None else [only]:
            kept = values.copy(), rates.copy()
            run = self._along if stage.inside else self._in_pieces
            reached, due = run(stage, begin, end, values, rates, sources)
            if reached < end:
                return Swept(Track(begin, end, *kept, self.rated), end, True, rates), (stage, reached)
            event = event or due
        return Swept(Track(begin, end, values, rates, self.rated), end, event, rates[2].copy()), None

    def _input_nodes(
        self, stage: EventStage, values: Array, rates: Array, sources: Array
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return values and derivatives of a slave's inputs at the nodes, and which of them have derivatives."""
        nodes, slopes = np.empty((3, len(stage.feeds))), np.zeros((3, len(stage.feeds)))
        rated = np.zeros(len(stage.feeds), dtype=bool)
        for k, feed in enumerate(stage.feeds):
            nodes[:, k] = feed.offset
            if feed.source >= 0:
                source = values[:, feed.source]
                nodes[:, k] += feed.factor * (source[0] if self.held[feed.source] else source)
                slopes[:, k] = feed.factor * rates[:, feed.source]
                rated[k] = self.rated[feed.source] and feed.signal < 0
            if feed.signal >= 0:
                nodes[:, k] += sources[feed.signal]
        return nodes, slopes, rated

    def _along(
        self, stage: EventStage, begin: float, end: float, values: Array, rates: Array, sources: Array
    ) -> tuple[float, bool]:
        """Step a slave that is fed the polynomials of its inputs; return where it stopped, and whether at an event."""
        nodes, slopes, rated = self._input_nodes(stage, values, rates, sources)
        middle, cell = 0.5 * (begin + end), 0.5 * (end - begin)
        cubics = cell_coefficients(nodes, slopes, rated, cell)
        times = (begin, middle, end)
        event = False
        rows: list[list[list[float]]] = cubics[:, :, stage.places].transpose(0, 2, 1).tolist()
        begins = cubics.transpose(0, 2, 1) @ np.array([1.0, 0.5, 1.0 / 3.0, 0.25])  # means, of those that are held
        begins[:, stage.places] = cubics[:, 0, stage.places]
        for k in range(2):
            self.wiring.values[stage.inputs] = begins[k]
            stage.send()
            stage.events.feed(stage.inside, follow_cubics(rows[k], times[k], cell))
            outcome = stage.step(times[k], times[k + 1])
            event = outcome.event
            self._show(stage, k + 1, values, rates)
            if outcome.reached < times[k + 1] or (event and k == 0):
                return outcome.reached, event
        self.wiring.values[stage.inputs] = nodes[2]
        return end, event

    def _in_pieces(
        self, stage: EventStage, begin: float, end: float, values: Array, rates: Array, sources: Array
    ) -> tuple[float, bool]:
        """Step a slave that holds its inputs; see ``_along``."""
        nodes, _, _ = self._input_nodes(stage, values, rates, sources)
        closing = bool(stage.follows)
        constants = piece_weights(closing) @ nodes
        times, at_node = piece_times(begin, end, closing)
        node, event = 1, False
        for k, ends_cell in enumerate(at_node):
            self.wiring.values[stage.inputs] = constants[k]
            stage.send()
            outcome = stage.step(times[k], times[k + 1])
            event = outcome.event
            if outcome.reached < times[k + 1] or (event and k + 1 < len(at_node)):
                stage.receive()
                return outcome.reached, event
            if ends_cell:
                self._show(stage, node, values, rates)
                node += 1
        return end, event

    def _show(self, stage: EventStage, node: int, values: Array, rates: Array) -> None:
        """Read the outputs at a node, and their derivatives."""
        stage.receive()
        outputs = stage.outputs
        values[node, outputs] = self.wiring.values[outputs]
        values[node, stage.inputs] = self.wiring.values[stage.inputs]
        stage.read_rates(rates[node])
