"""Scenarios from SSP files: any SSP 1.0 or 2.0 of co-simulation FMUs, with nested systems and parameter bindings."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from lxml import etree

from orchestrator.errors import FmuError, ScenarioError
from orchestrator.fmi.clocks import clock_interval, clock_shift, names_in_words
from orchestrator.fmi.instances import FmuFactory, read_configured
from orchestrator.fmi.model_description import FmuDescription, read_description
from orchestrator.fmi.ours import is_ours
from orchestrator.fmi.size import SystemSize
from orchestrator.master.algorithms import GaussSeidel, Jacobi
from orchestrator.master.problems import Problem, raise_problems
from orchestrator.master.protocol import NUMERIC, Value
from orchestrator.master.result import RunRemark
from orchestrator.master.signals import Signal
from orchestrator.master.system import Instance, System
from orchestrator.master.units import resolve
from orchestrator.master.values import nearest
from orchestrator.plain_text import name_folder
from orchestrator.scenarios.scenario import Scenario
from orchestrator.scenarios.ssp.arrays import expand_arrays
from orchestrator.scenarios.ssp.common import (
    OSP,
    SPACES,
    STRUCTURE,
    file_of_uri,
    oms_step,
    parse,
    solver_tolerance,
    tag,
)
from orchestrator.scenarios.ssp.flow import Flow, Node, Structure, instance_names
from orchestrator.scenarios.ssp.parameters import Given, Place, own_value, parameter_values, read_units
from orchestrator.shared.isolation.archives import unpack
from orchestrator.shared.scratch import Scratch

FMU_TYPE = "application/x-fmu-sharedlibrary"
DEFAULT_STOP = 1.0
DEFAULT_STEPS = 1000
_REALS = tuple(tag("ssc", kind) for kind in ("Real", "Float64", "Float32"))
_PARAMETERS = ("parameter", "structuralParameter", "calculatedParameter", "constant", "local")
_GIVERS = ("output", "calculatedParameter", "constant", "local")


@contextmanager
def open_ssp(
    path: Path,
    inputs: Mapping[str, Signal] | None = None,
    step: float | None = None,
    simultaneous: bool = False,
    events: bool = True,
) -> Iterator[Scenario]:
    """Yield the scenario that an SSP file describes; its FMUs lie in a private folder until the block ends.

    All outputs are recorded. Components of nested systems are called ``system/component``. ``step``: communication step
    [s]; default: the file's own annotation, else a thousandth of the stop time. ``events``: event mode is used where an
    FMU of FMI 3.0 has it.
    """
    if os.path.isdir(path):
        raise ScenarioError(f"`ssp` must be an archive, but {path} is a directory; zip what is in it")
    with Scratch("ssp") as scratch:
        try:
            unpack(path, scratch.path / "content")
            name_folder(scratch.path / "content", path)
        except FmuError as error:
            raise ScenarioError(str(error).replace("`fmu`", "`ssp`")) from None
        yield _scenario(path, scratch.path / "content", inputs or {}, step, simultaneous, events)


def _scenario(
    path: Path, folder: Path, inputs: Mapping[str, Signal], step: float | None, simultaneous: bool, events: bool
) -> Scenario:
    file = folder / STRUCTURE
    others = sorted(
        p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.suffix.lower() == ".ssd" and p != file
    )
    if not file.is_file():
        has = f"; it has {names_in_words(others)}" if others else ""
        raise ScenarioError(f"{path}: must hold {STRUCTURE}, but does not{has}")
    root = parse(file.read_bytes(), "ssd", f"{path}: {STRUCTURE}")
    structure = Structure(folder, read_units(root, "ssd"))
    if others:
        text = f"the other systems in it are passed over ({names_in_words(others)}), for {STRUCTURE} is what is run"
        structure.remarks.append(RunRemark(path.name, text))
    system = root.find(tag("ssd", "System"))
    assert system is not None
    _walk(system, "", structure)
    raise_problems(structure.problems, f"{path}: {STRUCTURE}")
    descriptions = _descriptions(structure, path, events)
    names = instance_names(structure.components)
    size = SystemSize(path)
    descriptions = _configured(structure, descriptions, names, inputs, path, events, size)
    expand_arrays(structure, descriptions, size)
    _check_names(structure, descriptions)
    flow = Flow(structure, {name: d.model for name, d in descriptions.items()}, names)
    instances = _instances(structure, descriptions, names, flow.starts(inputs), solver_tolerance(system))
    connections, sources = flow.connections(inputs)
    made = System(tuple(instances), tuple(connections), tuple(sources))
    raise_problems(structure.problems + made.problems(), f"{path}: {STRUCTURE}")
    start, stop, own_step = _experiment(root)
    grid = step or own_step or oms_step(system) or (stop - start) / DEFAULT_STEPS
    raw = {instance: name for name, instance in names.items()}
    record = tuple(
        f"{i.name}.{v.name}"
        for i in instances
        for v in i.model.variables.values()
        if v.causality == "output" and v.type in NUMERIC and (raw[i.name], v.name) in structure.kinds
    )
    algorithm = Jacobi(grid) if simultaneous else GaussSeidel(grid)
    title = root.get("name") or path.stem
    return Scenario(
        made,
        record,
        algorithm,
        stop,
        start,
        title,
        derived=tuple(flow.outputs(record)),
        remarks=tuple(structure.remarks),
    )


def _walk(system: etree._Element, path: str, structure: Structure) -> None:
    """Collect components, connectors, connections and parameter values of a system and the systems within it."""
    _connectors(system, path, structure)
    for element in system.findall(tag("ssd", "Elements") + "/*"):
        name = f"{path}/{element.get('name')}" if path else str(element.get("name"))
        place = f"$.{name}"
        if element.tag == tag("ssd", "System"):
            _walk(element, name, structure)
        elif element.tag == tag("ssd", "Component"):
            _connectors(element, name, structure)
            _component(element, name, structure)
        else:
            structure.problems.append(Problem(place, "must be a component or a system, but is a signal dictionary"))
    for k, connection in enumerate(system.findall(f"{tag('ssd', 'Connections')}/{tag('ssd', 'Connection')}")):
        _connection(connection, path, f"$.{path or 'System'}.Connections[{k}]", structure)
    _bind(system, path, structure)


def _connectors(element: etree._Element, path: str, structure: Structure) -> None:
    for connector in element.findall(f"{tag('ssd', 'Connectors')}/{tag('ssd', 'Connector')}"):
        node = (path, str(connector.get("name")))
        kind = next((k for k in ("Clock", "Binary") if connector.find(tag("ssc", k)) is not None), None)
        if kind is not None:
            structure.without_number[node] = kind
            try:
                stated = connector.find(tag("ssc", kind))
                times = {"interval": clock_interval(stated, node[1]), "shift": clock_shift(stated, node[1])}
            except ValueError as error:
                structure.problems.append(Problem(f"$.{'.'.join(filter(None, node))}", str(error)))
                continue
            structure.clock_times[node] = {what: time for what, time in times.items() if time is not None}
            continue
        structure.kinds[node] = str(connector.get("kind"))
        real = next((r for r in map(connector.find, _REALS) if r is not None), None)
        if real is not None and real.get("unit"):
            structure.connector_units[node] = resolve(str(real.get("unit")), structure.units)
        dimensions = connector.findall(tag("ssc", "Dimension"))
        if dimensions:
            structure.sizes[node] = tuple(int(size) if (size := d.get("size")) else None for d in dimensions)


def _component(element: etree._Element, name: str, structure: Structure) -> None:
    source, kind = str(element.get("source")), element.get("type", FMU_TYPE)
    file = file_of_uri(structure.folder, source)
    if kind != FMU_TYPE:
        structure.problems.append(Problem(f"$.{name}.type", f"must be {FMU_TYPE}, but is {kind!r}"))
    elif element.get("source") is None:
        structure.problems.append(Problem(f"$.{name}.source", "must be a file of the archive, but there is none"))
    elif (implementation := element.get("implementation", "any")) not in ("any", "CoSimulation", "ModelExchange"):
        text = f"must be CoSimulation or ModelExchange, but is {implementation}"
        structure.problems.append(Problem(f"$.{name}.implementation", text))
    elif file is None:
        structure.problems.append(Problem(f"$.{name}.source", f"must be a file of the archive, but is {source!r}"))
    else:
        structure.components[name] = file
        if element.get("implementation") == "ModelExchange":
            structure.exchanged.add(name)
    _bind(element, name, structure)


def _bind(element: etree._Element, path: str, structure: Structure) -> None:
    place = Place(f"$.{path or 'System'}", structure.folder, structure.components.get(path), structure.problems)
    values = parameter_values(element, place)
    structure.remarks += [RunRemark(path or "System", text) for text in place.remarks]
    for name, value in values:
        # The innermost binding is read first and the outer one wins, as the standard has it.
        owner, parameter = path, name
        while (owner, parameter) not in structure.kinds:
            child = _child(structure, owner, parameter)
            if child is None:
                break
            owner, parameter = f"{owner}/{child}" if owner else child, parameter[len(child) + 1 :]
        structure.given[owner, parameter] = value


def _child(structure: Structure, owner: str, parameter: str) -> str | None:
    """Return the element of ``owner`` whose name, and a dot, a parameter begins with; of several the longest."""
    begin = f"{owner}/" if owner else ""
    known = {*structure.components, *(path for path, _ in structure.kinds)}
    children = {name[len(begin) :].partition("/")[0] for name in known if name.startswith(begin) and name != owner}
    fitting = [child for child in children if child and parameter.startswith(f"{child}.")]
    return max(fitting, key=len, default=None)


def _connection(element: etree._Element, path: str, place: str, structure: Structure) -> None:
    ends = []
    for side in ("start", "end"):
        child, connector = element.get(f"{side}Element"), str(element.get(f"{side}Connector"))
        owner = path if child is None else f"{path}/{child}" if path else child
        kind = structure.kinds.get((owner, connector))
        if reason := _no_end(structure.without_number.get((owner, connector)), kind):
            text = (
                f"must join connectors that carry numbers, but {'.'.join(filter(None, (owner, connector)))} is {reason}"
            )
            structure.problems.append(Problem(f"{place}.{side}Connector", text, mismatch=True))
            return
        if kind is None:
            text = f"must be a connector of {owner or 'the system'}, but {connector!r} is none"
            structure.problems.append(Problem(f"{place}.{side}Connector", text, mismatch=True))
            return
        gives = kind in _GIVERS if child is not None else kind in ("input", "parameter", "structuralParameter")
        if indices := element.get(f"{side}Indices"):
            whole, place_in = connector, f"[{','.join(indices.split())}]"
            connector += place_in
            structure.kinds[owner, connector] = kind
            structure.elements[owner, connector] = (owner, whole), place_in
        ends.append(((owner, connector), gives))
    if ends[0][1] == ends[1][1]:
        text = "must join what gives a value and what takes one, but both ends do the same"
        structure.problems.append(Problem(place, text, mismatch=True))
        return
    (source, target) = (ends[0][0], ends[1][0]) if ends[0][1] else (ends[1][0], ends[0][0])
    if target in structure.drivers:
        structure.problems.append(
            Problem(place, f"must feed a connector once, but {'.'.join(target)} is fed twice", True)
        )
        return
    factor, offset = 1.0, 0.0
    for child in element:
        if child.tag == tag("ssc", "LinearTransformation"):
            factor, offset = float(child.get("factor", "1")), float(child.get("offset", "0"))
        elif child.tag != tag("ssd", "ConnectionGeometry") and etree.QName(child).localname.endswith("Transformation"):
            text = f"must be a LinearTransformation, but is {etree.QName(child).localname}"
            structure.problems.append(Problem(place, text))
    if element.get("suppressUnitConversion") in {"true", "1"}:
        structure.problems.append(Problem(f"{place}.suppressUnitConversion", "must be false, but is true"))
    structure.drivers[target] = (source, factor, offset)


def _no_end(type_: str | None, kind: str | None) -> str:
    """Return why a connector cannot be joined; empty where it can."""
    if type_ == "Clock":
        return "a Clock: join clocks by `clock_connections` of a scenario"
    if type_ == "Binary":
        return "Binary, which no connection here carries"
    return "of the kind unspecified" if kind == "unspecified" else ""


def _descriptions(structure: Structure, path: Path, events: bool) -> dict[str, FmuDescription]:
    found: dict[str, FmuDescription] = {}
    known: dict[tuple[Path, bool], FmuDescription] = {}
    size = SystemSize(path)
    for name, file in structure.components.items():
        exchange = name in structure.exchanged
        try:
            if (file, exchange) not in known:
                known[file, exchange] = read_description(file, events, exchange=exchange)
            found[name] = known[file, exchange]
            size.add(len(found[name].model.variables), name)
        except FmuError as error:
            raise FmuError(f"{path}: {name}: {error}") from None
    return found


def _check_names(structure: Structure, models: Mapping[str, FmuDescription]) -> None:
    """Add connectors and values that components do not have, and clocks that have other intervals there."""
    joined = {*structure.drivers, *(source for source, _, _ in structure.drivers.values())}
    for (owner, variable), kind in structure.kinds.items():
        if owner in models and variable not in models[owner].model.variables:
            if kind in _PARAMETERS and (owner, variable) not in joined:
                _pass_over(structure, models[owner], owner, variable, "its connector")
                continue
            text = f"must be a variable of {models[owner].model.name}, but {variable!r} is none"
            structure.problems.append(Problem(f"$.{owner}.Connectors", text, mismatch=True))
    for owner, variable in structure.given:
        if owner not in models and (owner, variable) not in structure.kinds:
            text = f"must name a component's parameter or a system's connector, but {variable!r} of "
            structure.problems.append(Problem("$.ParameterBindings", f"{text}{owner or 'the system'} is none"))
    for (owner, clock), times in structure.clock_times.items():
        own = models[owner].model.clocks.get(clock) if owner in models else None
        for what, time in times.items():
            if own is not None and getattr(own, what) != time:
                text = f"must have the {what} of the FMU's clock, {getattr(own, what)} s, but has {time} s"
                structure.problems.append(Problem(f"$.{owner}.Connectors", f"{clock} {text}", mismatch=True))


def _pass_over(structure: Structure, description: FmuDescription, owner: str, variable: str, what: str) -> None:
    """Say that a parameter is left aside, for the FMU has none of its name."""
    model = description.model
    text = f"{what} {variable!r} is passed over, for {model.name} has no such variable"
    remark = RunRemark(owner, text + nearest(variable, list(model.variables)))
    structure.remarks += [] if remark in structure.remarks else [remark]


def _configured(
    structure: Structure,
    descriptions: Mapping[str, FmuDescription],
    names: Mapping[str, str],
    inputs: Mapping[str, Signal],
    path: Path,
    events: bool,
    size: SystemSize,
) -> dict[str, FmuDescription]:
    """Return the descriptions with the values of structural parameters, which are taken out of the bindings.

    ``size``: in which their variables are counted.
    """
    flow = Flow(structure, {name: d.model for name, d in descriptions.items()}, names)
    handed, found = flow.starts(inputs), {}
    for name, description in descriptions.items():
        values: dict[str, Value] = {}
        for parameter in sorted(description.structural):
            node = (name, parameter)
            given = handed.get(node, structure.given.get(node))
            structure.given.pop(node, None)
            structure.drivers.pop(node, None)
            if given is not None:
                value = own_value(description.model, parameter, given, structure.units, f"$.{name}", structure.problems)
                values |= {} if value is None else {parameter: value}
        try:
            file = structure.components[name]
            exchange = name in structure.exchanged
            found[name] = read_configured(file, values, events, exchange)[0] if values else description
            size.add(len(found[name].model.variables), name)
        except FmuError as error:
            raise FmuError(f"{path}: {name}: {error}") from None
    return found


def _instances(
    structure: Structure,
    descriptions: Mapping[str, FmuDescription],
    names: Mapping[str, str],
    handed: Mapping[Node, Given],
    tolerance: float | None,
) -> list[Instance]:
    """Return the components; what a system's connector hands to one stands over the component's own bindings."""
    instances = []
    for name, description in descriptions.items():
        start: dict[str, Value] = {}
        for (owner, variable), given in {**structure.given, **handed}.items():
            if owner == name and variable not in description.model.variables and not given.mapped:
                _pass_over(structure, description, owner, variable, "the value of the parameter")
            elif owner == name:
                # What comes from a system's connector has passed the component's already.
                unit = None if (owner, variable) in handed else structure.connector_units.get((owner, variable))
                value = own_value(
                    description.model, variable, given, structure.units, f"$.{name}", structure.problems, unit
                )
                if value is not None:
                    start[variable] = value
        path = structure.components[name]
        factory = FmuFactory(path, description)
        instances.append(Instance(names[name], description.model, factory, start, tolerance, is_ours(path)))
    return instances


def _experiment(root: etree._Element) -> tuple[float, float, float | None]:
    experiment = root.find(tag("ssd", "DefaultExperiment"))
    if experiment is None:
        return 0.0, DEFAULT_STOP, None
    start = float(experiment.get("startTime", "0"))
    stop = float(experiment.get("stopTime", start + DEFAULT_STOP))
    for annotation in experiment.iter(tag("ssc", "Annotation")):
        found = annotation.find("osp:Algorithm/osp:FixedStepAlgorithm", SPACES)
        if annotation.get("type") == OSP and found is not None:
            try:
                return start, stop, float(found.get("baseStepSize", "nan"))
            except ValueError:
                return start, stop, None
    return start, stop, None
