"""Scenarios from SSP files: any SSP 1.0 of FMI 2.0 co-simulation FMUs, with nested systems and parameter bindings."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from lxml import etree

from orchestrator.errors import FmuError, ScenarioError
from orchestrator.fmi.instances import FmuFactory
from orchestrator.fmi.model_description import read_description
from orchestrator.master.algorithms import GaussSeidel, Jacobi
from orchestrator.master.problems import Problem, raise_problems
from orchestrator.master.protocol import NUMERIC, Unit, Value
from orchestrator.master.signals import Scaled, Signal
from orchestrator.master.system import Connection, Instance, SignalSource, System
from orchestrator.scenarios.scenario import Scenario
from orchestrator.scenarios.ssp.common import OSP, SPACES, STRUCTURE, parse, solver_tolerance, tag
from orchestrator.scenarios.ssp.parameters import Given, bound_values, own_value, read_units
from orchestrator.shared.isolation.archives import unpack
from orchestrator.shared.isolation.scratch import Scratch

FMU_TYPE = "application/x-fmu-sharedlibrary"
DEFAULT_STOP = 1.0
DEFAULT_STEPS = 1000
Node = tuple[str, str]


@dataclass
class _Structure:
    """What is found while walking through nested systems. Elements are named by their path, joined by slashes."""

    folder: Path
    units: Mapping[str, Unit]
    problems: list[Problem] = field(default_factory=list)
    components: dict[str, Path] = field(default_factory=dict)
    kinds: dict[Node, str] = field(default_factory=dict)
    drivers: dict[Node, tuple[Node, float, float]] = field(default_factory=dict)
    given: dict[Node, Given] = field(default_factory=dict)


@contextmanager
def opened_ssp(
    path: Path, inputs: Mapping[str, Signal] | None = None, step: float | None = None, simultaneous: bool = False
) -> Iterator[Scenario]:
    """Yield the scenario that an SSP file describes; its FMUs lie in a private folder until the block ends.

    All outputs are recorded. Components of nested systems are called ``system/component``.

    Args:
        path: the archive.
        inputs: signals for the input connectors of the outermost system, by name.
        step: communication step [s]; default: the file's own annotation, else a thousandth of the stop time.
        simultaneous: run side by side (Jacobi) rather than one after the other (Gauss-Seidel).

    Yields:
        The scenario.

    Raises:
        ScenarioError: the archive or its structure is wrong; all problems in one message.
        ConnectionMismatchError: its connections are.
        FmuError: one of its FMUs is.
    """
    if os.path.isdir(path):
        raise ScenarioError(f"`ssp` must be an archive, but {path} is a directory; zip what is in it")
    with Scratch("ssp") as scratch:
        try:
            unpack(path, scratch.path / "content")
        except FmuError as error:
            raise ScenarioError(str(error).replace("`fmu`", "`ssp`")) from None
        yield _scenario(path, scratch.path / "content", inputs or {}, step, simultaneous)


def _scenario(
    path: Path, folder: Path, inputs: Mapping[str, Signal], step: float | None, simultaneous: bool
) -> Scenario:
    file = folder / STRUCTURE
    if not file.is_file():
        raise ScenarioError(f"{path}: must hold {STRUCTURE}, but does not")
    root = parse(file.read_bytes(), "ssd", f"{path}: {STRUCTURE}")
    structure = _Structure(folder, read_units(root, "ssd"))
    system = root.find(tag("ssd", "System"))
    assert system is not None
    _walk(system, "", structure)
    raise_problems(structure.problems, f"{path}: {STRUCTURE}")
    instances = _instances(structure, path, solver_tolerance(system))
    connections, sources = _connections(structure, inputs)
    made = System(tuple(instances), tuple(connections), tuple(sources))
    raise_problems(structure.problems + made.problems(), f"{path}: {STRUCTURE}")
    start, stop, own_step = _experiment(root)
    grid = step or own_step or (stop - start) / DEFAULT_STEPS
    record = tuple(
        f"{i.name}.{v.name}"
        for i in instances
        for v in i.model.variables.values()
        if v.causality == "output" and v.type in NUMERIC and (i.name, v.name) in structure.kinds
    )
    algorithm = Jacobi(grid) if simultaneous else GaussSeidel(grid)
    return Scenario(made, record, algorithm, stop, start, root.get("name") or path.stem)


def _walk(system: etree._Element, path: str, structure: _Structure) -> None:
    """Collect components, connectors, connections and parameter values of a system and the systems within it."""
    _connectors(system, path, structure)
    for element in system.findall(tag("ssd", "Elements") + "/*"):
        name = f"{path}/{element.get('name')}" if path else str(element.get("name"))
        place = f"$.{name}"
        if "." in name:
            structure.problems.append(Problem(place, f"must have a name without a dot, but is called {name!r}"))
        elif element.tag == tag("ssd", "System"):
            _walk(element, name, structure)
        elif element.tag == tag("ssd", "Component"):
            _connectors(element, name, structure)
            _component(element, name, structure)
        else:
            structure.problems.append(Problem(place, "must be a component or a system, but is a signal dictionary"))
    for k, connection in enumerate(system.findall(f"{tag('ssd', 'Connections')}/{tag('ssd', 'Connection')}")):
        _connection(connection, path, f"$.{path or 'System'}.Connections[{k}]", structure)
    _bind(system, path, structure)


def _connectors(element: etree._Element, path: str, structure: _Structure) -> None:
    for connector in element.findall(f"{tag('ssd', 'Connectors')}/{tag('ssd', 'Connector')}"):
        structure.kinds[path, str(connector.get("name"))] = str(connector.get("kind"))


def _component(element: etree._Element, name: str, structure: _Structure) -> None:
    source, kind = str(element.get("source")), element.get("type", FMU_TYPE)
    file = (structure.folder / source).resolve()
    if kind != FMU_TYPE:
        structure.problems.append(Problem(f"$.{name}.type", f"must be {FMU_TYPE}, but is {kind!r}"))
    elif element.get("implementation") == "ModelExchange":
        structure.problems.append(Problem(f"$.{name}.implementation", "must be CoSimulation, but is ModelExchange"))
    elif not (file.is_relative_to(structure.folder.resolve()) and os.path.isfile(file)):
        structure.problems.append(Problem(f"$.{name}.source", f"must be a file of the archive, but is {source!r}"))
    else:
        structure.components[name] = file
    _bind(element, name, structure)


def _bind(element: etree._Element, path: str, structure: _Structure) -> None:
    for name, value in bound_values(element, f"$.{path or 'System'}", structure.folder, structure.problems):
        # The innermost binding is read first and the outer one wins, as the standard has it.
        owner, parameter = path, name
        while (
            (owner, parameter) not in structure.kinds and "." in parameter and _has_child(structure, owner, parameter)
        ):
            child, _, parameter = parameter.partition(".")
            owner = f"{owner}/{child}" if owner else child
        structure.given[owner, parameter] = value


def _has_child(structure: _Structure, owner: str, parameter: str) -> bool:
    child = parameter.partition(".")[0]
    full = f"{owner}/{child}" if owner else child
    known = {*structure.components, *(path for path, _ in structure.kinds)}
    return any(name == full or name.startswith(full + "/") for name in known)


def _connection(element: etree._Element, path: str, place: str, structure: _Structure) -> None:
    ends = []
    for side in ("start", "end"):
        child, connector = element.get(f"{side}Element"), str(element.get(f"{side}Connector"))
        owner = path if child is None else f"{path}/{child}" if path else child
        kind = structure.kinds.get((owner, connector))
        if kind is None:
            text = f"must be a connector of {owner or 'the system'}, but {connector!r} is none"
            structure.problems.append(Problem(f"{place}.{side}Connector", text, mismatch=True))
            return
        gives = kind in ("output", "calculatedParameter") if child is not None else kind in ("input", "parameter")
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


def _instances(structure: _Structure, path: Path, tolerance: float | None) -> list[Instance]:
    instances = []
    for name, file in structure.components.items():
        try:
            description = read_description(file)
        except FmuError as error:
            raise FmuError(f"{path}: {name}: {str(error).replace(str(file), file.name)}") from None
        start: dict[str, Value] = {}
        for (owner, variable), given in structure.given.items():
            if owner == name:
                value = own_value(description.model, variable, given, structure.units, f"$.{name}", structure.problems)
                if value is not None:
                    start[variable] = value
        for node in structure.kinds:
            if node[0] == name and node[1] not in description.model.variables:
                text = f"must be a variable of {description.model.name}, but {node[1]!r} is none"
                structure.problems.append(Problem(f"$.{name}.Connectors", text, mismatch=True))
        instances.append(Instance(name, description.model, FmuFactory(file, description), start, tolerance))
    for owner, variable in structure.given:
        if owner not in structure.components:
            text = f"must name a component's parameter, but {variable!r} of {owner or 'the system'} is none"
            structure.problems.append(Problem("$.ParameterBindings", text))
    return instances


def _connections(structure: _Structure, inputs: Mapping[str, Signal]) -> tuple[list[Connection], list[SignalSource]]:
    """Follow each component's input back through the connectors of systems to the component that feeds it."""
    connections, sources = [], []
    for target in [node for node in structure.drivers if node[0] in structure.components]:
        node, factor, offset = structure.drivers[target]
        while node[0] not in structure.components and node in structure.drivers:
            node, inner_factor, inner_offset = structure.drivers[node]
            factor, offset = factor * inner_factor, factor * inner_offset + offset
        name = ".".join(target)
        if node[0] in structure.components:
            connections.append(Connection(".".join(node), name, factor, offset))
        elif node[0] == "" and node[1] in inputs:
            # As other tools do: what is set at a communication point holds over the step from there.
            sources.append(SignalSource(name, Scaled(inputs[node[1]], factor, offset), at="start"))
    for name in inputs:
        if structure.kinds.get(("", name)) != "input":
            structure.problems.append(Problem("$.System.Connectors", f"must have an input {name!r}, but has none"))
    return connections, sources


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
