"""A system of instances and connections: structure only. Running it is the business of ``session``."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from orchestrator.master import units
from orchestrator.master.discrete import discrete_problem
from orchestrator.master.graph import components
from orchestrator.master.problems import Problem, raise_problems
from orchestrator.master.protocol import NUMERIC, READABLE, ModelInterface, Slave, Unit, Value, Variable
from orchestrator.master.signals import Signal
from orchestrator.master.values import coerce_value, nearest, types_fit


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number with the unit in which it is given."""

    value: float
    unit: str


Start = Mapping[str, Value | Quantity]


@dataclass(frozen=True)
class Instance:
    """One slave to be."""

    name: str  # without a dot, unique in the system
    model: ModelInterface
    create: Callable[[str], Slave]  # makes the slave, given the instance's name
    start: Start = field(default_factory=dict)  # parameters and start values by variable name
    solver_tolerance: float | None = None  # relative tolerance for the slave's own solver; None: its default
    resets: bool = True  # a reset is trusted to leave nothing of a run behind


@dataclass(frozen=True, slots=True)
class Connection:
    """``target = round_to(quantum, factor * source + offset)``, after the conversion of units."""

    source: str  # ``instance.variable`` of an output
    target: str  # ``instance.variable`` of an input
    factor: float = 1.0
    offset: float = 0.0  # in the target's unit
    # resolution of the target's sensor in the target's unit; 0 for none. Sources that feed the same target are added
    # before rounding
    quantum: float = 0.0
    unit: str | None = None  # unit that the source must have; ``None`` leaves it unchecked


@dataclass(frozen=True, slots=True)
class ClockConnection:
    """An input clock that ticks in the instants in which an output clock is active."""

    source: str  # ``instance.clock`` of an output clock
    target: str  # ``instance.clock`` of a triggered input clock


@dataclass(frozen=True, slots=True)
class SignalSource:
    """A signal that the master feeds into an input, added to what is connected to it."""

    target: str  # ``instance.variable`` of an input
    signal: Signal  # its values over time
    unit: str | None = None  # unit of the signal; ``None`` for the target's own
    # ``start`` or ``end`` of a communication step: which instant's value an instance gets for the step. ``None``: with
    # a connection, the instant of the connected value; else ``end`` where an output is declared to depend on the input
    # at once (a sampled-data block), ``start`` elsewhere (an input that is held)
    at: str | None = None


def split(address: str) -> tuple[str, str]:
    """Return instance and variable of ``instance.variable``; only the variable's name may contain dots."""
    instance, _, variable = address.partition(".")
    return instance, variable


@dataclass(frozen=True)
class System:
    """Instances, connections, sources and, when it shall not be derived, the order of execution."""

    instances: tuple[Instance, ...]  # in the order in which ties of the execution order are broken
    connections: tuple[Connection, ...] = ()  # from outputs to inputs
    sources: tuple[SignalSource, ...] = ()  # signals fed into inputs
    order: tuple[str, ...] = ()  # instance names; empty to derive the order from direct feedthrough
    clock_connections: tuple[ClockConnection, ...] = ()  # from output clocks to triggered input clocks

    def instance(self, name: str) -> Instance | None:
        """Return the instance called ``name``, if there is one."""
        return next((i for i in self.instances if i.name == name), None)

    def variable(self, address: str) -> Variable | None:
        """Return the variable at ``instance.variable``, if there is one."""
        name, variable = split(address)
        instance = self.instance(name)
        return None if instance is None else instance.model.variables.get(variable)

    def unit(self, address: str) -> Unit | None:
        """Return the unit of the variable at ``address``, if it has one."""
        variable = self.variable(address)
        instance = self.instance(split(address)[0])
        return None if variable is None or instance is None else units.unit_of(variable, instance.model.units)

    def loops(self) -> list[tuple[str, ...]]:
        """Return the algebraic loops: groups of instances whose outputs depend on one another at the same instant."""
        edges = self._feedthrough_edges()
        groups = components([i.name for i in self.instances], edges)
        return [g for g in groups if len(g) > 1 or g[0] in edges.get(g[0], ())]

    def execution_order(self) -> tuple[str, ...]:
        """Return the instance names so that what is computed first is what others depend on at the same instant.

        A connection orders two instances only if an output of the receiver depends on the input directly. An input
        that is held over a step, such as a plant's torque, orders nothing: plant, estimator, controller.
        """
        if self.order:
            return self.order
        groups = components([i.name for i in self.instances], self._feedthrough_edges())
        return tuple(name for group in groups for name in group)

    def has_feedthrough(self, address: str) -> bool:
        """Return whether the model declares that an output depends on this input at the same instant."""
        name, variable = split(address)
        instance = self.instance(name)
        return instance is not None and any(variable in inputs for inputs in instance.model.feedthrough.values())

    def _feedthrough_edges(self) -> dict[str, set[str]]:
        edges: dict[str, set[str]] = {i.name: set() for i in self.instances}
        for connection in self.connections:
            source, target = split(connection.source)[0], split(connection.target)
            instance = self.instance(target[0])
            if source in edges and instance is not None:
                outputs = instance.model.names_of("output")
                if any(target[1] in instance.model.depends_on(output) for output in outputs):
                    edges[source].add(target[0])
        return edges

    def problems(self) -> list[Problem]:
        """Return everything that is wrong with names, causalities, types, units, values and order; empty when sound."""
        found = self._instance_problems()
        driven: dict[str, int] = {}
        for k, connection in enumerate(self.connections):
            found += self._connection_problems(k, connection)
            if connection.target in driven:
                text = f"must be fed once, but {connection.target} is fed by connection {driven[connection.target]} too"
                found.append(Problem(f"$.connections[{k}].to", text, mismatch=True))
            driven.setdefault(connection.target, k)
        for k, source in enumerate(self.sources):
            found += self._source_problems(k, source)
        return found + self._order_problems()

    def check(self, origin: str = "") -> None:
        """Raise what ``problems`` finds, see ``raise_problems``."""
        raise_problems(self.problems(), origin)

    def start_value(self, address: str, value: Value | Quantity) -> tuple[Value | None, str | None]:
        """Return ``value`` as the variable at ``address`` takes it, or ``None`` and what is wrong with it."""
        variable = self.variable(address)
        if variable is None:
            return None, self._unknown(address)
        if variable.causality not in {"parameter", "input"} and (
            variable.start is None or variable.variability == "constant"
        ):
            return None, f"must name a parameter or a start value, but {address} is of causality {variable.causality}"
        if isinstance(value, Quantity):
            ratio = self.ratio(value.unit, address)
            if ratio is None:
                own = self.unit(address)
                name, why = ("no unit", "") if own is None else (own.name, units.contradiction(own))
                why += f", or give a plain number, in {name}" if why else ""
                return None, f"must be given in a unit that measures what {name} does, but is in {value.unit!r}{why}"
            value = ratio[0] * value.value + ratio[1]
        return coerce_value(variable, value)

    def ratio(self, unit: str, address: str) -> tuple[float, float] | None:
        """Return factor and offset from a unit to that of the variable at an address; None where there are none."""
        instance, own = self.instance(split(address)[0]), self.unit(address)
        if instance is None or own is None:
            return None
        return units.conversion(units.resolve(unit, instance.model.units), own)

    def _instance_problems(self) -> list[Problem]:
        found = []
        if not self.instances:
            found.append(Problem("$.instances", "must name at least one instance, but is empty"))
        names = [i.name for i in self.instances]
        for instance in self.instances:
            path = f"$.instances.{instance.name}"
            if not instance.name or "." in instance.name or names.count(instance.name) > 1:
                found.append(
                    Problem(path, f"name must be unique, not empty and without a dot, but is {instance.name!r}")
                )
            for variable, value in instance.start.items():
                text = self.start_value(f"{instance.name}.{variable}", value)[1]
                if text is not None:
                    found.append(Problem(f"{path}.parameters.{variable}", text))
        return found

    def _connection_problems(self, k: int, connection: Connection) -> list[Problem]:
        path = f"$.connections[{k}]"
        found = self._end_problems(f"{path}.from", connection.source, "output")
        found += self._end_problems(f"{path}.to", connection.target, "input")
        for name in ("factor", "offset", "quantum"):
            value = getattr(connection, name)
            if not math.isfinite(value) or (name == "quantum" and value < 0.0):
                least = "finite and not negative" if name == "quantum" else "finite"
                found.append(Problem(f"{path}.{name}", f"must be {least}, but is {value!r}"))
        if found:
            return found
        source, target = self.variable(connection.source), self.variable(connection.target)
        assert source is not None
        assert target is not None
        plain = connection.factor == 1.0 and connection.offset == 0.0 and connection.quantum == 0.0
        if not types_fit(source, target) or (target.type != "Real" and not plain):
            text = (
                f"must have type {source.type} like {connection.source}, but {connection.target} has type {target.type}"
            )
            if target.type != "Real" and not plain:
                text = f"factor, offset and quantum must be left out, but {connection.target} has type {target.type}"
            found.append(Problem(f"{path}.to", text, mismatch=True))
        return found + self._unit_problems(path, connection)

    def _unit_problems(self, path: str, connection: Connection) -> list[Problem]:
        source, target = self.unit(connection.source), self.unit(connection.target)
        if units.conversion(source, target) is None:
            assert source is not None
            assert target is not None
            text = units.describe_mismatch(source, target, f" of {connection.source}")
            return [Problem(f"{path}.to", text, mismatch=True)]
        if connection.unit is not None and (source is None or connection.unit != source.name):
            own = "no unit" if source is None else source.name
            text = f"must be the unit of {connection.source}, {own}, but is {connection.unit!r}"
            return [Problem(f"{path}.unit", text, mismatch=True)]
        return []

    def _source_problems(self, k: int, source: SignalSource) -> list[Problem]:
        path = f"$.sources[{k}]"
        found = self._end_problems(f"{path}.to", source.target, "input")
        if source.at not in {None, "start", "end"}:
            found.append(Problem(f"{path}.at", f"must be 'start' or 'end', but is {source.at!r}"))
        if found:
            return found
        variable = self.variable(source.target)
        assert variable is not None
        if variable.type != "Real":
            text = discrete_problem(variable, source.signal)
            if text is not None:
                found.append(Problem(f"{path}", text))
            if source.unit is not None:
                text = f"must be left out, but is given, and {source.target} has type {variable.type}"
                found.append(Problem(f"{path}.unit", text))
            others = [c.target for c in self.connections] + [s.target for s in self.sources[:k]]
            if source.target in others:
                found.append(
                    Problem(f"{path}.to", f"must be fed once, but {source.target} is fed by something else too")
                )
        elif source.unit is not None and self.ratio(source.unit, source.target) is None:
            own = variable.unit or "no unit"
            found.append(
                Problem(f"{path}.unit", f"must measure what {own} of {source.target} does, but is {source.unit!r}")
            )
        return found

    def _end_problems(self, path: str, address: str, causality: str) -> list[Problem]:
        variable = self.variable(address)
        if variable is None:
            return [Problem(path, self._unknown(address), mismatch=True)]
        tuned = causality == "input" and variable.causality == "parameter" and variable.variability == "tunable"
        if variable.causality != causality and not tuned:
            text = f"must be an {causality}, but {address} is of causality {variable.causality}"
            return [Problem(path, text, mismatch=True)]
        if variable.type not in NUMERIC:
            text = f"must be numeric, but {address} has type {variable.type}"
            if causality == "input":
                text += ": give its value under `parameters` of its instance"
            return [Problem(path, text, mismatch=True)]
        return []

    def _order_problems(self) -> list[Problem]:
        names = [i.name for i in self.instances]
        if self.order and sorted(self.order) != sorted(names):
            text = f"must name every instance once ({', '.join(names)}), but is {', '.join(self.order)}"
            return [Problem("$.master.order", text)]
        return []

    def record_problems(self, record: tuple[str, ...]) -> list[Problem]:
        """Return what is wrong with a list of signals to be recorded."""
        found = []
        for k, address in enumerate(record):
            variable = self.variable(address)
            path = f"$.record[{k}]"
            if variable is None:
                found.append(Problem(path, self._unknown(address)))
            elif variable.causality not in READABLE or variable.type not in NUMERIC:
                found.append(
                    Problem(
                        path, f"must be numeric and readable, but {address} is a {variable.type} {variable.causality}"
                    )
                )
            elif record.index(address) != k:
                found.append(Problem(path, f"must be recorded once, but {address} is named twice"))
        return found

    def _unknown(self, address: str) -> str:
        name, variable = split(address)
        instance = self.instance(name)
        if instance is None:
            known = ", ".join(i.name for i in self.instances) or "none"
            return f"must start with an instance's name ({known}), but is {address!r}"
        model = instance.model
        if variable in model.output_clocks or variable in model.input_clocks:
            return f"must name a variable of {name}, but {variable!r} is a clock: `clock_connections` join clocks"
        close = nearest(variable, list(model.variables))
        return f"must name a variable of {name} ({instance.model.name}), but {variable!r} is none{close}"
