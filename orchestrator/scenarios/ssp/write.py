"""Systems as SSP files: structure, parameter values with units, FMUs."""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from lxml import etree

from orchestrator.building.archive import write_archive
from orchestrator.errors import OutputError, ScenarioError
from orchestrator.fmi.instances import FmuFactory
from orchestrator.fmi.model_description import read_description
from orchestrator.master.protocol import Unit, Value
from orchestrator.master.signals import Constant
from orchestrator.master.system import Connection, Instance, System, split
from orchestrator.scenarios.scenario import Scenario
from orchestrator.scenarios.ssp.common import (
    STRUCTURE,
    VALUES,
    add_experiment,
    add_master,
    document_bytes,
    new_document,
    tag,
)
from orchestrator.scenarios.ssp.described import SspVariable, connector_of, described, whole_values
from orchestrator.shared.units import EXPONENTS


def write_ssp(path: Path, scenario: Scenario, version: str = "1.0") -> None:
    """Write a scenario of FMUs as an SSP archive, whole or not at all.

    Sources that are constant become start values; SSP has no way to say others. ``version``: of SSP, "1.0" or "2.0".
    """
    scenario.system.check()
    _check_clocks(scenario.system)
    members = {STRUCTURE: _structure(scenario, version)}
    for instance in scenario.system.instances:
        if not isinstance(instance.create, FmuFactory):
            raise ScenarioError(f"`{instance.name}` must be an FMU, but is not")
        content = instance.create.path.read_bytes()
        if members.setdefault(_source(instance), content) != content:
            raise ScenarioError(f"`{instance.name}` must not be another FMU of the name {instance.create.path.name}")
        members[_values_file(instance)] = _values(instance, _start_values(scenario.system, instance), version)
    try:
        write_archive(path, members)
    except Exception as error:
        raise OutputError(f"cannot write {path}: {error}") from None


def _check_clocks(system: System) -> None:
    """Refuse what SSP cannot say of clocks: which one triggers which, and times that are not the FMU's own."""
    if system.clock_connections:
        raise ScenarioError("$.clock_connections: must be left out to be written as SSP, but there are some")
    for instance in system.instances:
        if not isinstance(instance.create, FmuFactory) or not instance.model.clocks:
            continue
        stated = read_description(instance.create.path).model.clocks
        for name, clock in instance.model.clocks.items():
            if (clock.interval, clock.shift) != (stated[name].interval, stated[name].shift):
                text = "must be left out to be written as SSP, but is given, and the FMU has other times"
                raise ScenarioError(f"$.instances.{instance.name}.clocks.{name}: {text}")


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
    assert isinstance(instance.create, FmuFactory)
    return {**instance.create.description.configured, **values}


def _structure(scenario: Scenario, version: str) -> bytes:
    root = new_document("ssd", "SystemStructureDescription", scenario.name, version)
    system = etree.SubElement(root, tag("ssd", "System"), name="system")
    elements = etree.SubElement(system, tag("ssd", "Elements"))
    for instance in scenario.system.instances:
        _component(elements, scenario.system, instance, version)
    if scenario.system.connections:  # the schema knows no empty list
        connections = etree.SubElement(system, tag("ssd", "Connections"))
    for k, connection in enumerate(scenario.system.connections):
        _connection(connections, scenario.system, connection, k, version)
    stated = [i.solver_tolerance for i in scenario.system.instances if i.solver_tolerance is not None]
    add_master(system, scenario.algorithm.step, min(stated, default=None))
    _units(root, scenario.system.instances)
    add_experiment(root, scenario.start, scenario.stop, scenario.algorithm.step)
    return document_bytes(root, "ssd", STRUCTURE)


def _component(elements: etree._Element, system: System, instance: Instance, version: str) -> None:
    assert isinstance(instance.create, FmuFactory)
    component = etree.SubElement(
        elements,
        tag("ssd", "Component"),
        name=instance.name,
        type="application/x-fmu-sharedlibrary",
        source=_source(instance),
        implementation="ModelExchange" if instance.create.description.exchange else "CoSimulation",
    )
    connectors = etree.SubElement(component, tag("ssd", "Connectors"))
    # Only inputs that something feeds: some tools set the others to zero, over their start values.
    fed = {c.target for c in system.connections}
    given = [
        v.name
        for v in instance.model.variables.values()
        if (v.causality == "output" or f"{instance.name}.{v.name}" in fed) and v.type != "String"
    ]
    for entry in described(instance, given, version):
        kind = {"name": entry.name, "kind": entry.first.causality}
        connector = etree.SubElement(connectors, tag("ssd", "Connector"), kind)
        _type(connector, "ssc", entry)
        _dimensions(connector, entry)
    if _start_values(system, instance):
        bindings = etree.SubElement(component, tag("ssd", "ParameterBindings"))
        etree.SubElement(
            bindings,
            tag("ssd", "ParameterBinding"),
            type="application/x-ssp-parameter-set",
            source=_values_file(instance),
        )


def _type(parent: etree._Element, space: str, entry: SspVariable, values: Sequence[Value] = ()) -> None:
    element = etree.SubElement(parent, tag(space, entry.type))
    texts = [str(value).lower() if isinstance(value, bool) else str(value) for value in values]
    if entry.sizes and entry.type == "String":
        for text in texts:
            etree.SubElement(element, tag(space, "Value"), value=text)
    elif texts:
        element.set("value", " ".join(texts))
    if entry.first.type == "Real" and entry.first.unit:
        element.set("unit", entry.first.unit)


def _dimensions(parent: etree._Element, entry: SspVariable) -> None:
    for size in entry.sizes:
        etree.SubElement(parent, tag("ssc", "Dimension"), size=str(size))


def _connection(parent: etree._Element, system: System, connection: Connection, k: int, version: str) -> None:
    if connection.quantum:
        raise ScenarioError(
            f"$.connections[{k}].quantum: must be 0 to be written as SSP, but is {connection.quantum!r}"
        )
    ends: dict[str, str] = {}
    for side, address in (("start", connection.source), ("end", connection.target)):
        name, variable = split(address)
        instance = system.instance(name)
        assert instance is not None
        connector, indices = connector_of(instance, variable, version)
        ends |= {f"{side}Element": name, f"{side}Connector": connector}
        ends |= {f"{side}Indices": indices} if indices else {}
    element = etree.SubElement(parent, tag("ssd", "Connection"), ends)
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


def _values(instance: Instance, values: Mapping[str, Value], version: str) -> bytes:
    root = new_document("ssv", "ParameterSet", VALUES, version)
    parameters = etree.SubElement(root, tag("ssv", "Parameters"))
    used = set()
    for entry in described(instance, values, version):
        parameter = etree.SubElement(parameters, tag("ssv", "Parameter"), name=entry.name)
        used.add(entry.first.unit)
        _type(parameter, "ssv", entry, whole_values(instance, entry, values))
        _dimensions(parameter, entry)
    units = [unit for name, unit in sorted(instance.model.units.items()) if name in used]
    if units:
        parent = etree.SubElement(root, tag("ssv", "Units"))
        for unit in units:
            _unit(parent, unit)
    return document_bytes(root, "ssv", _values_file(instance))
