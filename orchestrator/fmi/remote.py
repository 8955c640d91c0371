"""An FMU instance in a process of its own, as a slave of this one: for FMUs that allow one instance a process."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.errors import ChildError, SlaveError
from orchestrator.fmi.event_slave3 import EventFmuSlave
from orchestrator.fmi.instances import make_slave
from orchestrator.fmi.model_description import FmuDescription
from orchestrator.fmi.model_exchange import ExchangeSlave
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
from orchestrator.master.result import RunRemark, read_remarks
from orchestrator.shared.isolation.jail import Jail
from orchestrator.shared.isolation.limits import Limits

DONE, DISCARDED, ENDED = range(3)


def open_instance(request: tuple[str, Path, FmuDescription]) -> Callable[[tuple[str, list[Any]]], Any]:
    """Make the instance in the child, and return what calls it.

    Returns:
        Called with a method's name and arguments, it gives what that returns.
    """
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
        transfer, buffer = self._transfers[number]
        buffer[:] = values  # variables of clocks keep their values between ticks
        transfer()
        return buffer

    def do_step(self, time: float, step: float) -> list[Any]:
        return self._outcome_of(lambda: self._slave.do_step(time, step))

    def step(self, time: float, step: float) -> list[Any]:
        assert isinstance(self._slave, (EventFmuSlave, ExchangeSlave))
        slave, found = self._slave, [StepOutcome(time, False)]
        said = self._outcome_of(lambda: found.append(slave.step(time, step)))
        return [said, found[-1].reached, found[-1].event, found[-1].ends_run]

    @staticmethod
    def _outcome_of(advance: Callable[[], None]) -> list[Any]:
        """Do a step; return how it went: a code, what was said, when, and how the run is to end."""
        try:
            advance()
        except RunEndedError as error:
            return [ENDED, str(error), error.time, error.how]
        except StepDiscardedError as error:
            return [DISCARDED, str(error), error.time, ""]
        return [DONE, "", 0.0, ""]

    def update_discrete_states(self) -> list[Any]:
        assert isinstance(self._slave, (EventFmuSlave, ExchangeSlave))
        update = self._slave.update_discrete_states()
        return [update.again, update.next_event, update.ends_run]

    def active_clocks(self) -> list[str]:
        assert isinstance(self._slave, (EventFmuSlave, ExchangeSlave))
        return sorted(self._slave.active_clocks())

    def get_state(self) -> int:
        number = max(self._states, default=0) + 1
        self._states[number] = self._slave.get_state()
        return number

    def set_state(self, number: int) -> None:
        self._slave.set_state(self._states[number])

    def free_state(self, number: int) -> None:
        self._slave.free_state(self._states.pop(number))

    def remarks(self) -> list[list[Any]]:
        return [[r.instance, r.text, r.count] for r in self._slave.take_remarks()]


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

    def _ask(self, method: str, *arguments: Any) -> Any:
        try:
            return self._jail.call((method, list(arguments)))
        except SlaveError as error:
            raise SlaveError(f"{error}{self._jail.describe_printed()}") from None
        except ChildError as error:
            raise SlaveError(f"{self.name}: {method} must come to its end, but {error}") from None

    def set(self, values: Mapping[str, Value]) -> None:
        self._ask("set", dict(values))

    def get(self, names: Sequence[str]) -> list[Value]:
        return list(self._ask("get", list(names)))

    def sends(self, names: Sequence[str], buffer: Signals) -> Transfer:
        number = self._ask("bind", "sends", list(names))
        return lambda: self._ask("send", number, buffer.copy())

    def receives(self, names: Sequence[str], buffer: Signals) -> Transfer:
        number = self._ask("bind", "receives", list(names))

        def receive() -> None:
            values = self._ask("receive", number, buffer.copy())
            if not (isinstance(values, np.ndarray) and values.shape == buffer.shape and values.dtype == np.float64):
                raise SlaveError(f"{self.name}: its process must return {len(names)} values, but does not")
            buffer[:] = values

        return receive

    def begin(self, start: float, stop: float | None, tolerance: float | None) -> None:
        self._ask("begin", start, stop, tolerance)

    def start(self) -> None:
        self._ask("start")

    def do_step(self, time: float, step: float) -> None:
        self._judge(self._ask("do_step", time, step))

    def _judge(self, said: Any) -> None:
        """Raise for a step that was not done, by what the child says of it."""
        match said:
            case [int() as status, str() as text, float() as reached, str() as how]:
                if status == ENDED:
                    raise RunEndedError(text, self.name, reached, how)
                if status != DONE:
                    raise StepDiscardedError(text, self.name, reached)
            case _:
                raise SlaveError(f"{self.name}: its process must say how a step went, but does not")

    def get_state(self) -> Any:
        return self._ask("get_state")

    def set_state(self, state: Any) -> None:
        self._ask("set_state", state)

    def free_state(self, state: Any) -> None:
        self._ask("free_state", state)

    def terminate(self) -> None:
        self._ask("terminate")

    def reset(self) -> None:
        self._ask("reset")

    def take_remarks(self) -> list[RunRemark]:
        """Return warnings and shortened steps since this was last asked."""
        return list(read_remarks(self._ask("remarks")))

    def shorten_steps(self) -> bool:
        """Do steps that the FMU discards in shorter ones, from the next run on.

        Returns:
            Whether the FMU can, and this is new.
        """
        return bool(self._ask("shorten_steps"))

    def close(self) -> None:
        self._jail.close()


class EventRemoteSlave(RemoteSlave, EventSlave):
    """One instance with events; see ``EventSlave``. Its inputs are held over a step, for a step is one call here."""

    def step(self, time: float, step: float) -> StepOutcome:
        match self._ask("step", time, step):
            case [list() as said, float() as reached, bool() as event, str() as ends_run]:
                self._judge(said)
                return StepOutcome(reached, event, ends_run)
        raise SlaveError(f"{self.name}: its process must say how a step went, but does not")

    def enter_event_mode(self) -> None:
        self._ask("enter_event_mode")

    def tick(self, clocks: Sequence[str]) -> None:
        self._ask("tick", list(clocks))

    def active_clocks(self) -> frozenset[str]:
        return frozenset(str(name) for name in self._ask("active_clocks"))

    def update_discrete_states(self) -> EventUpdate:
        match self._ask("update_discrete_states"):
            case [bool() as again, (float() | None) as next_event, bool() as ends_run]:
                return EventUpdate(again, next_event, ends_run)
        raise SlaveError(f"{self.name}: its process must say what an event led to, but does not")

    def leave_event_mode(self) -> None:
        self._ask("leave_event_mode")

    def feed(self, names: Sequence[str], values: Callable[[float], Sequence[float]] | None) -> None:
        if values is not None:
            raise SlaveError(f"{self.name}: inputs must be held over steps in a process of its own, but are fed")

    def output_rates(self, names: Sequence[str], order: int = 1) -> list[float]:
        return [float(rate) for rate in self._ask("output_rates", list(names), order)]


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
        """Return a new slave called ``name``."""
        kind = EventRemoteSlave if self.description.model.has_events else RemoteSlave
        return kind(name, self.folder, self.description, self.limits, self.walls)
