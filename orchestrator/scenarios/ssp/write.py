"""Systems as SSP files: structure, parameter values with units, FMUs."""

from collections.abc import Iterable, Mapping
from pathlib import Path

from lxml import etree

from orchestrator.building.archive import write_archive
from orchestrator.errors import OutputError, ScenarioError
from orchestrator.fmi.instances import FmuFactory
from orchestrator.master.protocol import Unit, Value, Variable
from orchestrator.master.signals import Constant
from orchestrator.master.system import Connection, Instance, System, split
from orchestrator.scenarios.scenario import Scenario
from orchestrator.scenarios.ssp.common import (
    EXPONENTS,
    STRUCTURE,
    VALUES,
    add_experiment,
    add_master,
    document_bytes,
    new_document,
    tag,
)


def write_ssp(path: Path, scenario: Scenario) -> None:
    """Write a scenario of FMUs as an SSP archive, whole or not at all.

    Sources that are constant become start values; SSP has no way to say others.
    """
    scenario.system.check()
    members = {STRUCTURE: _structure(scenario)}
    for instance in scenario.system.instances:
        if not isinstance(instance.create, FmuFactory):
            raise ScenarioError(f"`{instance.name}` must be an FMU, but is not")
        content = instance.create.path.read_bytes()
        if members.setdefault(_source(instance), content) != content:
            raise ScenarioError(f"`{instance.name}` must not be another FMU of the name {instance.create.path.name}")
        members[_values_file(instance)] = _values(instance, _start_values(scenario.system, instance))
    try:
        write_archive(path, members)
    except Exception as error:
        raise OutputError(f"cannot write {path}: {error}") from None


def _source(instance: Instance) -> str:
    assert isinstance(instance.create, FmuFactory)
    return f"resources/{instance.create.path.name}"


def _values_file(instance: Instance) -> str:
    return f"resources/{instance.name}.ssv"


def _start_values(system: System, instance: Instance) -> dict[str, Value]:
    """Return parameters and constant sources of one instance, converted to its own units, by variable name."""
    given = dict(instance.start)
    for k, source in enumerate(system.sources):
        name, variable = split(source.target)
        if name != instance.name:
            continue
        if not isinstance(source.signal, Constant):
            raise ScenarioError(f"$.sources[{k}]: must be constant to be written as SSP, but varies")
        if any(c.target == source.target for c in system.connections):
            raise ScenarioError(f"$.sources[{k}].to: must not be connected to be written as SSP, but is")
        given[variable] = source.signal.value
    values = {}
    for variable, raw in given.items():
        value, text = system.start_value(f"{instance.name}.{variable}", raw)
        if value is None:
            raise ScenarioError(f"$.instances.{instance.name}.parameters.{variable}: {text}")
        values[variable] = value
    return values


def _structure(scenario: Scenario) -> bytes:
    root = new_document("ssd", "SystemStructureDescription", scenario.name)
    system = etree.SubElement(root, tag("ssd", "System"), name="system")
    elements = etree.SubElement(system, tag("ssd", "Elements"))
    for instance in scenario.system.instances:
        _component(elements, scenario.system, instance)
    if scenario.system.connections:  # the schema knows no empty list
        connections = etree.SubElement(system, tag("ssd", "Connections"))
    for k, connection in enumerate(scenario.system.connections):
        _connection(connections, connection, k)
    stated = [i.solver_tolerance for i in scenario.system.instances if i.solver_tolerance is not None]
    add_master(system, scenario.algorithm.step, min(stated, default=None))
    _units(root, scenario.system.instances)
    add_experiment(root, scenario.start, scenario.stop, scenario.algorithm.step)
    return document_bytes(root, "ssd", STRUCTURE)


def _component(elements: etree._Element, system: System, instance: Instance) -> None:
    component = etree.SubElement(
        elements,
        tag("ssd", "Component"),
        name=instance.name,
        type="application/x-fmu-sharedlibrary",
        source=_source(instance),
        implementation="CoSimulation",
    )
    connectors = etree.SubElement(component, tag("ssd", "Connectors"))
    # Only inputs that something feeds: some tools set the others to zero, over their start values.
    fed = {c.target for c in system.connections}
    for variable in instance.model.variables.values():
        given = variable.causality == "output" or f"{instance.name}.{variable.name}" in fed
        if given and variable.type != "String":
            kind = {"name": variable.name, "kind": variable.causality}
            connector = etree.SubElement(connectors, tag("ssd", "Connector"), kind)
            _type(connector, "ssc", variable)
    if _start_values(system, instance):
        bindings = etree.SubElement(component, tag("ssd", "ParameterBindings"))
        etree.SubElement(
            bindings,
            tag("ssd", "ParameterBinding"),
            type="application/x-ssp-parameter-set",
            source=_values_file(instance),
        )


def _type(parent: etree._Element, space: str, variable: Variable, value: Value | None = None) -> None:
    # An enumeration travels as an integer: of the tools tried, none reads the name of an item.
    kind = "Integer" if variable.type == "Enumeration" else variable.type
    element = etree.SubElement(parent, tag(space, kind))
    if value is not None:
        element.set("value", str(value).lower() if isinstance(value, bool) else str(value))
    if kind == "Real" and variable.unit:
        element.set("unit", variable.unit)


def _connection(parent: etree._Element, connection: Connection, k: int) -> None:
    if connection.quantum:
        raise ScenarioError(
            f"$.connections[{k}].quantum: must be 0 to be written as SSP, but is {connection.quantum!r}"
        )
    start, end = split(connection.source), split(connection.target)
    element = etree.SubElement(
        parent,
        tag("ssd", "Connection"),
        startElement=start[0],
        startConnector=start[1],
        endElement=end[0],
        endConnector=end[1],
    )
    if (connection.factor, connection.offset) != (1.0, 0.0):
        linear = {"factor": repr(connection.factor), "offset": repr(connection.offset)}
        etree.SubElement(element, tag("ssc", "LinearTransformation"), linear)


def _units(root: etree._Element, instances: Iterable[Instance]) -> None:
    units: dict[str, Unit] = {}
    for instance in instances:
        units.update(instance.model.units)
    parent = etree.SubElement(root, tag("ssd", "Units")) if units else root
    for name in sorted(units):
        _unit(parent, units[name])


def _unit(parent: etree._Element, unit: Unit) -> None:
    element = etree.SubElement(parent, tag("ssc", "Unit"), name=unit.name)
    base = etree.SubElement(element, tag("ssc", "BaseUnit"))
    for name, exponent in zip(EXPONENTS, unit.exponents or (0,) * 8, strict=True):
        if exponent:
            base.set(name, str(exponent))
    if unit.factor != 1.0:
        base.set("factor", repr(unit.factor))
    if unit.offset != 0.0:
        base.set("offset", repr(unit.offset))


def _values(instance: Instance, values: Mapping[str, Value]) -> bytes:
    root = new_document("ssv", "ParameterSet", VALUES)
    parameters = etree.SubElement(root, tag("ssv", "Parameters"))
    used = set()
    for name, value in values.items():
        parameter = etree.SubElement(parameters, tag("ssv", "Parameter"), name=name)
        variable = instance.model.variables[name]
        used.add(variable.unit)
        _type(parameter, "ssv", variable, value)
    units = [unit for name, unit in sorted(instance.model.units.items()) if name in used]
    if units:
        parent = etree.SubElement(root, tag("ssv", "Units"))
        for unit in units:
            _unit(parent, unit)
    return document_bytes(root, "ssv", _values_file(instance))
