"""Fixed-step algorithms with events: communication steps made of windows that end where an event is.

A slave that stops at an event stays there. Those that are beyond are taken back to the begin of the window and step to
the event. One that cannot be taken back keeps the others going: they take the event alone, and all of them once more at
the communication point, late.
"""

import numpy as np

from orchestrator.errors import ChatteringError, ConvergenceError
from orchestrator.master.algorithms import GaussSeidel, Iterated, Jacobi
from orchestrator.master.clocks import TickSamples
from orchestrator.master.event_stage import EventStage, slack
from orchestrator.master.events import MOST_EVENTS, EventIteration
from orchestrator.master.fixed_point import solve_fixed_point
from orchestrator.master.input_leads import InputLeads
from orchestrator.master.iterated import loop_groups
from orchestrator.master.protocol import RunEndedError, StepOutcome
from orchestrator.master.wiring import Slots, Stage, gather
from orchestrator.shared.arrays import Array

MOST_SHORTENINGS = 100
"""Times that a window may become shorter, because slaves stop earlier and earlier when they are taken back."""


class _StoppedError(Exception):
    """A slave of an algebraic loop stopped before the end of the window; the others are somewhere."""

    def __init__(self, stage: EventStage, outcome: StepOutcome) -> None:
        super().__init__()
        self.stage, self.outcome = stage, outcome


class _Group:
    """Instances that step together, for they are an algebraic loop, or one instance.

    Attributes:
        stages: in the order in which they step.
        cut: unknowns of the loop; none for one instance.
        at: where it is [s].
        moved: it is beyond the begin of the window, or has an event there.
        event: one of its slaves has an event there.
        states: of its slaves at the begin of the window; empty where they cannot go back.
        shown: outputs where it is.
    """

    def __init__(self, stages: list[EventStage], cut: Slots) -> None:
        self.stages, self.cut = stages, cut
        self.can_go_back = all(stage.can_go_back for stage in stages)
        self.at, self.moved, self.event = 0.0, False, False
        self.states: list[object] = []
        self.shown: list[Array] = []

    def save(self, begin: float) -> None:
        """Begin a window at ``begin`` [s]."""
        self.at, self.moved, self.event = begin, False, False
        self.states = [stage.slave.get_state() for stage in self.stages] if self.can_go_back else []

    def restore(self, begin: float) -> None:
        """Go back to the begin of the window, ``begin`` [s]."""
        self.at, self.moved, self.event = begin, False, False
        for stage, state in zip(self.stages, self.states, strict=True):
            stage.slave.set_state(state)

    def free(self) -> None:
        """Give the states back."""
        for stage, state in zip(self.stages, self.states, strict=False):
            stage.slave.free_state(state)
        self.states = []

    def keep(self, values: Array) -> None:
        """Note that it has moved, and the outputs where it is."""
        self.moved = True
        self.shown = [values[stage.outputs].copy() for stage in self.stages]

    def show(self, values: Array) -> None:
        """Put the outputs where it is into their slots."""
        for stage, outputs in zip(self.stages, self.shown, strict=True):
            values[stage.outputs] = outputs


class FixedSteps:
    """A run of a system with events on the grid ``start + n * step``.

    Args:
        events: the slaves and their event mode.
        algorithm: with a fixed step.
        table: what the sources add to inputs, see ``Layout.signal_table``; those of clocks are put in at each tick.
        ticks: what they add to those.
        start: [s].

    Attributes:
        passes: over instances, undone ones included.
        undone: windows of which something was undone.
    """

    def __init__(
        self,
        events: EventIteration,
        algorithm: GaussSeidel | Jacobi | Iterated,
        table: Array,
        ticks: TickSamples,
        start: float,
    ) -> None:
        self.events, self.algorithm, self.table, self._ticks, self.start = events, algorithm, table, ticks, start
        self.values, self.view = events.wiring.values, events.wiring.view
        self.passes = self.undone = 0
        self._column, self._late = 0, False
        by_name = {stage.name: stage for stage in events.stages}
        if isinstance(algorithm, Iterated):
            loops = loop_groups(events.wiring)
            self._groups = [_Group([by_name[s.block.name] for s in stages], cut) for stages, cut in loops]
        else:
            self._groups = [_Group([stage], np.zeros(0, dtype=np.int64)) for stage in events.stages]
        self._simultaneous = isinstance(algorithm, Jacobi)
        if self._simultaneous:  # those that cannot go back step last, to where the others have come
            self._groups.sort(key=lambda group: not group.can_go_back)
        self._leads = InputLeads(events, self.gather, self._simultaneous)

    def gather(self, stage: Stage) -> None:
        """Fill the input slots of a stage for the present communication step."""
        gather(stage, self.view, self.table, self._column)

    def run(self, steps: int, rows: Array, record: Slots) -> None:
        """Run ``steps`` communication steps; a row holds the values after the events at its time.

        ``rows``: results, shape (steps + 1, recorded); row 0 is already there.
        """
        time = self.start
        for n in range(steps):
            end = self.start + (n + 1) * self.algorithm.step
            self._column = n + 1
            try:
                self.events.catch_up(time, self.gather)
                while end - time > slack(end):
                    due = self.events.next_time()
                    time, event = self._cross(time, due if due < end - slack(end) else end)
                    self.events.raise_end(time)
                    self._ticks.put(time, self.table, self._column)
                    if self._late and not event:
                        self.events.jump(time, self.gather)
                    self._late = False
                    self.events.catch_up(time, self.gather, event)
            except RunEndedError as error:
                if error.is_at(end):
                    np.take(self.values, record, out=rows[n + 1], mode="clip")
                raise
            time = end
            np.take(self.values, record, out=rows[n + 1], mode="clip")

    def _cross(self, begin: float, end: float) -> tuple[float, bool]:
        """Take all slaves to ``end`` [s] or to the first event; return where they are, and whether there is one."""
        for group in self._groups:
            group.save(begin)
        values = self.values.copy()
        self._leads.begin(values)
        try:
            return self._meet(begin, end, values)
        finally:
            for group in self._groups:
                group.free()

    def _meet(self, begin: float, end: float, values: Array) -> tuple[float, bool]:
        """Step all groups, and take those that are beyond an event back to it; ``values`` are those at ``begin``."""
        for _ in range(MOST_SHORTENINGS):
            end = self._pass(begin, end, values)
            beyond = [group for group in self._groups if group.at > end + slack(end)]
            if not beyond:
                return end, any(group.event for group in self._groups)
            self.undone += 1
            fixed = max((group for group in beyond if not group.can_go_back), key=lambda g: g.at, default=None)
            if fixed is not None:
                self.events.late_for, end = fixed.stages[0].name, fixed.at
                self._go_on_alone(begin, end)
            for group in beyond:
                if group.at > end + slack(end):
                    group.restore(begin)
        raise ConvergenceError(f"t = {begin:.9g} s: a window must end at an event, but slaves stop ever earlier")

    def _pass(self, begin: float, end: float, values: Array) -> float:
        """Step the groups that are at the begin of the window; return the first time at which one stopped [s]."""
        self.passes += 1
        self.values[:] = values
        if self._simultaneous:
            for stage in self.events.stages:
                self.gather(stage.stage)
        for group in self._groups:
            if not group.moved and end - begin > slack(end):
                self._advance(group, begin, end)
                end = min(end, group.at)
            elif group.moved:
                group.show(self.values)
        return end

    def _advance(self, group: _Group, begin: float, end: float) -> None:
        """Step a group that is at the begin of the window towards ``end`` [s]."""
        if len(group.cut):
            self._solve(group, begin, end)
        else:
            stage = group.stages[0]
            outcome = self._step(stage, begin, end)
            group.at, group.event = outcome.reached, outcome.event
        group.keep(self.values)

    def _step(self, stage: EventStage, begin: float, end: float) -> StepOutcome:
        last: Array | None = None
        if stage.inside:
            last = self._leads.lead(stage, begin, end)
        elif not self._simultaneous:
            self.gather(stage.stage)
        stage.send()
        outcome = stage.step(begin, end)
        stage.receive()
        self._leads.note(stage)
        if last is not None:
            self.values[stage.inputs] = last
        return outcome

    def _solve(self, group: _Group, begin: float, end: float) -> None:
        """Step a loop until what it exchanges settles, to where the first of its slaves stops."""
        assert isinstance(self.algorithm, Iterated)
        before = self.values.copy()
        for _ in range(MOST_SHORTENINGS):
            try:
                self._iterate(group, begin, end)
            except _StoppedError as stop:
                end = stop.outcome.reached
                self.undone += 1
                if end - begin > slack(end):
                    group.restore(begin)
                    self.values[:] = before
                    continue
                for stage, state in zip(group.stages, group.states, strict=True):
                    if stage is not stop.stage:  # which has an event at the begin of the window
                        stage.slave.set_state(state)
                        self.values[stage.outputs] = before[stage.outputs]
                group.event = stop.outcome.event
            group.at = end
            return
        raise ConvergenceError(f"t = {begin:.9g} s: a window must end at an event, but slaves stop ever earlier")

    def _iterate(self, group: _Group, begin: float, end: float) -> None:
        algorithm, first = self.algorithm, True
        assert isinstance(algorithm, Iterated)

        def sweep(point: Array) -> Array:
            nonlocal first
            if not first:
                group.restore(begin)
                self.passes += 1
            first = False
            self.values[group.cut] = point
            for stage in group.stages:
                outcome = self._step(stage, begin, end)
                if outcome.reached < end:
                    raise _StoppedError(stage, outcome)
                group.event |= outcome.event
            return self.values[group.cut]

        what = f"{', '.join(stage.name for stage in group.stages)} at t = {begin:g} s"
        solve_fixed_point(sweep, self.values[group.cut], algorithm.tolerance, algorithm.iterations, what)

    def _go_on_alone(self, begin: float, end: float) -> None:
        """Take the slaves that stopped before ``end`` [s] there, each through its events by itself."""
        for group in self._groups:
            if not group.moved or group.at >= end - slack(end):
                continue
            group.show(self.values)
            for stage in group.stages:
                time, event = group.at, group.event
                for _ in range(MOST_EVENTS):
                    if event:
                        self.events.late.append(end - time)
                        self.events.settle_alone(stage, time)
                        self._late = True
                    outcome = stage.step(time, min(end, max(stage.next_event, time + slack(time))))
                    time, event = outcome.reached, outcome.event or stage.next_event <= outcome.reached
                    if time >= end - slack(end):
                        break
                else:
                    raise ChatteringError(f"{stage.name}: at most {MOST_EVENTS} events must come within a step")
                stage.receive()
            group.at, group.event = end, event
            group.keep(self.values)
