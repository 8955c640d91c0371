"""Inputs inside the steps of fixed-step algorithms, of slaves that take them there.

An input that jumps where a step begins would end and begin a contact there, again and again. So it goes from its value
at the begin of the step to that of a source that has stepped already: on a cubic where derivatives are known, else on a
line. Where the source has not stepped yet it goes along the derivative, or is held.
"""

import numpy as np

from orchestrator.master.event_stage import EventStage, Gather
from orchestrator.master.events import EventIteration
from orchestrator.master.tracks import follow_cubics
from orchestrator.shared.arrays import Array


class InputLeads:
    """Tells slaves what their inputs do inside a step; where all are ``simultaneous`` no source is ahead (Jacobi)."""

    def __init__(self, events: EventIteration, gather: Gather, simultaneous: bool) -> None:
        self._events, self._gather, self._simultaneous = events, gather, simultaneous
        self._values = events.wiring.values
        self._needed = any(stage.inside for stage in events.stages)
        self._before = self._values.copy()
        self._rates, self._ends = np.zeros((2, len(self._values)))

    def begin(self, values: Array) -> None:
        """Note where all slaves are at the begin of a window; ``values`` are those of all slots then."""
        self._before = values
        if self._needed:
            self._rates = self._events.rates()

    def note(self, stage: EventStage) -> None:
        """Note where a slave is after its step."""
        if self._needed:
            stage.read_rates(self._ends)

    def lead(self, stage: EventStage, begin: float, end: float) -> Array:
        """Set the inputs of a slave as they are at ``begin`` [s], tell it the rest, and return those at ``end`` [s]."""
        now, step = self._values.copy(), end - begin
        newest = self._before if self._simultaneous else now
        last, first = self._inputs(stage, newest), self._inputs(stage, self._before)
        held = np.delete(np.arange(len(first)), stage.places)
        first[held] = last[held]
        self._values[:] = now
        self._values[stage.inputs] = first
        cubics = []
        for k in stage.places:
            feed = stage.feeds[k]
            slope, moved = last[k] - first[k], newest[feed.source] != self._before[feed.source]
            rate = rate_end = slope
            if feed.source >= 0 and self._events.rated[feed.source]:
                rate = feed.factor * self._rates[feed.source] * step
                rate_end = feed.factor * self._ends[feed.source] * step if moved else rate
                slope = slope if moved else rate
                last[k] = first[k] + slope
            bend = 3.0 * slope - 2.0 * rate - rate_end
            cubics.append((float(first[k]), float(rate), float(bend), float(rate + rate_end - 2.0 * slope)))
        stage.events.feed(stage.inside, follow_cubics(cubics, begin, step))
        return last

    def _inputs(self, stage: EventStage, values: Array) -> Array:
        """Return the inputs that a slave would get from these values of all signals."""
        self._values[:] = values
        self._gather(stage.stage)
        return self._values[stage.inputs]
