"""Slaves made of plain functions, so that masters are tested without FMUs."""

import copy
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from orchestrator.errors import SlaveError
from orchestrator.master.protocol import ModelInterface, Signals, Transfer, Unit, Value, Variable
from orchestrator.master.system import Instance

Step = Callable[[dict[str, Any], float, float], None]
Outputs = Callable[[dict[str, Any]], None]


def variable(
    name: str, causality: str, start: Value = 0.0, unit: str | None = None, kind: str = "Real", **more: Any
) -> Variable:
    """Return a variable with a start value."""
    return Variable(name, causality, kind, unit, start=start, **more)


def model(
    name: str,
    *variables: Variable,
    feedthrough: Mapping[str, Sequence[str]] | None = None,
    units: Sequence[Unit] = (),
    **more: Any,
) -> ModelInterface:
    """Return a model; ``feedthrough=None`` means that no output depends on an input at once."""
    outputs = [v.name for v in variables if v.causality == "output"]
    direct = {o: frozenset((feedthrough or {}).get(o, ())) for o in outputs}
    return ModelInterface(name, {v.name: v for v in variables}, {u.name: u for u in units}, direct, **more)


class MockSlave:
    """A slave whose state is a dict: ``step(values, time, step)`` changes it, ``outputs(values)`` refreshes outputs.

    ``calls`` records the names of all calls, for tests of the call order.
    """

    def __init__(
        self,
        name: str,
        model: ModelInterface,
        step: Step,
        outputs: Outputs | None = None,
        calls: list[str] | None = None,
    ) -> None:
        self.name, self.model = name, model
        self._step, self._outputs = step, outputs or (lambda values: None)
        self.calls = [] if calls is None else calls
        self.values = self._fresh()
        self.closed = False

    def _fresh(self) -> dict[str, Any]:
        return {v.name: v.start for v in self.model.variables.values()}

    def _log(self, call: str) -> None:
        self.calls.append(f"{self.name}.{call}")
        if self.closed:
            raise SlaveError(f"{self.name}: {call} after close")

    def set(self, values: Mapping[str, Value]) -> None:
        self._log("set")
        self.values.update(values)

    def get(self, names: Sequence[str]) -> list[Value]:
        return [self.values[name] for name in names]

    def sends(self, names: Sequence[str], buffer: Signals) -> Transfer:
        def send() -> None:
            self._log("send")
            for name, value in zip(names, buffer.tolist(), strict=True):
                self.values[name] = value

        return send

    def receives(self, names: Sequence[str], buffer: Signals) -> Transfer:
        def receive() -> None:
            self._log("receive")
            self._outputs(self.values)
            for k, name in enumerate(names):
                buffer[k] = self.values[name]

        return receive

    def begin(self, start: float, stop: float | None, tolerance: float | None) -> None:
        self._log("begin")

    def start(self) -> None:
        self._log("start")

    def do_step(self, time: float, step: float) -> None:
        self._log("do_step")
        self._step(self.values, time, step)

    def get_state(self) -> Any:
        self._log("get_state")
        return copy.deepcopy(self.values)

    def set_state(self, state: Any) -> None:
        self._log("set_state")
        self.values = copy.deepcopy(state)

    def free_state(self, state: Any) -> None:
        self._log("free_state")

    def terminate(self) -> None:
        self._log("terminate")

    def reset(self) -> None:
        self._log("reset")
        self.values = self._fresh()

    def close(self) -> None:
        self.closed = True


def instance(
    name: str,
    model: ModelInterface,
    step: Step,
    outputs: Outputs | None = None,
    calls: list[str] | None = None,
    **start: Value,
) -> Instance:
    """Return an instance that makes mock slaves."""
    return Instance(name, model, lambda called: MockSlave(called, model, step, outputs, calls), start)
