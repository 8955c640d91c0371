"""The two halves of a drivetrain in Python, straight from the FMUs' sources, as slaves with events."""

from collections.abc import Callable, Sequence
from typing import Any

from orchestrator.master.protocol import EventUpdate, ModelInterface, Signals, StepOutcome, Transfer, Value, Variable
from orchestrator.master.signals import Signal, Square
from orchestrator.master.system import Connection, Instance, SignalSource, System
from pyfmu_sources.halves.load_half_slave import LoadHalf
from pyfmu_sources.halves.motor_half_slave import MotorHalf
from tests.support.mock_slave import MockSlave

TORQUE = Square(amplitude=40.0, period=0.8)
NO_EVENT = -1


def _model(kind: Any) -> ModelInterface:
    variables = {
        v.name: Variable(
            v.name, v.causality, v.type, start=v.start if v.start is not None else 0.0, reference=k,
            variability="continuous" if v.type == "Real" else "discrete",
        )
        for k, v in enumerate(kind.table)
    }  # fmt: skip
    feedthrough = {v.name: frozenset(v.depends_on or ()) for v in kind.table if v.causality == "output"}
    return ModelInterface(
        kind.__name__,
        variables,
        {},
        feedthrough,
        has_events=True,
        output_derivatives=1,
        inputs_inside_steps=frozenset(v.name for v in kind.table if v.causality == "input"),
    )


MODELS = {kind: _model(kind) for kind in (MotorHalf, LoadHalf)}


class HalfSlave(MockSlave):
    """One half in event mode; inputs inside steps are taken at the middle and at the end, as the FMU does."""

    def __init__(self, name: str, kind: Any, calls: list[str] | None = None) -> None:
        self._kind = kind
        self._make()
        super().__init__(name, MODELS[kind], lambda values, time, step: None, None, calls)

    def _make(self) -> None:
        self._half = self._kind()
        self._half.setup_experiment(0.0)
        self._half.enter_initialization_mode()
        self._feed: tuple[Sequence[str], Callable[[float], Sequence[float]] | None] = ((), None)

    def _references(self, names: Sequence[str]) -> list[int]:
        return [self.model.variables[name].reference for name in names]

    def set(self, values: Any) -> None:
        self._log("set")
        self._half.set_real(self._references(list(values)), [float(v) for v in values.values()])

    def get(self, names: Sequence[str]) -> list[Value]:
        return [self._value(name) for name in names]

    def _value(self, name: str) -> float:
        variable = self.model.variables[name]
        if variable.type == "Integer":
            return float(self._half.get_integer([variable.reference])[0])
        return float(self._half.real[variable.reference])

    def sends(self, names: Sequence[str], buffer: Signals) -> Transfer:
        references = self._references(names)

        def send() -> None:
            self._log("send")
            for reference, value in zip(references, buffer.tolist(), strict=True):
                self._half.real[reference] = value

        return send

    def receives(self, names: Sequence[str], buffer: Signals) -> Transfer:
        def receive() -> None:
            self._log("receive")
            for k, name in enumerate(names):
                buffer[k] = self._value(name)

        return receive

    def start(self) -> None:
        self._log("start")
        self._half.exit_initialization_mode()

    def reset(self) -> None:
        self._log("reset")
        self._make()

    def get_state(self) -> Any:
        self._log("get_state")
        return dict(self._half.real), dict(self._half.integer), self._half.saved()

    def set_state(self, state: Any) -> None:
        self._log("set_state")
        real, integer, hidden = state
        self._half.real.update(real)
        self._half.integer.update(integer)
        self._half.restore(hidden)

    def step(self, time: float, step: float) -> StepOutcome:
        self._log("step")
        half = self._half
        names, fed = self._feed
        if fed is None:
            taken = half.advance_to_event(time, step)
            return StepOutcome(time + taken, half._event != NO_EVENT)
        references, nodes = self._references(names), []
        for k in range(3):
            if k:
                for reference, value in zip(references, fed(time + 0.5 * k * step), strict=True):
                    half.real[reference] = value
            nodes.append([half.real[reference] for reference in references])
            if self._kind is LoadHalf:
                half.take_node(k)
        if self._kind is LoadHalf:
            taken = half.advance_along(time, step, True)
            return StepOutcome(time + step if taken == step else time + taken, half._event != NO_EVENT)
        for side in (-1.0, 1.0):
            for k, reference in enumerate(references):
                begin, middle, end = (node[k] for node in nodes)
                half.real[reference] = (begin + 4.0 * middle + end) / 6.0 + side * (end - begin) / 3.0
            half.advance(time, 0.5 * step)
        for reference, value in zip(references, nodes[2], strict=True):
            half.real[reference] = value
        return StepOutcome(time + step, False)

    def enter_event_mode(self) -> None:
        self._log("enter_event_mode")

    def update_discrete_states(self) -> EventUpdate:
        self._log("update_discrete_states")
        self._half.update(0.0)
        return EventUpdate()

    def leave_event_mode(self) -> None:
        self._log("leave_event_mode")

    def feed(self, names: Sequence[str], values: Callable[[float], Sequence[float]] | None) -> None:
        self._log("feed")
        self._feed = names, values

    def output_rates(self, names: Sequence[str], order: int = 1) -> list[float]:
        self._log("output_rates")
        rates = dict(zip(self._kind.response_outputs, self._half.output_rates(), strict=True))
        return [rates[name] for name in names]


def halves(alpha: float, signal: Signal = TORQUE, calls: list[str] | None = None) -> System:
    """Return both halves, coupled."""
    instances = (
        Instance("motor", MODELS[MotorHalf], lambda name: HalfSlave(name, MotorHalf, calls)),
        Instance("load", MODELS[LoadHalf], lambda name: HalfSlave(name, LoadHalf, calls), {"alpha": alpha}),
    )
    connections = (
        Connection("motor.theta_m", "load.theta_m"),
        Connection("motor.omega_m", "load.omega_m"),
        Connection("load.T_shaft", "motor.T_shaft"),
    )
    return System(instances, connections, (SignalSource("motor.u", signal),))
