"""One instance of a system with events: which of its signals move when, and how it is stepped."""

import math
from collections.abc import Callable, Sequence
from typing import cast

import numpy as np

from orchestrator.errors import SlaveError
from orchestrator.master.protocol import AT_EVENT, EventSlave, RunEndedError, Signals, StepOutcome, Variable
from orchestrator.master.wiring import Stage, bind_receive, bind_send

Gather = Callable[[Stage], None]
"""Fills a stage's input slots from outputs and sources."""


def slack(time: float) -> float:
    """Return the distance [s] below which instants about ``time`` [s] are one: some roundings of time."""
    return 1e-12 * max(1.0, abs(time))


def is_discrete(variable: Variable) -> bool:
    """Return whether a variable changes at events alone."""
    return variable.type != "Real" or variable.variability == "discrete"


def _is_smooth(variable: Variable) -> bool:
    return variable.causality == "output" and not is_discrete(variable) and variable.variability == "continuous"


class EventStage:
    """One instance of a system with events; its slave may have none.

    Attributes:
        steps: calls that asked the slave for a step.
        can_go_back: it can be taken back to a saved state, and step to any time from there.
        names: of the inputs that it takes at steps: the continuous ones; of a slave without events all.
        inside: those that it can be told inside a step.
        places: of these among ``names``.
        rated: outputs whose derivatives it knows.
        follows: outputs that depend on an input of ``names`` at once.
        next_event: [s], as the slave said last; infinity where it knows of none.
        ends_run: what asks for the end of the run where the slave is; empty: nothing does.
    """

    def __init__(self, stage: Stage, values: Signals) -> None:
        self.stage, self.block, self.slave = stage, stage.block, stage.slave
        model, block = self.slave.model, stage.block
        self.name, self.has_events = block.name, model.has_events
        self.can_go_back = model.can_save_state and model.can_vary_step
        self.outputs = slice(block.first_output, block.first_output + len(block.outputs))
        self.next_event, self.steps, self.ends_run = math.inf, 0, ""
        self.send, self.receive = stage.send, stage.receive
        self._take_inputs(block.inputs)
        self.rated: list[str] = []
        self.rate_slots = np.empty(0, dtype=np.int64)
        self._values = values
        self._clocks: dict[str, tuple[Callable[[], None], Callable[[], None]]] = {}
        self._sent = np.empty(0)
        if not self.has_events:
            return
        self.events = cast(EventSlave, self.slave)
        clocked = model.clocked
        free = [name for name in block.inputs if name not in clocked]
        discrete = [name for name in free if is_discrete(model.variables[name])]
        places = {name: block.first_input + k for k, name in enumerate(block.inputs)}
        self._discrete = np.array([places[name] for name in discrete], dtype=np.int64)
        self._take_inputs([name for name in free if name not in discrete])
        self.send = bind_send(self.slave, block, self.names, values)
        if model.output_derivatives:
            self.rated = [n for n in block.outputs if n not in clocked and _is_smooth(model.variables[n])]
            slots = [block.first_output + block.outputs.index(name) for name in self.rated]
            self.rate_slots = np.array(slots, dtype=np.int64)
        self._send_discrete = bind_send(self.slave, block, discrete, values)
        for name, clock in model.input_clocks.items():
            inputs = [v for v in block.inputs if v in clock.variables]
            outputs = [v for v in block.outputs if v in clock.variables]
            self._clocks[name] = (
                bind_send(self.slave, block, inputs, values),
                bind_receive(self.slave, block, outputs, values),
            )

    def _take_inputs(self, names: Sequence[str]) -> None:
        """Take these inputs at steps."""
        block, model = self.block, self.slave.model
        self.names = tuple(names)
        self.feeds = [block.feeds[block.inputs.index(name)] for name in names]
        self.inputs = np.array([feed.slot for feed in self.feeds], dtype=np.int64)
        self.inside = [name for name in names if self.has_events and name in model.inputs_inside_steps]
        self.places = [self.names.index(name) for name in self.inside]
        outputs = [name for name in block.outputs if model.variables[name].causality == "output"]
        self.follows = {name for name in outputs if not model.depends_on(name).isdisjoint(names)}

    def read_rates(self, rates: Signals) -> None:
        """Read the derivatives of the outputs where the slave is."""
        if self.rated:
            rates[self.rate_slots] = self.events.output_rates(self.rated)

    def step(self, begin: float, end: float) -> StepOutcome:
        """Step from ``begin`` towards ``end`` [s]. Return where it ended; ``end`` itself where rounding misses it."""
        self.steps += 1
        self.ends_run = ""
        if not self.has_events:
            try:
                self.stage.do_step(begin, end - begin)
            except RunEndedError as error:
                if not error.is_at(end):
                    raise
                self.ends_run = error.how
            return StepOutcome(end, False)
        found = self.events.step(begin, end - begin)
        self.ends_run = found.ends_run
        if not found.reached >= begin - slack(begin):
            raise SlaveError(f"{self.name}: a step from t = {begin:g} s must go on, but ended at {found.reached:g} s")
        return StepOutcome(end, found.event) if found.reached >= end - slack(end) else found

    def exchange(self, gather: Gather, clocks: Sequence[str]) -> None:
        """Take inputs and show outputs, in event mode."""
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
        """Return whether a discrete input has another value than the slave has, which it takes at events alone."""
        if not len(self._discrete):
            return False
        gather(self.stage)
        return not np.array_equal(self._values[self._discrete], self._sent, equal_nan=True)

    def update(self) -> bool:
        """End an instant. Return whether the slave needs another."""
        found = self.events.update_discrete_states()
        self.next_event = math.inf if found.next_event is None else found.next_event
        self.ends_run = AT_EVENT if found.ends_run else ""
        return found.again

    def raise_end(self, time: float) -> None:
        """Raise ``RunEndedError`` where the slave wants the run to end, at ``time`` [s]."""
        if self.ends_run:
            raise RunEndedError(f"{self.name}: t = {time:g} s, {self.ends_run}", self.name, time, self.ends_run)
