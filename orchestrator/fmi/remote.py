"""An FMU instance in a process of its own, as a slave of this one: for FMUs that allow one instance a process."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from orchestrator.errors import ChildError, SlaveError
from orchestrator.fmi.instances import make_slave
from orchestrator.fmi.model_description import FmuDescription
from orchestrator.fmi.slave import FmuSlave
from orchestrator.master.protocol import (
    ModelInterface,
    RunEndedError,
    Signals,
    Slave,
    StepDiscardedError,
    Transfer,
    Value,
)
from orchestrator.master.result import RunRemark, claimed_remarks
from orchestrator.shared.isolation.jail import Jail
from orchestrator.shared.isolation.limits import Limits

DONE, DISCARDED, ENDED = range(3)


def opened(request: tuple[str, Path, FmuDescription]) -> Callable[[tuple[str, list[Any]]], Any]:
    """Make the instance in the child, and return what calls it.

    Args:
        request: name of the instance, folder of the unpacked FMU, its description.

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

    def receive(self, number: int) -> Signals:
        transfer, buffer = self._transfers[number]
        transfer()
        return buffer

    def step(self, time: float, step: float) -> list[Any]:
        try:
            self._slave.do_step(time, step)
        except StepDiscardedError as error:
            return [ENDED if isinstance(error, RunEndedError) else DISCARDED, str(error), error.time]
        return [DONE, "", time]

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
        name: of the instance.
        folder: of the unpacked FMU.
        description: of the FMU.
        limits: of its process.
        walls: whether the kernel shall keep it from files, network and other processes.

    Raises:
        FmuError: the FMU cannot be loaded or instantiated.
        SimulationError: no process can be started.
    """

    def __init__(self, name: str, folder: Path, description: FmuDescription, limits: Limits, walls: bool) -> None:
        self.name = name
        self.model: ModelInterface = description.model
        entry = "orchestrator.fmi.remote:opened"
        self._jail = Jail(entry, (name, folder, description), read=[folder], limits=limits, walls=walls)
        try:
            self._jail.start(limits.time)
        except BaseException:
            self._jail.close()
            raise

    def _ask(self, method: str, *arguments: Any) -> Any:
        try:
            return self._jail.call((method, list(arguments)))
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
            values = self._ask("receive", number)
            if not (isinstance(values, np.ndarray) and values.shape == buffer.shape and values.dtype == np.float64):
                raise SlaveError(f"{self.name}: its process must return {len(names)} values, but does not")
            buffer[:] = values

        return receive

    def begin(self, start: float, stop: float | None, tolerance: float | None) -> None:
        self._ask("begin", start, stop, tolerance)

    def start(self) -> None:
        self._ask("start")

    def do_step(self, time: float, step: float) -> None:
        match self._ask("step", time, step):
            case [int() as status, str() as text, float() as reached]:
                if status != DONE:
                    raise (RunEndedError if status == ENDED else StepDiscardedError)(text, self.name, reached)
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
        """Return warnings and shortened steps since this was last asked.

        Returns:
            The remarks.
        """
        return list(claimed_remarks(self._ask("remarks")))

    def shorten_steps(self) -> bool:
        """Do steps that the FMU discards in shorter ones, from the next run on.

        Returns:
            Whether the FMU can, and this is new.
        """
        return bool(self._ask("shorten_steps"))

    def close(self) -> None:
        self._jail.close()


@dataclass(frozen=True)
class RemoteFactory:
    """Makes slaves of the FMU unpacked in ``folder``, each in a process of its own; see ``RemoteSlave``."""

    folder: Path
    description: FmuDescription
    limits: Limits
    walls: bool

    def __call__(self, name: str) -> RemoteSlave:
        """Return a new slave called ``name``."""
        return RemoteSlave(name, self.folder, self.description, self.limits, self.walls)
