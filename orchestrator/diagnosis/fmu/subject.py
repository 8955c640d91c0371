"""What is diagnosed: one FMU, or the FMUs of a scenario and what they hand to one another."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from orchestrator.errors import ScenarioError
from orchestrator.fmi.instances import FmuFactory
from orchestrator.fmi.model_description import read_description
from orchestrator.master import units
from orchestrator.master.protocol import ModelInterface, Unit, Value, Variable
from orchestrator.master.system import System
from orchestrator.scenarios.scenario import load_scenario


@dataclass(frozen=True)
class Connected:
    """``target = factor * source + offset``, between FMUs; names are ``fmu.variable``."""

    source: str
    target: str
    factor: float
    offset: float


@dataclass(frozen=True)
class Subject:
    """One FMU, or several.

    Attributes:
        path: of the FMU, or of the scenario.
        members: FMU by name; the name of a lone one is empty.
        model: all variables and units; those of one of several are called ``fmu.variable``.
        given: values that the scenario sets.
        fed: inputs that the scenario feeds from a source.
    """

    path: Path
    members: Mapping[str, Path]
    model: ModelInterface
    connections: tuple[Connected, ...] = ()
    given: Mapping[str, Value] = field(default_factory=dict)
    fed: tuple[str, ...] = ()

    @property
    def units(self) -> dict[str, str]:
        """The unit of every variable that has one."""
        return {v.name: v.unit for v in self.model.variables.values() if v.unit}


def subject_of(path: Path) -> Subject:
    """Return what is diagnosed."""
    if path.suffix.lower() != ".toml":
        return Subject(path, {"": path}, read_description(path, events=False).model)
    scenario = load_scenario(path)
    system = scenario.system
    members: dict[str, Path] = {}
    variables: dict[str, Variable] = {}
    declared: dict[str, Unit] = {}
    for instance in system.instances:
        assert isinstance(instance.create, FmuFactory)
        members[instance.name] = instance.create.path
        declared.update(instance.model.units)
        named = (replace(v, name=f"{instance.name}.{v.name}") for v in instance.model.variables.values())
        variables.update({v.name: v for v in named})
    model = ModelInterface(scenario.name, variables, declared)
    fed = tuple(source.target for source in system.sources)
    return Subject(path, members, model, _connections(system, path), _given(system), fed)


def _connections(system: System, path: Path) -> tuple[Connected, ...]:
    found = []
    for k, c in enumerate(system.connections):
        source, target = system.variable(c.source), system.variable(c.target)
        ratio = units.conversion(system.unit(c.source), system.unit(c.target))
        assert source is not None
        assert target is not None
        assert ratio is not None
        if source.type != "Real" or target.type != "Real" or c.quantum > 0.0:
            raise ScenarioError(
                f"{path}: $.connections[{k}] must join Real variables without a quantum to be fitted, but does not"
            )
        found.append(Connected(c.source, c.target, c.factor * ratio[0], c.factor * ratio[1] + c.offset))
    return tuple(found)


def _given(system: System) -> dict[str, Value]:
    found: dict[str, Value] = {}
    for instance in system.instances:
        for variable, given in instance.start.items():
            name = f"{instance.name}.{variable}"
            value = system.start_value(name, given)[0]
            assert value is not None  # the scenario has been checked
            found[name] = value
    return found
