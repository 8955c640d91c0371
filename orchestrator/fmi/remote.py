"""An FMU instance in a process of its own, as a slave of this one: for FMUs that allow one instance a process."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from orchestrator.errors import ChildError, SlaveError
from orchestrator.fmi.instances import make_slave
from orchestrator.fmi.model_description import FmuDescription
from orchestrator.fmi.slave import FmuSlave
from orchestrator.master.protocol import (
    EventSlave,
    EventUpdate,
    ModelInterface,
    RunEndedError,
    Signals,
    Slave,
    StepDiscardedError,
    StepOutcome,
    Transfer,
    Value,
)
from orchestrator.master.result import MOST_REMARKS, RunRemark
from orchestrator.shared.arrays import Array
from orchestrator.shared.isolation.jail import Answer, Jail
from orchestrator.shared.isolation.limits import Limits

NOTHING = type(None)


class Undone(NamedTuple):
    """Why a step was not done; see ``StepDiscardedError``, and ``RunEndedError`` where ``how`` is not empty."""

    text: str
    time: float
    reached: float | None
    how: str


def open_instance(request: tuple[str, Path, FmuDescription]) -> Callable[[tuple[str, tuple[Any, ...]]], Any]:
    """Make the instance in the child; return what calls its methods, given a name and arguments."""
    host = _Host(make_slave(*request))
    return lambda asked: getattr(host, asked[0])(*asked[1])


class _Host:
    """The child's side: buffers of the transfers, and states by number."""

    def __init__(self, slave: FmuSlave) -> None:
        self._slave = slave
        self._transfers: list[tuple[Transfer, Signals]] = []
        self._states: dict[int, Any] = {}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._slave, name)

    def bind(self, direction: str, names: list[str]) -> int:
        buffer = np.zeros(len(names))
        self._transfers.append((getattr(self._slave, direction)(names, buffer), buffer))
        return len(self._transfers) - 1

    def send(self, number: int, values: Signals) -> None:
        transfer, buffer = self._transfers[number]
        buffer[:] = values
        transfer()

    def receive(self, number: int, values: Signals) -> Signals:
        self.send(number, values)  # variables of clocks keep their values between ticks
        return self._transfers[number][1]

    def do_step(self, time: float, step: float) -> tuple[StepOutcome | None, Undone | None]:
        return self._advance("do_step", time, step)

    def step(self, time: float, step: float) -> tuple[StepOutcome | None, Undone | None]:
        return self._advance("step", time, step)

    def _advance(self, method: str, time: float, step: float) -> tuple[StepOutcome | None, Undone | None]:
        try:
            return getattr(self._slave, method)(time, step), None
        except StepDiscardedError as error:
            return None, Undone(str(error), error.time, error.reached, getattr(error, "how", ""))

    def get_state(self) -> int:
        number = max(self._states, default=0) + 1
        self._states[number] = self._slave.get_state()
        return number

    def set_state(self, number: int) -> None:
        self._slave.set_state(self._states[number])

    def free_state(self, number: int) -> None:
        self._slave.free_state(self._states.pop(number))


def _remote(method: str, answer: type = NOTHING) -> Callable[..., Any]:
    """Return a method of a slave that its process carries out."""

    def ask(slave: "RemoteSlave", *arguments: Any) -> Any:
        return slave._ask(answer, method, *arguments)

    return ask


class RemoteSlave(Slave):
    """One instance; see ``Slave`` for the order of calls.

    Args:
        walls: whether the kernel shall keep it from files, network and other processes.
    """

    def __init__(self, name: str, folder: Path, description: FmuDescription, limits: Limits, walls: bool) -> None:
        self.name = name
        self.model: ModelInterface = description.model
        entry = "orchestrator.fmi.remote:open_instance"
        self._jail = Jail(entry, (name, folder, description), read=[folder], limits=limits, walls=walls)
        try:
            self._jail.start(limits.time)
        except BaseException:
            self._jail.close()
            raise

    def _ask(self, answer: type[Answer], method: str, *arguments: Any) -> Answer:
        try:
            return self._jail.call((method, arguments), answer)
        except ChildError as error:
            raise SlaveError(f"{self.name}, {method}: {error.explain('the run')}", "time_limit") from None

    def set(self, values: Mapping[str, Value]) -> None:
        self._ask(NOTHING, "set", dict(values))

    def get(self, names: Sequence[str]) -> list[Value]:
        return self._ask(list[Value], "get", list(names))

    def sends(self, names: Sequence[str], buffer: Signals) -> Transfer:
        number = self._ask(int, "bind", "sends", list(names))
        return lambda: self._ask(NOTHING, "send", number, buffer)

    def receives(self, names: Sequence[str], buffer: Signals) -> Transfer:
        number = self._ask(int, "bind", "receives", list(names))

        def receive() -> None:
            values = self._ask(Array, "receive", number, buffer)
            if values.shape != buffer.shape:
                raise SlaveError(f"{self.name}: its process must return {len(names)} values, but does not")
            buffer[:] = values

        return receive

    begin, start, terminate, reset = map(_remote, ("begin", "start", "terminate", "reset"))
    get_state = _remote("get_state", int)
    set_state, free_state = map(_remote, ("set_state", "free_state"))

    def do_step(self, time: float, step: float) -> None:
        self._advance("do_step", time, step)

    def _advance(self, method: str, time: float, step: float) -> StepOutcome | None:
        """Do a step; return its outcome, where it has one."""
        outcome, undone = self._ask(tuple[StepOutcome | None, Undone | None], method, time, step)
        if undone is None:
            return outcome
        if undone.how:
            raise RunEndedError(undone.text, self.name, undone.time, undone.how)
        raise StepDiscardedError(undone.text, self.name, undone.time, undone.reached)

    def take_remarks(self) -> list[RunRemark]:
        return self._ask(list[RunRemark], "take_remarks")[:MOST_REMARKS]

    def close(self) -> None:
        self._jail.close()


class EventRemoteSlave(RemoteSlave, EventSlave):
    """One instance with events; see ``EventSlave``. Its inputs are held over a step, for a step is one call here."""

    def step(self, time: float, step: float) -> StepOutcome:
        outcome = self._advance("step", time, step)
        if outcome is None:
            raise SlaveError(f"{self.name}: its process must say how a step went, but does not")
        return outcome

    enter_event_mode, leave_event_mode = map(_remote, ("enter_event_mode", "leave_event_mode"))
    update_discrete_states = _remote("update_discrete_states", EventUpdate)
    active_clocks = _remote("active_clocks", frozenset[str])

    def tick(self, clocks: Sequence[str]) -> None:
        self._ask(NOTHING, "tick", list(clocks))

    def feed(self, names: Sequence[str], values: Callable[[float], Sequence[float]] | None) -> None:
        if values is not None:
            raise SlaveError(f"{self.name}: inputs must be held over steps in a process of its own, but are fed")

    def output_rates(self, names: Sequence[str], order: int = 1) -> list[float]:
        return self._ask(list[float], "output_rates", list(names), order)


def without_feed(description: FmuDescription) -> FmuDescription:
    """Return the description of an FMU whose instances run in processes of their own."""
    return replace(description, model=replace(description.model, inputs_inside_steps=frozenset()))


@dataclass(frozen=True)
class RemoteFactory:
    """Makes slaves of the FMU unpacked in ``folder``, each in a process of its own; see ``RemoteSlave``."""

    folder: Path
    description: FmuDescription
    limits: Limits
    walls: bool

    def __call__(self, name: str) -> RemoteSlave:
        kind = EventRemoteSlave if self.description.model.has_events else RemoteSlave
        return kind(name, self.folder, self.description, self.limits, self.walls)
