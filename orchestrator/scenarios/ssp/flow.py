"""Where values go in a package: through the connectors of systems from component to component, units converted."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path

from orchestrator.master import units
from orchestrator.master.problems import Problem
from orchestrator.master.protocol import ModelInterface, Unit
from orchestrator.master.result import RunRemark
from orchestrator.master.signals import Scaled, Signal
from orchestrator.master.system import Connection, SignalSource
from orchestrator.scenarios.definition import Derived
from orchestrator.scenarios.ssp.parameters import Given

MOST_HOPS = 512
"""Connectors between two components: up and down through as many systems as XML can nest, 256."""

Node = tuple[str, str]
"""A connector: path of its element (empty: the outermost system), name."""


@dataclass
class Structure:
    """What is found while walking through nested systems. Elements are named by their path, joined by slashes."""

    folder: Path  # of the unpacked archive
    units: Mapping[str, Unit]  # that the file declares
    problems: list[Problem] = field(default_factory=list)
    components: dict[str, Path] = field(default_factory=dict)  # file of each component
    exchanged: set[str] = field(default_factory=set)  # names of the components that are to be run as model exchange
    kinds: dict[Node, str] = field(default_factory=dict)  # kind of each connector
    # for each element of an array that a connection names, the array and its place in it
    elements: dict[Node, tuple[Node, str]] = field(default_factory=dict)
    connector_units: dict[Node, Unit] = field(default_factory=dict)  # of those that state one
    # of the dimensions of those that are arrays; None where the file does not say
    sizes: dict[Node, tuple[int | None, ...]] = field(default_factory=dict)
    # ``Clock`` or ``Binary``, for connectors of these types
    without_number: dict[Node, str] = field(default_factory=dict)
    # ``interval`` and ``shift`` of the connectors of type ``Clock``, where they are stated [s]
    clock_times: dict[Node, dict[str, Fraction]] = field(default_factory=dict)
    # for each connector that is fed: what feeds it, factor and offset
    drivers: dict[Node, tuple[Node, float, float]] = field(default_factory=dict)
    given: dict[Node, Given] = field(default_factory=dict)  # values of parameter bindings
    remarks: list[RunRemark] = field(default_factory=list)  # what is passed over


@dataclass
class _Value:
    """``factor * x + offset`` of what flows along connectors, in ``unit``; None: in whatever unit comes next."""

    factor: float = 1.0
    offset: float = 0.0
    unit: Unit | None = None


def instance_names(components: Mapping[str, Path]) -> dict[str, str]:
    """Return what components are called in signals, where a dot ends the name of an instance."""
    found: dict[str, str] = {}
    for path in sorted(components, key=lambda text: "." in text):
        name = path.replace(".", "_")
        while name in found.values():
            name += "_"
        found[path] = name
    return {path: found[path] for path in components}


class Flow:
    """Follows values through a package.

    ``names``: of the instances that components become.
    """

    def __init__(self, structure: Structure, models: Mapping[str, ModelInterface], names: Mapping[str, str]) -> None:
        self._structure, self._models, self._names = structure, models, names

    def connections(self, inputs: Mapping[str, Signal]) -> tuple[list[Connection], list[SignalSource]]:
        """Return what feeds the inputs of components."""
        connections, sources = [], []
        for node in self._structure.drivers:
            self._root(node)  # rings and chains that reach no component are told too
        for target, root in self._ends():
            name = self._address(target)
            if root[0] in self._models:
                value = self._carry(root, target, self._start_at(root, target))
                source, own = self._own_unit(root), self._own_unit(target)
                ratio = units.conversion(source, own) or (1.0, 0.0)  # what the master converts by itself
                factor = value.factor / ratio[0]
                connections.append(Connection(self._address(root), name, factor, value.offset - factor * ratio[1]))
            elif root[0] == "" and root[1] in inputs:
                value = self._carry(root, target, self._start_at(root, target))
                # As other tools do: what is set at a communication point holds over the step from there.
                sources.append(SignalSource(name, Scaled(inputs[root[1]], value.factor, value.offset), at="start"))
        for name in inputs:
            if self._structure.kinds.get(("", name)) != "input":
                text = f"must have an input {name!r}, but has none"
                self._structure.problems.append(Problem("$.System.Connectors", text))
        return connections, sources

    def starts(self, inputs: Mapping[str, Signal]) -> dict[Node, Given]:
        """Return the values that bindings give to connectors of systems, where they reach components."""
        found = {}
        for target, root in self._ends():
            given = self._structure.given.get(root)
            if root[0] in self._models or given is None or (root[0] == "" and root[1] in inputs):
                continue
            if given.type not in ("Real", "Integer") or not _is_number(given.text):
                found[target] = given
                continue
            unit = None if given.unit is None else units.resolve(given.unit, {**self._structure.units, **given.units})
            begin = self._step(_Value(1.0, 0.0, self._unit_for(target, unit)), self._connector_unit(root), root)
            if (given.factor, given.offset) != (1.0, 0.0):
                # A mapping transforms a value in the unit of its target: the first that is stated on the way.
                stated = (self._connector_unit(node) for node in self._path(root, target))
                begin = self._step(begin, next((u for u in stated if u is not None), self._own_unit(target)), root)
                begin = _Value(given.factor * begin.factor, given.factor * begin.offset + given.offset, begin.unit)
            value = self._carry(root, target, begin)
            number = value.factor * float(given.text) + value.offset
            text = f"{number:.0f}" if number.is_integer() and abs(number) < 1e15 else repr(number)
            found[target] = Given(given.type, text, None, {})
        return found

    def outputs(self, record: tuple[str, ...]) -> Iterator[Derived]:
        """Yield the output connectors of the outermost system that show recorded signals."""
        for node, kind in self._structure.kinds.items():
            if node[0] == "" and kind == "output" and node in self._structure.drivers:
                root = self._root(node)
                if root[0] in self._models and self._address(root) in record:
                    value = self._carry(root, node, self._start_at(root, node))
                    unit = None if value.unit is None else value.unit.name
                    yield Derived(node[1], self._address(root), value.factor, value.offset, unit)

    def _ends(self) -> Iterator[tuple[Node, Node]]:
        """Yield each fed connector of a component, and where what feeds it comes from."""
        for target in self._structure.drivers:
            if target[0] in self._models and target[1] in self._models[target[0]].variables:
                yield target, self._root(target)

    def _root(self, node: Node) -> Node:
        drivers, seen = self._structure.drivers, {node}
        while node in drivers:
            node = drivers[node][0]
            if node[0] in self._models:
                break
            if node in seen:
                ring, last = {node}, drivers[node][0]
                while last not in ring:
                    ring.add(last)
                    last = drivers[last][0]
                self._refuse(f"$.{'.'.join(filter(None, min(ring)))}", "must not be fed by itself, but is")
                break
            if len(seen) > MOST_HOPS:
                text = f"must feed a connector through at most {MOST_HOPS} others, but do so through more"
                self._refuse("$.Connections", text)
                break
            seen.add(node)
        return node

    def _refuse(self, path: str, text: str) -> None:
        problem = Problem(path, text, mismatch=True)
        if problem not in self._structure.problems:
            self._structure.problems.append(problem)

    def _carry(self, root: Node, target: Node, value: _Value) -> _Value:
        """Return a value that has gone from ``root`` to ``target``."""
        for node in self._path(root, target)[1:]:
            _, factor, offset = self._structure.drivers[node]
            value = self._step(value, self._connector_unit(node), node)
            if (factor, offset) != (1.0, 0.0):
                unit = self._unit_for(target, self._connector_unit(node))
                value = _Value(factor * value.factor, factor * value.offset + offset, unit)
        return self._step(value, self._own_unit(target), target)

    def _path(self, root: Node, target: Node) -> list[Node]:
        """Return the connectors from ``root`` to ``target``, both of them included."""
        path = [target]
        while path[-1] != root:
            path.append(self._structure.drivers[path[-1]][0])
        return path[::-1]

    def _start_at(self, root: Node, target: Node) -> _Value:
        unit = self._unit_for(target, self._own_unit(root))
        return self._step(_Value(1.0, 0.0, unit), self._connector_unit(root), root)

    def _unit_for(self, target: Node, unit: Unit | None) -> Unit | None:
        """Return a unit that is one of a difference where the value goes to a difference, unless it says itself."""
        own = self._own_unit(target)
        if unit is None or own is None or unit.difference is not None:
            return unit
        return replace(unit, difference=own.difference)

    def _step(self, value: _Value, unit: Unit | None, node: Node) -> _Value:
        """Return a value in another unit; where that measures something else, it is a problem."""
        if unit is None:
            return value
        ratio = units.conversion(value.unit, unit)
        if ratio is None:
            assert value.unit is not None
            self._refuse(f"$.{'.'.join(filter(None, node))}", units.describe_mismatch(value.unit, unit))
            ratio = 1.0, 0.0
        if unit.difference is None and value.unit is not None:
            unit = replace(unit, difference=value.unit.difference)
        return _Value(ratio[0] * value.factor, ratio[0] * value.offset + ratio[1], unit)

    def _connector_unit(self, node: Node) -> Unit | None:
        return self._structure.connector_units.get(node)

    def _own_unit(self, node: Node) -> Unit | None:
        """The unit that the FMU states; of a system's connector, and where the FMU states none, the connector's own."""
        model = self._models.get(node[0])
        variable = None if model is None else model.variables.get(node[1])
        if model is None or variable is None or variable.unit is None:
            return self._connector_unit(node)
        return units.unit_of(variable, model.units)

    def _address(self, node: Node) -> str:
        return f"{self._names[node[0]]}.{node[1]}"


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
