"""What is diagnosed: one FMU, or the FMUs of a scenario and what they hand to one another; a first map for it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from orchestrator.errors import ScenarioError
from orchestrator.fmi.instances import FmuFactory
from orchestrator.fmi.model_description import read_description
from orchestrator.master.protocol import ModelInterface, Unit, Value, Variable
from orchestrator.master.system import System
from orchestrator.master.units import conversion, resolve
from orchestrator.scenarios.scenario import load_scenario

POWER, ENERGY = (1, 2, -3, 0, 0, 0, 0), (1, 2, -2, 0, 0, 0, 0)
"""Exponents (kg, m, s, A, K, mol, cd) of an effort times a flow, and of an effort times a position."""
SPREAD = "5 %"
MOST_PARAMETERS = 12
NO_PORT = (
    "# By its units no input is an effort whose product with an output is a power or an energy: no port is drafted.",
    "# Where one is, add [ports.NAME] with input = ..., and position = ..., velocity = ... or both.",
)


@dataclass(frozen=True)
class FmuConnection:
    """``target = factor * source + offset``, between FMUs; names are ``fmu.variable``."""

    source: str
    target: str
    factor: float
    offset: float


@dataclass(frozen=True)
class FmuSystem:
    """One FMU, or several."""

    path: Path  # of the FMU, or of the scenario
    members: Mapping[str, Path]  # FMU by name; the name of a lone one is empty
    model: ModelInterface  # all variables and units; those of one of several are called ``fmu.variable``
    connections: tuple[FmuConnection, ...] = ()
    given: Mapping[str, Value] = field(default_factory=dict)  # values that the scenario sets
    fed: tuple[str, ...] = ()  # inputs that the scenario feeds from a source

    @cached_property
    def units(self) -> dict[str, str]:
        """The unit of every variable that has one."""
        return {v.name: v.unit for v in self.model.variables.values() if v.unit}


def read_system(path: Path) -> FmuSystem:
    """Return the FMU of a path, or the FMUs of a scenario."""
    if path.suffix.lower() != ".toml":
        return FmuSystem(path, {"": path}, read_description(path, events=False).model)
    scenario = load_scenario(path)
    system = scenario.system
    members, variables = {}, {}
    declared: dict[str, Unit] = {}
    given: dict[str, Value] = {}
    for instance in system.instances:
        assert isinstance(instance.create, FmuFactory)
        members[instance.name] = instance.create.path
        declared.update(instance.model.units)
        named = (replace(v, name=f"{instance.name}.{v.name}") for v in instance.model.variables.values())
        variables.update({v.name: v for v in named})
        for variable, value in instance.start.items():
            full = f"{instance.name}.{variable}"
            typed = system.start_value(full, value)[0]
            assert typed is not None  # the scenario has been checked
            given[full] = typed
    model = ModelInterface(scenario.name, variables, declared)
    fed = tuple(source.target for source in system.sources)
    return FmuSystem(path, members, model, _connections(system, path), given, fed)


def _connections(system: System, path: Path) -> tuple[FmuConnection, ...]:
    found = []
    for k, c in enumerate(system.connections):
        source, target = system.variable(c.source), system.variable(c.target)
        ratio = conversion(system.unit(c.source), system.unit(c.target))
        assert source is not None
        assert target is not None
        assert ratio is not None
        if source.type != "Real" or target.type != "Real" or c.quantum > 0.0:
            raise ScenarioError(
                f"{path}: $.connections[{k}] must join Real variables without a quantum to be fitted, but does not"
            )
        found.append(FmuConnection(c.source, c.target, c.factor * ratio[0], c.factor * ratio[1] + c.offset))
    return tuple(found)


def draft_map_text(system: FmuSystem, columns: Sequence[str], time: str = "time") -> str:
    """Return a first map as TOML, from causality, units and names and the columns of a record, to be looked over."""
    model = system.model
    reals = [v for v in model.variables.values() if v.type == "Real"]
    taken = {c.target for c in system.connections}
    inputs = [v for v in reals if v.causality == "input" and v.name not in taken]
    outputs = [v for v in reals if v.causality == "output"]
    lines = [f"# Draft for {model.name}: look over columns, uncertainties and ports.", "[inputs]"]
    found = {v.name: _column(v, columns, time) for v in (*inputs, *outputs)}
    lines += [_entry(v, found[v.name], 'hold = "zero"') for v in inputs]
    lines += ["", "[outputs]"]
    lines += [_entry(v, found[v.name], "") for v in outputs]
    lines += ["", "[parameters]"]
    tuned = [v for v in reals if v.causality == "parameter" and isinstance(v.start, int | float) and v.start != 0.0]
    for k, v in enumerate(tuned):
        comment = "" if k < MOST_PARAMETERS else "# "
        lines.append(f'{comment}{_key(v.name)} = {{ uncertainty = "{SPREAD}" }}  # {v.start:g} {v.unit or ""}'.rstrip())
    for name, effort, position, velocity in _ports(inputs, outputs, model.units, found):
        lines += ["", f"[ports.{name}]", f'input = "{effort}"']
        lines += [f'position = "{position}"'] if position else []
        lines += [f'velocity = "{velocity}"'] if velocity else []
    if "[ports.port_1]" not in lines:
        lines += ["", *NO_PORT]
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    return name if name.replace("_", "a").isalnum() and name.isascii() else '"' + name.replace('"', '\\"') + '"'


def _entry(variable: Variable, column: str | None, further: str) -> str:
    parts = [f'column = "{column or "?"}"'] + ([further] if further else [])
    unit = f"  # {variable.unit}" if variable.unit else ""
    return f"{'' if column else '# '}{_key(variable.name)} = {{ {', '.join(parts)} }}{unit}"


def _column(variable: Variable, columns: Sequence[str], time: str) -> str | None:
    plain = {c.lower(): c for c in columns if c != time}
    short = variable.name.rpartition(".")[2].lower()
    return plain.get(variable.name.lower()) or plain.get(short)


def _ports(
    inputs: Sequence[Variable], outputs: Sequence[Variable], units: Mapping[str, Unit], measured: dict[str, str | None]
) -> list[tuple[str, str, str, str]]:
    """Return name, input, position and velocity of the pairs of input and outputs that are conjugate by their units."""

    def exponents(v: Variable) -> tuple[int, ...] | None:
        unit = None if v.unit is None else resolve(v.unit, units)
        return None if unit is None or unit.exponents is None else tuple(unit.exponents[:7])

    def partner(effort: Variable, product: tuple[int, ...], near: str) -> Variable | None:
        """The output whose product with an input is ``product``; of several one that is measured, or called alike."""
        own = exponents(effort)
        found = [v for v in outputs if own and (e := exponents(v)) and tuple(np.add(own, e)) == product]
        ranked = sorted(found, key=lambda v: (v.name[-1:] != near, not measured[v.name]))
        return ranked[0] if ranked else None

    ports: list[tuple[str, str, str, str]] = []
    for effort in inputs:
        position = partner(effort, ENERGY, effort.name[-1:])
        velocity = partner(effort, POWER, (position or effort).name[-1:])
        if position or velocity:
            pair = position.name if position else "", velocity.name if velocity else ""
            ports.append((f"port_{len(ports) + 1}", effort.name, *pair))
    return ports
