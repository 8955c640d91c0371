"""Events between slaves: instants at one time, which all slaves take together until none needs another.

At an event all slaves enter event mode. An instant there is: clocks that are due tick, outputs and inputs are exchanged
until they agree, then every slave updates its discrete states. While one of them needs another instant, or the update
has changed what another one takes, there is a further one for all: a slave that went through its instants alone would
hide from others what it put out in between. Then all leave.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray

from orchestrator.errors import ChatteringError, SlaveError
from orchestrator.master.clocks import ClockSchedule
from orchestrator.master.fixed_point import fixed_point
from orchestrator.master.iterated import backward_slots
from orchestrator.master.protocol import EventSlave, RunEndedError, Signals, StepOutcome, Variable
from orchestrator.master.result import EventStatistics, RunRemark
from orchestrator.master.wiring import Stage, Wiring, bind_receive, bind_send

Array = NDArray[np.float64]
Gather = Callable[[Stage], None]
"""Fills a stage's input slots from outputs and sources."""

Ticks = Mapping[str, Sequence[str]]

MOST_INSTANTS = 100
"""Instants at one time beyond which slaves are taken to ask for another one for ever."""

MOST_EVENTS = 100
"""Events in a row without any time between them beyond which time is taken to stand still."""

MOST_TIMES = 50_000
"""Times of events that are remembered, and late ones."""

LOOP_TOLERANCE, LOOP_PASSES = 1e-12, 100


def slack(time: float) -> float:
    """Return the distance [s] below which instants about ``time`` [s] are one: some roundings of time.

    Args:
        time: [s].

    Returns:
        The distance.
    """
    return 1e-12 * max(1.0, abs(time))


def is_discrete(variable: Variable) -> bool:
    """Return whether a variable changes at events alone.

    Args:
        variable: any.

    Returns:
        True for types that are not Real and for the variability ``discrete``.
    """
    return variable.type != "Real" or variable.variability == "discrete"


class EventStage:
    """One instance of a system with events; its slave may have none.

    Args:
        stage: the instance.
        values: the slots.

    Attributes:
        steps: calls that asked the slave for a step.
        can_go_back: it can be taken back to a saved state, and step to any time from there.
        send: moves the continuous inputs; of a slave without events all.
        outputs: its output slots.
        next_event: [s], as the slave said last; infinity where it knows of none.
    """

    def __init__(self, stage: Stage, values: Signals) -> None:
        self.stage, self.block, self.slave = stage, stage.block, stage.slave
        model, block = self.slave.model, stage.block
        self.name, self.has_events = block.name, model.has_events
        self.can_go_back = model.can_save_state and model.can_vary_step
        self.outputs = slice(block.first_output, block.first_output + len(block.outputs))
        self.next_event, self.steps = math.inf, 0
        self.send, self.receive = stage.send, stage.receive
        self._values = values
        self._clocks: dict[str, tuple[Callable[[], None], Callable[[], None]]] = {}
        self._sent = np.empty(0)
        if not self.has_events:
            return
        self.events = cast(EventSlave, self.slave)
        clocked = {name for clock in model.clocks.values() for name in clock.variables}
        free = [name for name in block.inputs if name not in clocked]
        discrete = [name for name in free if is_discrete(model.variables[name])]
        places = {name: block.first_input + k for k, name in enumerate(block.inputs)}
        self._discrete = np.array([places[name] for name in discrete], dtype=np.int64)
        self.send = bind_send(self.slave, block, [name for name in free if name not in discrete], values)
        self._send_discrete = bind_send(self.slave, block, discrete, values)
        for name, clock in model.clocks.items():
            inputs = [v for v in block.inputs if v in clock.variables]
            outputs = [v for v in block.outputs if v in clock.variables]
            self._clocks[name] = (
                bind_send(self.slave, block, inputs, values),
                bind_receive(self.slave, block, outputs, values),
            )

    def step(self, begin: float, end: float) -> StepOutcome:
        """Step towards ``end`` [s].

        Args:
            begin: where the slave is [s].
            end: [s].

        Returns:
            Where it ended; ``end`` itself, where that is missed by rounding.

        Raises:
            SlaveError: the slave went back.
        """
        self.steps += 1
        if not self.has_events:
            self.stage.do_step(begin, end - begin)
            return StepOutcome(end, False)
        found = self.events.step(begin, end - begin)
        if not found.reached >= begin - slack(begin):
            raise SlaveError(f"{self.name}: a step from t = {begin:g} s must go on, but ended at {found.reached:g} s")
        return StepOutcome(end, found.event) if found.reached >= end - slack(end) else found

    def exchange(self, gather: Gather, clocks: Sequence[str]) -> None:
        """Take inputs and show outputs, in event mode.

        Args:
            gather: fills the input slots.
            clocks: that are active.
        """
        gather(self.stage)
        self.send()
        self._send_discrete()
        for clock in clocks:
            self._clocks[clock][0]()
        self.receive()
        for clock in clocks:
            self._clocks[clock][1]()
        self._sent = self._values[self._discrete]

    def takes_discrete_news(self, gather: Gather) -> bool:
        """Return whether a discrete input has another value than the slave has, which it takes at events alone.

        Args:
            gather: fills the input slots.

        Returns:
            True when one has.
        """
        if not len(self._discrete):
            return False
        gather(self.stage)
        return not np.array_equal(self._values[self._discrete], self._sent, equal_nan=True)

    def update(self, time: float) -> bool:
        """End an instant.

        Args:
            time: [s].

        Returns:
            Whether the slave needs another.

        Raises:
            RunEndedError: it wants the run to end.
        """
        found = self.events.update_discrete_states()
        self.next_event = math.inf if found.next_event is None else found.next_event
        if found.ends_run:
            raise RunEndedError(f"{self.name}: an event at t = {time:g} s", self.name, time, at_event=True)
        return found.again


def _chattering(time: float, names: Sequence[str]) -> ChatteringError:
    text = f"t = {time:.9g} s: {MOST_INSTANTS} instants at one time must settle all slaves"
    return ChatteringError(f"{text}, but {', '.join(names) or 'what they exchange'} needs another")


class EventIteration:
    """Takes all slaves of a wiring through their events.

    Args:
        wiring: bound slaves.

    Attributes:
        stages: all instances, in execution order.
        late: see ``EventStatistics``.
        late_for: an instance that could not be taken back to events, for which they were late.
    """

    def __init__(self, wiring: Wiring) -> None:
        self.wiring = wiring
        self.stages = [EventStage(stage, wiring.values) for stage in wiring.stages]
        self._taking = [stage for stage in self.stages if stage.has_events]
        self._forget(0.0)
        system, slots = wiring.layout.system, wiring.layout.slots
        discrete = {slots[a] for a in slots if (v := system.variable(a)) is not None and is_discrete(v)}
        cut = backward_slots(wiring.layout, [stage.name for stage in self.stages])
        self._cut = np.array([slot for slot in cut if slot not in discrete], dtype=np.int64)
        self._outputs = np.array([k for s in self.stages for k in range(s.outputs.start, s.outputs.stop)], np.int64)
        self._discrete = np.array([k for k in self._outputs if k in discrete], dtype=np.int64)
        sources = {feed.source for stage in self._taking for feed in stage.block.feeds if feed.source >= 0}
        self._sources = np.array(sorted(sources), dtype=np.int64)

    def _forget(self, start: float) -> None:
        """Begin anew at ``start`` [s]."""
        self._clocks = ClockSchedule(self.wiring.layout.system, start)
        self.late: list[float] = []
        self.late_for = ""
        self._times: list[float] = []
        self._instants = self._ticks = self._standing = 0
        self._last = -math.inf
        for stage in self.stages:
            stage.next_event, stage.steps = math.inf, 0

    def statistics(self) -> EventStatistics:
        """Return what happened.

        Returns:
            The events of the run so far.
        """
        return EventStatistics(tuple(self._times), self._instants, self._ticks, tuple(self.late[:MOST_TIMES]))

    def remarks(self) -> list[RunRemark]:
        """Return what is to be known of events that were late.

        Returns:
            A remark, or none.
        """
        if not self.late:
            return []
        text = "cannot be taken back to an event: such events reach the others at the communication point only"
        return [RunRemark(self.late_for, f"{text}, up to {max(self.late):g} s late", len(self.late))]

    def next_time(self) -> float:
        """Return the next time [s] at which an event is due, as far as is known before any step.

        Returns:
            The time; infinity for none.
        """
        return min(self._clocks.next_time(), min((s.next_event for s in self._taking), default=math.inf))

    def begin(self, time: float, gather: Gather) -> None:
        """Take the first instants, in which all slaves are after initialisation.

        Args:
            time: start of the run [s].
            gather: fills the input slots of a stage.
        """
        self._forget(time)
        for stage in self.stages:
            if not stage.has_events:
                stage.receive()
        self._settle(time, gather)
        self.catch_up(time, gather)

    def catch_up(self, time: float, gather: Gather, event: bool = False) -> bool:
        """Take what is due at ``time`` [s]: events, ticks, and changes of discrete inputs.

        Args:
            time: where all slaves are.
            gather: fills the input slots of a stage.
            event: a slave has reported one.

        Returns:
            Whether there was anything.

        Raises:
            ChatteringError: there is no end of events at this time.
            RunEndedError: a slave wants the run to end.
        """
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
        """Take one slave through an event with inputs as they are; others do not see it.

        Args:
            stage: whose slave.
            time: where it is [s].

        Raises:
            ChatteringError: there is no end of instants.
        """
        self._note(time)
        stage.events.enter_event_mode()
        for _ in range(MOST_INSTANTS):
            self._instants += 1
            if not stage.update(time):
                stage.events.leave_event_mode()
                return
        raise _chattering(time, [stage.name])

    def jump(self, time: float, gather: Gather) -> None:
        """Take all slaves through an instant because a source jumps at ``time`` [s].

        Args:
            time: where all slaves are.
            gather: fills the input slots of a stage.
        """
        self.enter()
        self._settle(time, gather)
        self.catch_up(time, gather)

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
            shown, ticks = values[self._sources], {}
            asking = [stage.name for stage in self._taking if stage.update(time)]
            self._instants += 1
            for stage in self._taking:
                stage.receive()
            if not asking and np.array_equal(values[self._sources], shown, equal_nan=True):
                break
        else:
            raise _chattering(time, asking)
        for stage in self._taking:
            stage.events.leave_event_mode()

    def _exchange(self, time: float, gather: Gather, ticks: Ticks) -> None:
        """Pass outputs on to inputs until no output changes any more."""
        values = self.wiring.values

        def sweep() -> None:
            for stage in self._taking:
                stage.exchange(gather, ticks.get(stage.name, ()))

        for _ in range(len(self._taking) + 1):
            before = values[self._outputs]
            sweep()
            if np.array_equal(values[self._outputs], before, equal_nan=True):
                return

        def image(point: Array) -> Array:
            values[self._cut] = point
            sweep()
            return values[self._cut]

        fixed_point(image, values[self._cut], LOOP_TOLERANCE, LOOP_PASSES, f"an event at t = {time:g} s")
        before = values[self._discrete]
        sweep()
        if not np.array_equal(values[self._discrete], before):
            raise ChatteringError(f"t = {time:.9g} s: discrete values of a loop must settle, but go to and fro")
