"""Slaves with events made of plain functions, so that masters are tested without FMUs."""

import copy
from collections.abc import Callable, Sequence
from typing import Any

from orchestrator.errors import SlaveError
from orchestrator.master.protocol import EventUpdate, ModelInterface, Signals, StepOutcome, Transfer, Value
from orchestrator.master.system import Instance
from tests.support.mock_slave import MockSlave

Move = Callable[[dict[str, Any], float, float], StepOutcome]
Update = Callable[[dict[str, Any]], EventUpdate]


def go(values: dict[str, Any], time: float, step: float) -> StepOutcome:
    """Let time pass."""
    values["time"] = time + step
    return StepOutcome(time + step, False)


def rest(values: dict[str, Any]) -> EventUpdate:
    """Change nothing."""
    return EventUpdate()


class MockEventSlave(MockSlave):
    """A slave whose ``move`` steps and whose ``update`` ends an instant; refuses calls out of order.

    ``values["active"]`` holds the clocks that are active, ``values["fed"]`` what ``feed`` was given.
    """

    def __init__(
        self,
        name: str,
        model: ModelInterface,
        move: Move = go,
        update: Update = rest,
        outputs: Callable[[dict[str, Any]], None] | None = None,
        calls: list[str] | None = None,
    ) -> None:
        self._move, self._update = move, update
        self._event_mode = False
        super().__init__(name, model, lambda values, time, step: None, outputs, calls)

    def _fresh(self) -> dict[str, Any]:
        return {**super()._fresh(), "active": [], "fed": {}, "time": 0.0}

    def _expect(self, event_mode: bool, call: str) -> None:
        self._log(call)
        if self._event_mode is not event_mode:
            raise SlaveError(f"{self.name}: {call} {'outside' if event_mode else 'in'} event mode")

    def sends(self, names: Sequence[str], buffer: Signals) -> Transfer:
        send = super().sends(names, buffer)
        clocked = [n for n in names if any(n in clock.variables for clock in self.model.clocks.values())]
        discrete = [n for n in names if self.model.variables[n].variability == "discrete"]

        def checked() -> None:
            self._check_clocks(clocked)
            if discrete and "start" in self.values and not self._event_mode:
                raise SlaveError(f"{self.name}: {discrete} set outside event mode")
            send()

        return checked

    def receives(self, names: Sequence[str], buffer: Signals) -> Transfer:
        receive = super().receives(names, buffer)
        clocked = [n for n in names if any(n in clock.variables for clock in self.model.clocks.values())]

        def checked() -> None:
            self._check_clocks(clocked)
            receive()

        return checked

    def _check_clocks(self, names: Sequence[str]) -> None:
        for name in names:
            if not any(name in self.model.clocks[clock].variables for clock in self.values["active"]):
                raise SlaveError(f"{self.name}: {name} belongs to a clock that is not active")

    def start(self) -> None:
        super().start()
        self._event_mode, self.values["start"] = True, True

    def reset(self) -> None:
        super().reset()
        self._event_mode = False

    def get_state(self) -> Any:
        self._expect(False, "get_state")
        return copy.deepcopy({k: v for k, v in self.values.items() if k != "fed"})

    def set_state(self, state: Any) -> None:
        self._expect(False, "set_state")
        self.values = {**copy.deepcopy(state), "fed": self.values["fed"]}

    def step(self, time: float, step: float) -> StepOutcome:
        self._expect(False, "step")
        return self._move(self.values, time, step)

    def enter_event_mode(self) -> None:
        self._expect(False, "enter_event_mode")
        self._event_mode = True

    def tick(self, clocks: Sequence[str]) -> None:
        self._expect(True, "tick")
        self.values["active"] = list(clocks)

    def update_discrete_states(self) -> EventUpdate:
        self._expect(True, "update_discrete_states")
        found = self._update(self.values)
        self.values["active"] = []
        return found

    def leave_event_mode(self) -> None:
        self._expect(True, "leave_event_mode")
        self._event_mode = False

    def feed(self, names: Sequence[str], values: Callable[[float], Sequence[float]] | None) -> None:
        self._log("feed")
        for name in names:
            self.values["fed"].pop(name, None)
        if values is not None:
            for k, name in enumerate(names):
                self.values["fed"][name] = lambda t, k=k: values(t)[k]

    def output_rates(self, names: Sequence[str], order: int = 1) -> list[float]:
        self._log("output_rates")
        return [float(self.values[f"der({name})"]) for name in names]


def event_instance(
    name: str,
    model: ModelInterface,
    move: Move = go,
    update: Update = rest,
    outputs: Callable[[dict[str, Any]], None] | None = None,
    calls: list[str] | None = None,
    **start: Value,
) -> Instance:
    """Return an instance that makes mock slaves with events; see ``MockEventSlave``."""
    return Instance(name, model, lambda called: MockEventSlave(called, model, move, update, outputs, calls), start)
