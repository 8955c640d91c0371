"""Events between slaves: instants at one time, which all slaves take together until none needs another.

At an event all slaves enter event mode. An instant there is: clocks that are due tick, outputs and inputs are exchanged
until they agree, then every slave updates its discrete states. While one of them needs another instant, or the update
has changed what another one takes, there is a further one for all: a slave that went through its instants alone would
hide from others what it put out in between. Then all leave.
"""

import math
from collections.abc import Sequence

import numpy as np

from orchestrator.errors import ChatteringError
from orchestrator.master.clocks import ClockSchedule
from orchestrator.master.event_stage import EventStage, Gather, is_discrete, slack
from orchestrator.master.fixed_point import solve_fixed_point
from orchestrator.master.iterated import backward_slots
from orchestrator.master.protocol import EventSlave
from orchestrator.master.result import EventStatistics, RunRemark
from orchestrator.master.system import split
from orchestrator.master.wiring import Wiring
from orchestrator.shared.arrays import Array

Ticks = dict[str, list[str]]

MOST_INSTANTS = 100
"""Instants at one time beyond which slaves are taken to ask for another one for ever."""

MOST_EVENTS = 100
"""Events in a row without any time between them beyond which time is taken to stand still."""

MOST_TIMES = 50_000
"""Times of events that are remembered, and late ones."""

LOOP_TOLERANCE, LOOP_PASSES = 1e-12, 100


def _chatter_error(time: float, names: Sequence[str]) -> ChatteringError:
    text = f"t = {time:.9g} s: {MOST_INSTANTS} instants at one time must settle all slaves"
    return ChatteringError(f"{text}, but {', '.join(names) or 'what they exchange'} needs another")


class EventIteration:
    """Takes all slaves of a wiring through their events.

    Attributes:
        stages: all instances, in execution order.
        rated: signals whose derivatives are known; those of outputs that follow inputs at once would lack the inputs'.
        exchanged: slots of the signals that slaves with events take from others.
        late_for: an instance that could not be taken back to events, for which they were late.
    """

    def __init__(self, wiring: Wiring) -> None:
        self.wiring = wiring
        self.stages = [EventStage(stage, wiring.values) for stage in wiring.stages]
        self._taking = [stage for stage in self.stages if stage.has_events]
        by_name = {stage.name: stage for stage in self._taking}
        self._triggers: dict[str, list[tuple[str, EventSlave, str]]] = {}
        for connection in wiring.layout.system.clock_connections:
            (source, output), (target, clock) = split(connection.source), split(connection.target)
            self._triggers.setdefault(target, []).append((clock, by_name[source].events, output))
        self._forget(0.0)
        system, slots = wiring.layout.system, wiring.layout.slots
        discrete = {slots[a] for a in slots if (v := system.variable(a)) is not None and is_discrete(v)}
        cut = backward_slots(wiring.layout, [stage.name for stage in self.stages])
        self._cut = np.array([slot for slot in cut if slot not in discrete], dtype=np.int64)
        self._outputs = np.array([k for s in self.stages for k in range(s.outputs.start, s.outputs.stop)], np.int64)
        self._discrete = np.array([k for k in self._outputs if k in discrete], dtype=np.int64)
        sources = {feed.source for stage in self._taking for feed in stage.block.feeds if feed.source >= 0}
        self.exchanged = np.array(sorted(sources), dtype=np.int64)

        self.rated = np.zeros(len(slots), dtype=bool)
        for stage in self._taking:
            for name, slot in zip(stage.rated, stage.rate_slots, strict=True):
                self.rated[slot] = name not in stage.follows

    def rates(self) -> Array:
        """Return the derivatives of the outputs (slots,) where the slaves are, per second; zero where unknown."""
        found = np.zeros(len(self.wiring.values))
        for stage in self._taking:
            stage.read_rates(found)
        return found

    def _forget(self, start: float) -> None:
        """Begin anew at ``start`` [s]."""
        self._clocks = ClockSchedule(self.wiring.layout.system, start)
        self.late: list[float] = []
        self.late_for = ""
        self._times: list[float] = []
        self._instants = self._ticks = self._standing = 0
        self._last = -math.inf
        for stage in self.stages:
            stage.next_event, stage.steps, stage.ends_run = math.inf, 0, ""

    def statistics(self) -> EventStatistics:
        """Return what happened."""
        return EventStatistics(tuple(self._times), self._instants, self._ticks, tuple(self.late[:MOST_TIMES]))

    def remarks(self) -> list[RunRemark]:
        """Return what is to be known of events that were late."""
        if not self.late:
            return []
        text = "cannot be taken back to an event: such events reach the others at the communication point only"
        return [RunRemark(self.late_for, f"{text}, up to {max(self.late):g} s late", len(self.late))]

    def next_time(self) -> float:
        """Return the next time [s] at which an event is due, as far as is known before any step."""
        return min(self._clocks.next_time(), min((s.next_event for s in self._taking), default=math.inf))

    def begin(self, time: float, gather: Gather) -> None:
        """Take the first instants at ``time`` [s], in which all slaves are after initialisation."""
        self._forget(time)
        for stage in self.stages:
            if not stage.has_events:
                stage.receive()
        self._settle(time, gather)
        self.catch_up(time, gather)

    def catch_up(self, time: float, gather: Gather, event: bool = False) -> bool:
        """Take what is due at ``time`` [s]: events, ticks, and changes of discrete inputs."""
        found = False
        while event or self._is_due(time) or any(s.takes_discrete_news(gather) for s in self._taking):
            if event or min(s.next_event for s in self._taking) <= time + slack(time):
                self._note(time)
            self._count_standing(time)
            self.enter()
            self._settle(time, gather)
            event, found = False, True
        return found

    def enter(self) -> None:
        """Enter event mode with all slaves that have events."""
        for stage in self._taking:
            stage.events.enter_event_mode()

    def settle_alone(self, stage: EventStage, time: float) -> None:
        """Take one slave through an event at ``time`` [s] with inputs as they are; others do not see it."""
        self._note(time)
        stage.events.enter_event_mode()
        for _ in range(MOST_INSTANTS):
            self._instants += 1
            again = stage.update()
            stage.raise_end(time)
            if not again:
                stage.events.leave_event_mode()
                return
        raise _chatter_error(time, [stage.name])

    def jump(self, time: float, gather: Gather) -> None:
        """Take all slaves through an instant because a source jumps at ``time`` [s]."""
        self.enter()
        self._settle(time, gather)
        self.catch_up(time, gather)

    def raise_end(self, time: float) -> None:
        """Raise ``RunEndedError`` where a slave wants the run to end, after a step or an instant at ``time`` [s]."""
        for stage in self.stages:
            stage.raise_end(time)

    def _is_due(self, time: float) -> bool:
        return self.next_time() <= time + slack(time)

    def _note(self, time: float) -> None:
        if not self._times or (time > self._times[-1] + slack(time) and len(self._times) < MOST_TIMES):
            self._times.append(time)

    def _count_standing(self, time: float) -> None:
        self._standing = self._standing + 1 if time - self._last <= slack(time) else 0
        self._last = time
        if self._standing > MOST_EVENTS:
            raise ChatteringError(
                f"t = {time:.9g} s: time must go on between events, but {MOST_EVENTS} events came at one time"
            )

    def _settle(self, time: float, gather: Gather) -> None:
        """Take instants in event mode until none needs another, and leave."""
        ticks: Ticks = self._clocks.take() if self._clocks.next_time() <= time + slack(time) else {}
        self._ticks += sum(map(len, ticks.values()))
        for stage in self._taking:
            if stage.name in ticks:
                stage.events.tick(ticks[stage.name])
        asking: list[str] = []
        values = self.wiring.values
        for _ in range(MOST_INSTANTS):
            self._exchange(time, gather, ticks)
            shown, ticks = values[self.exchanged], {}
            asking = [stage.name for stage in self._taking if stage.update()]
            self._instants += 1
            for stage in self._taking:
                stage.receive()
            self.raise_end(time)
            if not asking and np.array_equal(values[self.exchanged], shown, equal_nan=True):
                break
        else:
            raise _chatter_error(time, asking)
        for stage in self._taking:
            stage.events.leave_event_mode()

    def _trigger(self, stage: EventStage, ticks: Ticks) -> int:
        """Tick the clocks of a slave whose triggers are active, and that do not tick yet; return how many there are."""
        known = ticks.get(stage.name, [])
        triggers = self._triggers.get(stage.name, [])
        due = [clock for clock, source, name in triggers if clock not in known and name in source.active_clocks()]
        if due:
            stage.events.tick(due)
            ticks[stage.name] = [*known, *due]
            self._ticks += len(due)
        return len(due)

    def _exchange(self, time: float, gather: Gather, ticks: Ticks) -> None:
        """Pass outputs on to inputs until no output changes any more."""
        values = self.wiring.values

        def sweep() -> bool:
            triggered = 0
            for stage in self._taking:
                triggered += self._trigger(stage, ticks)
                stage.exchange(gather, ticks.get(stage.name, ()))
            return triggered > 0

        for _ in range(2 * len(self._taking) + 1):
            before = values[self._outputs]
            if not sweep() and np.array_equal(values[self._outputs], before, equal_nan=True):
                return

        def image(point: Array) -> Array:
            values[self._cut] = point
            sweep()
            return values[self._cut]

        solve_fixed_point(image, values[self._cut], LOOP_TOLERANCE, LOOP_PASSES, f"an event at t = {time:g} s")
        before = values[self._discrete]
        sweep()
        if not np.array_equal(values[self._discrete], before):
            raise ChatteringError(f"t = {time:.9g} s: discrete values of a loop must settle, but go to and fro")
