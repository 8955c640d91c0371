"""What a version of SSP calls the variables of an instance: one by one in 1.0, arrays as such and by type in 2.0."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from orchestrator.errors import ScenarioError
from orchestrator.fmi.instances import FmuFactory
from orchestrator.fmi.model_description import FmuDescription
from orchestrator.fmi.variables import element_places
from orchestrator.master.protocol import Value, Variable
from orchestrator.master.system import Instance


@dataclass(frozen=True)
class SspVariable:
    """A variable or an array."""

    name: str
    type: str  # its element in SSP
    sizes: tuple[int, ...]  # of an array's dimensions
    first: Variable  # the variable, or the array's first element


def described(instance: Instance, names: Iterable[str], version: str) -> Iterator[SspVariable]:
    """Yield some variables of an instance as a version of SSP has them, each array once.

    ``version``: of SSP, "1.0" or "2.0".
    """
    seen = set()
    for variable in names:
        name, _ = connector_of(instance, variable, version)
        if name in seen:
            continue
        seen.add(name)
        description = _description(instance)
        sizes = description.arrays.get(name, ()) if name != variable else ()
        first = instance.model.variables[name + element_places(sizes)[0]]
        own = description.access[first.name].kind if version != "1.0" and description.version != "2.0" else None
        # An enumeration travels as an integer: of the tools tried, none reads the name of an item.
        yield SspVariable(name, own or ("Integer" if first.type == "Enumeration" else first.type), sizes, first)


def connector_of(instance: Instance, variable: str, version: str) -> tuple[str, str]:
    """Return the connector that a variable has, and the indices of the element that it is of an array, if it is one."""
    name, _, rest = variable.rpartition("[")
    if version == "1.0" or name not in _description(instance).arrays:
        return variable, ""
    return name, rest.rstrip("]").replace(",", " ")


def whole_values(instance: Instance, entry: SspVariable, values: Mapping[str, Value]) -> list[Value]:
    """Return the values of a variable or of all elements of an array, start values where none are given."""
    found: list[Value] = []
    for place in element_places(entry.sizes):
        variable = instance.model.variables[entry.name + place]
        value = values.get(variable.name, variable.start)
        if value is None:
            text = "must have a value to be written as SSP, for other elements of its array have one, but has none"
            raise ScenarioError(f"$.instances.{instance.name}.parameters.{variable.name}: {text}")
        found.append(value)
    return found


def _description(instance: Instance) -> FmuDescription:
    assert isinstance(instance.create, FmuFactory)
    return instance.create.description
